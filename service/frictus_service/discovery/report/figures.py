"""What the report's figures are drawn from: residuals by tone and covariate, levels, places."""

from collections.abc import Iterable, Iterator, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from frictus_hardware.arrays import FloatArray
from frictus_service.discovery.decision.prediction_gain import DB, DEGREES
from frictus_service.discovery.document import Covariate, LevelBin, ResidualBin, Unexplained
from frictus_service.discovery.evidence.evidence_rows import Subject
from frictus_service.discovery.evidence.residuals import Compared
from frictus_service.discovery.inference.linearisation import Linearised
from frictus_service.discovery.problem.problem import DiscoveryProblem

LEAST_UNITS: Final = 2
BINS: Final = 3
"""Of time and of position."""


def rests_of(
    problem: DiscoveryProblem, model: Linearised, effects: Sequence[int]
) -> list[Compared]:
    """Return what a fitted model leaves of each subject.

    Parameters
    ----------
    problem : DiscoveryProblem
        Data, base model and candidates.
    model : Linearised
        A fitted model with the units about it.
    effects : sequence of int
        Numbers of candidates.
    """
    return [
        problem.rest(subject, own, effects, row)
        for subject, own, row in zip(
            problem.subjects, model.own, model.coefficients, strict=True
        )
    ]


def residual_bins(
    problem: DiscoveryProblem,
    tones_hz: FloatArray,
    before: Sequence[Compared],
    after: Sequence[Compared],
) -> list[ResidualBin]:
    """Return means over units by covariate, level and tone.

    Parameters
    ----------
    problem : DiscoveryProblem
        Data, base model and candidates.
    tones_hz : ndarray
        Of the study.
    before, after : sequence of Compared
        What is left of each subject.
    """
    bins = []
    for covariate in ("speed", "force", "minutes", "direction", "position"):
        labels = _levels(problem.subjects, covariate)
        for level in sorted({value for each in labels for value in np.unique(each)}):
            for tone in range(tones_hz.size):
                found = list(_means(problem.subjects, labels, level, tone, before, after))
                if len(found) >= LEAST_UNITS:
                    bins.append(_bin(covariate, level, float(tones_hz[tone]), np.array(found)))
    return bins


def _means(
    subjects: Sequence[Subject],
    labels: Sequence[FloatArray],
    level: float,
    tone: int,
    before: Sequence[Compared],
    after: Sequence[Compared],
) -> Iterator[tuple[float, ...]]:
    for subject, label, old, new in zip(subjects, labels, before, after, strict=True):
        here = (label == level) & (subject.tone == tone)
        if here.any():
            parts = (old.size, old.phase, new.size, new.phase)
            yield tuple(float(np.median(part[here])) for part in parts)


def _bin(covariate: Covariate, level: float, tone_hz: float, found: FloatArray) -> ResidualBin:
    mean, error = found.mean(axis=0), found.std(axis=0, ddof=1) / np.sqrt(found.shape[0])
    return ResidualBin(
        covariate=covariate,
        level=float(level),
        tone_hz=tone_hz,
        before_db=DB * mean[0],
        before_deg=DEGREES * mean[1],
        after_db=DB * mean[2],
        after_deg=DEGREES * mean[3],
        before_error_db=DB * error[0],
        before_error_deg=DEGREES * error[1],
        error_db=DB * error[2],
        error_deg=DEGREES * error[3],
    )


def _levels(subjects: Sequence[Subject], covariate: Covariate) -> list[FloatArray]:
    """Return the level that each row of each subject belongs to."""
    if covariate == "speed":
        return [subject.target_mm_s[subject.trial] for subject in subjects]
    if covariate == "force":
        return [subject.target_n[subject.trial] for subject in subjects]
    if covariate == "direction":
        return [subject.rows.circumstances.direction for subject in subjects]
    name = "minutes" if covariate == "minutes" else "position_mm"
    values: list[FloatArray] = [getattr(s.rows.circumstances, name) for s in subjects]
    every = np.concatenate(values)
    ends = np.linspace(every.min(), every.max(), BINS + 1)
    middle = 0.5 * (ends[1:] + ends[:-1])
    return [middle[np.clip(np.searchsorted(ends, v) - 1, 0, BINS - 1)] for v in values]


def level_bins(
    problem: DiscoveryProblem,
    base: tuple[Linearised, Sequence[int]],
    extended: tuple[Linearised, Sequence[int]],
) -> list[LevelBin]:
    """Return harmonics, line and low-frequency power by speed, measured and predicted.

    Parameters
    ----------
    problem : DiscoveryProblem
        Data, base model and candidates.
    base, extended : tuple of Linearised and sequence of int
        Model and its candidates.
    """
    if problem.response == "mobility":
        return []
    models = [
        [
            problem.predicted(subject, own, effects, row)
            for subject, own, row in zip(
                problem.subjects, model.own, model.coefficients, strict=True
            )
        ]
        for model, effects in (base, extended)
    ]
    bins = []
    for channel in ("second", "third", "line", "low"):
        levels = sorted({v for s in problem.subjects for v in np.unique(s.target_mm_s)})
        for level in levels:
            found = []
            for subject, old, new in zip(problem.subjects, *models, strict=True):
                here = subject.target_mm_s == level
                triple = [
                    _level(channel, each, subject, here)
                    for each in (subject.measured, old, new)
                ]
                if np.all(np.isfinite(triple)):
                    found.append(triple)
            if len(found) >= LEAST_UNITS:
                table = np.array(found)
                bins.append(
                    LevelBin(
                        channel=channel,
                        covariate="speed",
                        level=float(level),
                        measured=float(table[:, 0].mean()),
                        before=float(table[:, 1].mean()),
                        after=float(table[:, 2].mean()),
                        standard_error=float(table[:, 0].std(ddof=1) / np.sqrt(len(found))),
                        unit="share of the tone" if channel in ("second", "third") else "N",
                    )
                )
    return bins


def _level(channel: str, each: Compared, subject: Subject, trials: NDArray[np.bool_]) -> float:
    """Return the mean of a channel in some trials: a share, or an amplitude in N."""
    if channel in ("second", "third"):
        values = getattr(each, channel)[trials[subject.trial], 0]
        values = values[np.isfinite(subject_seen(subject, channel)[trials[subject.trial]])]
        return float(np.median(values)) if values.size else np.nan
    if channel == "line":
        line = max(
            ("line50", "line60"), key=lambda name: _power(getattr(subject.measured, name))
        )
        power = _power(getattr(each, line)[trials])
        return float(np.sqrt(2.0 * max(power, 0.0))) if np.isfinite(power) else np.nan
    values = each.low[trials]
    seen = np.isfinite(subject.measured.low[trials])
    return float(np.exp(0.5 * np.median(values[seen]))) if seen.any() else np.nan


def subject_seen(subject: Subject, channel: str) -> FloatArray:
    """Return what was measured of a harmonic, NaN where nothing was."""
    seen: FloatArray = getattr(subject.measured, channel)[:, 0]
    return seen


def _power(values: FloatArray) -> float:
    known = values[np.isfinite(values)]
    return float(np.mean(known)) if known.size else np.nan


def each_place_once(left: Iterable[Unexplained]) -> tuple[Unexplained, ...]:
    """Return each place once, the clearest first: several patterns may have one place.

    Parameters
    ----------
    left : iterable of Unexplained
        One of each pattern.
    """
    places = dict[object, Unexplained]()
    for one in sorted(left, key=lambda one: one.p_value):
        places.setdefault((one.channel, one.band_hz, one.covariate), one)
    return tuple(places.values())

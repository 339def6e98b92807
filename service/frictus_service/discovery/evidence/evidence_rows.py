"""What a unit of trials says about the model, as rows."""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy import stats

from frictus_hardware.arrays import BoolArray, FloatArray, IntArray
from frictus_hardware.physics.schedule import SlidingConditions
from frictus_hardware.physics.simulator import Probe
from frictus_service.discovery.evidence.residuals import Compared, Layout, lay_out

QUIET: Final = 0.1
"""Share of the trials that are quieter than that."""
WANDER: Final = 0.03
"""Standard deviation of a finger's speed within a row, as a share of its mean, about."""
LEAST_MM_S: Final = 0.02
"""Change of speed that is worth a thought."""


@dataclass(frozen=True, slots=True)
class EvidenceRows:
    """Rows of the whole study, sweeps of equal direction and third of a trial taken together.

    Arrays of shape (n_rows,), or (n_trials,) where the name says so.

    Attributes
    ----------
    unit_of_trial, condition_of_trial : ndarray of int
        Unit of each trial; number of its target speed and force.
    target_mm_s, target_n : ndarray
        Of each trial.
    trial, tone : ndarray of int
        Of each row; tones count from 0 in `tones_hz`.
    tones_hz : ndarray, shape (n_tones,)
    rows : Probe
        Where each row was measured.
    trials : Probe
        Where each trial was measured, on average; its tone means nothing.
    measured : Compared
        What was measured; NaN where nothing was.
    variance : ndarray
        Of ln size and of phase of each row, from the noise beside it.
    """

    unit_of_trial: IntArray
    condition_of_trial: IntArray
    target_mm_s: FloatArray
    target_n: FloatArray
    trial: IntArray
    tone: IntArray
    tones_hz: FloatArray
    rows: Probe
    trials: Probe
    measured: Compared
    variance: FloatArray


@dataclass(frozen=True, slots=True)
class Subject:
    """One unit's evidence.

    Attributes
    ----------
    rows, trials : Probe
        Where each was measured.
    tone : ndarray of int, shape (n_rows,)
    measured : Compared
        What was measured; NaN where nothing was.
    layout : Layout
        Which rows make which reading.
    quiet_n2 : float
        Power of its friction from 4 to 30 Hz in its quietest trials.
    condition : ndarray of int, shape (n_trials,)
        Numbers the target speeds and forces.
    target_mm_s, target_n : ndarray, shape (n_trials,)
    """

    rows: Probe
    trials: Probe
    tone: IntArray
    trial: IntArray
    measured: Compared
    layout: Layout
    quiet_n2: float
    condition: IntArray
    target_mm_s: FloatArray
    target_n: FloatArray


def subjects_of(rows: EvidenceRows, n_units: int) -> list[Subject]:
    """Return one subject per unit.

    Parameters
    ----------
    rows : EvidenceRows
        Of the whole study.
    n_units : int
        Participants, or blocks of their trials.
    """
    return [
        _with_trials(rows, rows.unit_of_trial == unit, rows.condition_of_trial)
        for unit in range(n_units)
    ]


def part_of(subject: Subject, trials: BoolArray) -> Subject:
    """Return a subject with some of its trials.

    Parameters
    ----------
    subject : Subject
        The evidence of one unit.
    trials : ndarray of bool, shape (n_trials,)
    """
    return _with_trials(subject, trials, subject.condition, subject.quiet_n2)


def _with_trials(
    source: EvidenceRows | Subject,
    trials: BoolArray,
    condition: IntArray,
    quiet_n2: float | None = None,
) -> Subject:
    kept = np.flatnonzero(trials)
    place = np.full(trials.size, -1)
    place[kept] = np.arange(kept.size)
    rows = np.flatnonzero(place[source.trial] >= 0)
    trial, tone = place[source.trial[rows]], source.tone[rows]
    measured = _part(source.measured, rows, kept)
    return Subject(
        rows=take(source.rows, rows),
        trials=take(source.trials, kept),
        tone=tone,
        trial=trial,
        measured=measured,
        layout=lay_out(trial, tone, measured),
        quiet_n2=_quiet(measured.low) if quiet_n2 is None else quiet_n2,
        condition=condition[kept],
        target_mm_s=source.target_mm_s[kept],
        target_n=source.target_n[kept],
    )


def _part(measured: Compared, rows: IntArray, trials: IntArray) -> Compared:
    return Compared(
        size=measured.size[rows],
        phase=measured.phase[rows],
        second=measured.second[rows],
        third=measured.third[rows],
        line50=measured.line50[trials],
        line60=measured.line60[trials],
        low=measured.low[trials],
    )


def take(probe: Probe, rows: IntArray) -> Probe:
    """Return some rows of a probe."""
    c = probe.circumstances
    return Probe(
        tone_hz=probe.tone_hz[rows],
        message=probe.message[rows],
        message_mean=probe.message_mean[rows],
        message_power=probe.message_power[rows],
        circumstances=SlidingConditions(
            speed_mm_s=c.speed_mm_s[rows],
            normal_force_n=c.normal_force_n[rows],
            position_mm=c.position_mm[rows],
            direction=c.direction[rows],
            minutes=c.minutes[rows],
        ),
        **{
            name: np.broadcast_to(getattr(probe, name), probe.tone_hz.shape)[rows]
            for name in ("spread_hz", "skewness", "speed_spread_mm_s")
        },
    )


def _quiet(low: FloatArray) -> float:
    known = low[np.isfinite(low)]
    return float(np.exp(np.quantile(known, QUIET))) if known.size else 1.0


def within(subject: Subject, range_mm_s: tuple[float, float]) -> Subject:
    """Return a subject as if nothing followed its speed beyond a range.

    The speed wanders within a row: where its mean is near an end, it is beyond for a while.

    Parameters
    ----------
    subject : Subject
        The evidence of one unit.
    range_mm_s : tuple of float
        Lowest and highest speed.
    """
    low, high = range_mm_s
    circumstances = subject.rows.circumstances
    mean = circumstances.speed_mm_s
    spread = WANDER * mean
    inside = mean - _beyond(mean - high, spread) + _beyond(low - mean, spread)
    moved = np.abs(inside - mean) > LEAST_MM_S
    circumstances = replace(circumstances, speed_mm_s=np.where(moved, inside, mean))
    return replace(subject, rows=replace(subject.rows, circumstances=circumstances))


def as_asked(subject: Subject) -> Subject:
    """Return a subject whose finger moved and pressed just as it was asked to.

    Parameters
    ----------
    subject : Subject
        The evidence of one unit.
    """

    def moved(probe: Probe, trial: IntArray | slice) -> Probe:
        asked = replace(
            probe.circumstances,
            speed_mm_s=subject.target_mm_s[trial],
            normal_force_n=subject.target_n[trial],
        )
        return replace(probe, circumstances=asked)

    return replace(
        subject,
        rows=moved(subject.rows, subject.trial),
        trials=moved(subject.trials, slice(None)),
    )


def _beyond(mean: FloatArray, spread: FloatArray) -> FloatArray:
    """Return the mean of what is positive of a normal variable."""
    z = mean / spread
    found: FloatArray = mean * stats.norm.cdf(z) + spread * stats.norm.pdf(z)
    return found

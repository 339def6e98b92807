"""From the evidence of trials to the rows of a study, and to the units that are compared."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from frictus_hardware.physics.prediction import Probe
from frictus_hardware.physics.schedule import Circumstances
from frictus_service.discovery.evidence import TrialEvidence
from frictus_service.discovery.readings import Compared
from frictus_service.discovery.significance import LEAST_UNITS
from frictus_service.discovery.subjects import Rows

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
ComplexArray = NDArray[np.complex128]
ResponseName = Literal["friction", "mobility"]

BLOCKS: Final = 8
"""Units at least, where there are too few people: blocks of their trials."""
LEAST_TRIALS: Final = 8
"""Of a block."""
LEAST_N2: Final = 1e-15
"""Power below which nothing is told from nothing."""


@dataclass(frozen=True, slots=True)
class Units:
    """What is compared with what.

    Attributes
    ----------
    names : tuple of str
    participant : tuple of str
        Of each unit.
    of_trial : ndarray of int
    held_out : {'participants', 'blocks'}
    """

    names: tuple[str, ...]
    participant: tuple[str, ...]
    of_trial: IntArray
    held_out: Literal["participants", "blocks"]


def used(evidence: Sequence[TrialEvidence]) -> list[TrialEvidence]:
    """Return the trials that may be used and say something, by participant and order."""
    kept = [one for one in evidence if one.observed.valid and one.stretches.sweep.size]
    return sorted(
        kept,
        key=lambda one: (
            one.observed.info.participant,
            one.observed.info.session,
            one.observed.info.order,
            one.observed.info.id,
        ),
    )


def units_of(evidence: Sequence[TrialEvidence]) -> Units:
    """Return participants, or blocks of their trials where there are fewer than six.

    Blocks are dealt out like cards, so that each has trials from the whole of the session.

    Parameters
    ----------
    evidence : sequence of TrialEvidence
        From `used`.
    """
    people = [one.observed.info.participant for one in evidence]
    names = sorted(set(people))
    number = np.array([names.index(each) for each in people], dtype=np.int64)
    if len(names) >= LEAST_UNITS or not names:
        return Units(tuple(names), tuple(names), number, "participants")
    fewest = min(np.bincount(number))
    each = max(1, min(-(-BLOCKS // len(names)), int(fewest) // LEAST_TRIALS))
    place = np.array([people[:k].count(people[k]) for k in range(len(people))]) % each
    labels = tuple(f"{name}, block {k + 1}" for name in names for k in range(each))
    owners = tuple(name for name in names for _ in range(each))
    return Units(labels, owners, number * each + place, "blocks")


def rows_of(evidence: Sequence[TrialEvidence], units: Units, response: ResponseName) -> Rows:
    """Return the rows, sweeps of equal direction and third of a trial taken together.

    Parameters
    ----------
    evidence : sequence of TrialEvidence
        From `used`.
    units : Units
    response : {'friction', 'mobility'}
    """
    minutes = _minutes(evidence)
    sizes = [one.observed.rows.tone_hz.size for one in evidence]
    trial = np.repeat(np.arange(len(evidence)), sizes)

    def column(name: str) -> Any:
        return np.concatenate([getattr(one.observed.rows, name) for one in evidence])

    def harmonic(name: str) -> Any:
        return np.concatenate([getattr(one.harmonics, name) for one in evidence])

    measured = column("friction_response" if response == "friction" else "mobility")
    known = np.isfinite(measured) & (measured != 0.0)
    tones_hz, tone = np.unique(column("tone_hz"), return_inverse=True)
    keys = np.stack([trial, np.ravel(tone), column("direction"), column("third")])
    keys, group = np.unique(keys[:, known], axis=1, return_inverse=True)
    group = np.ravel(group)
    count = keys.shape[1]

    def mean(values: Any) -> Any:
        return _mean_of_known(values[known], group, count)

    rows = Probe(
        tone_hz=tones_hz[keys[1]].astype(np.float64),
        message=mean(np.abs(column("message"))).astype(np.complex128),
        message_mean=_filled(mean(harmonic("message_mean")), keys[0]),
        message_power=_filled(mean(harmonic("message_power")), keys[0]),
        circumstances=Circumstances(
            mean(column("speed_mm_s")),
            mean(column("normal_force_n")),
            mean(column("position_mm")),
            keys[2].astype(np.float64),
            minutes[keys[0]],
        ),
    )
    second, third = mean(harmonic("second")), mean(harmonic("third"))
    if response == "mobility":
        second, third = second * np.nan, third * np.nan
    ratio = mean(measured)
    trials, lines = _trials(evidence, minutes, response)
    compared = Compared(
        size=np.log(np.abs(ratio)),
        phase=np.angle(ratio),
        second=np.column_stack([second.real, second.imag]),
        third=np.column_stack([third.real, third.imag]),
        **lines,
    )
    infos = [one.observed.info for one in evidence]
    return Rows(
        unit_of_trial=units.of_trial,
        condition_of_trial=_conditions(evidence),
        target_mm_s=np.array([info.speed_mm_s for info in infos]),
        target_n=np.array([info.force_n for info in infos]),
        trial=keys[0],
        tone=keys[1],
        tones_hz=tones_hz,
        rows=rows,
        trials=trials,
        measured=compared,
    )


def _trials(
    evidence: Sequence[TrialEvidence], minutes: FloatArray, response: ResponseName
) -> tuple[Probe, dict[str, FloatArray]]:
    """Return where trials were measured, and what they say besides the response."""
    sizes = [one.stretches.sweep.size for one in evidence]
    group = np.repeat(np.arange(len(evidence)), sizes)

    def mean(name: str) -> FloatArray:
        values = np.concatenate([getattr(one.stretches, name) for one in evidence])
        found: FloatArray = _mean_of_known(values, group, len(evidence))
        return found

    nothing = np.zeros(len(evidence))
    probe = Probe(
        tone_hz=nothing + 100.0,
        message=nothing.astype(np.complex128),
        message_mean=nothing,
        message_power=nothing,
        circumstances=Circumstances(
            mean("speed_mm_s"),
            mean("normal_force_n"),
            mean("position_mm"),
            mean("direction"),
            minutes,
        ),
    )
    if response == "mobility":
        unseen = nothing * np.nan
        return probe, {"line50": unseen, "line60": unseen, "low": unseen}
    return probe, {
        "line50": mean("line50_n2"),
        "line60": mean("line60_n2"),
        "low": np.log(np.maximum(mean("low_n2"), LEAST_N2)),
    }


def _conditions(evidence: Sequence[TrialEvidence]) -> IntArray:
    """Return a number for the target speed and force of each trial."""
    targets = [(one.observed.info.speed_mm_s, one.observed.info.force_n) for one in evidence]
    number = {target: k for k, target in enumerate(sorted(set(targets)))}
    return np.array([number[target] for target in targets], dtype=np.int64)


def _minutes(evidence: Sequence[TrialEvidence]) -> FloatArray:
    """Return the minutes since each participant's session began."""
    infos = [one.observed.info for one in evidence]
    started = [datetime.fromisoformat(info.started_utc).timestamp() / 60.0 for info in infos]
    began: dict[tuple[str, int], float] = {}
    for info, at in zip(infos, started, strict=True):
        key = (info.participant, info.session)
        began[key] = min(began.get(key, at), at)
    return np.array(
        [at - began[i.participant, i.session] for i, at in zip(infos, started, strict=True)]
    )


def _filled(values: FloatArray, trial: IntArray) -> FloatArray:
    """Return what some stretches of a trial were too short to tell, from its others.

    The message is the same throughout a trial; where no stretch told it, it is that of the
    study on average.
    """
    own = _mean_of_known(values, trial, int(trial.max(initial=-1)) + 1)
    filled = np.where(np.isfinite(values), values, own[trial])
    return np.where(np.isfinite(filled), filled, np.nanmean(values))


def _mean_of_known(values: Any, group: IntArray, count: int) -> Any:
    """Return the mean of what is finite in each group, NaN where nothing is; complex too."""
    known = np.isfinite(values)
    number = np.bincount(group[known], minlength=count)
    parts = [values.real, values.imag] if np.iscomplexobj(values) else [values]
    with np.errstate(invalid="ignore"):
        means = [
            np.bincount(group[known], part[known], minlength=count) / number for part in parts
        ]
    return means[0] + 1j * means[1] if len(means) == 2 else means[0]

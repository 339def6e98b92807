"""From the evidence of trials to the rows of a study, and to the units that are compared."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from frictus_hardware.arrays import ComplexArray, FloatArray, IntArray
from frictus_hardware.physics.schedule import SlidingConditions
from frictus_hardware.physics.simulator import Probe
from frictus_service.discovery.evidence.band_noise import weight_of
from frictus_service.discovery.evidence.evidence_rows import EvidenceRows
from frictus_service.discovery.evidence.residuals import Compared
from frictus_service.discovery.evidence.trial_evidence import TrialEvidence

ResponseName = Literal["friction", "mobility"]

LEAST_UNITS: Final = 6
"""Five have 16 flips that differ in more than the sign of all: no p below 1/16."""
BLOCKS: Final = 8
"""Units at least, where there are too few people: blocks of their trials."""
LEAST_TRIALS: Final = 8
"""Of a block."""
LEAST_N2: Final = 1e-15
"""Power below which nothing is told from nothing."""


@dataclass(frozen=True, slots=True)
class UnitAssignment:
    """What is compared with what.

    Attributes
    ----------
    names : tuple of str
        Of each unit.
    participant : tuple of str
        Of each unit.
    of_trial : ndarray of int
        Unit of each trial.
    held_out : {'participants', 'blocks'}
    """

    names: tuple[str, ...]
    participant: tuple[str, ...]
    of_trial: IntArray
    held_out: Literal["participants", "blocks"]


def used(evidence: Sequence[TrialEvidence]) -> list[TrialEvidence]:
    """Return the trials that may be used and say something, by participant and order."""
    kept = [one for one in evidence if one.observed.valid and _placed(one)]
    return sorted(
        kept,
        key=lambda one: (
            one.observed.info.participant,
            one.observed.info.session,
            one.observed.info.order,
            one.observed.info.id,
        ),
    )


def _placed(one: TrialEvidence) -> bool:
    """Return whether a trial has a steady sweep of which place, speed and force are known."""
    at = one.stretches
    where = np.array([at.speed_mm_s, at.normal_force_n, at.position_mm])
    return bool(np.isfinite(where).all(axis=0).any())


def comparable(trials: Sequence[TrialEvidence], response: ResponseName) -> list[TrialEvidence]:
    """Return the trials of people whose trials say enough of a response.

    Parameters
    ----------
    trials : sequence of TrialEvidence
        From `used`.
    response : {'friction', 'mobility'}
    """
    telling = telling_of(trials, response)
    least = 1 if len(telling) >= LEAST_UNITS else LEAST_TRIALS
    return [one for one in trials if telling[one.observed.info.participant] >= least]


def telling_of(trials: Sequence[TrialEvidence], response: ResponseName) -> Counter[str]:
    """Return how many trials of each participant say something of a response.

    Parameters
    ----------
    trials : sequence of TrialEvidence
        Of one study.
    response : {'friction', 'mobility'}
    """
    return Counter(one.observed.info.participant for one in trials if says(one, response))


def says(one: TrialEvidence, response: ResponseName) -> bool:
    """Return whether a trial says something of a response, and where that was."""
    rows = one.observed.rows
    measured = rows.friction_response if response == "friction" else rows.mobility
    return bool(
        np.any(_known(measured, rows.speed_mm_s, rows.normal_force_n, rows.position_mm))
    )


def _known(measured: ComplexArray, *where: FloatArray) -> NDArray[np.bool_]:
    """Return which rows say something, and where that was."""
    placed = np.isfinite(np.array(where)).all(axis=0)
    found: NDArray[np.bool_] = np.isfinite(measured) & (measured != 0.0) & placed
    return found


def blocks_of(trials: Sequence[int]) -> list[int]:
    """Return into how many blocks the trials of each person are dealt: no more than needed.

    Parameters
    ----------
    trials : sequence of int
        How many each person has.
    """
    most = [count // LEAST_TRIALS for count in trials]
    each = 1
    while sum(min(each, m) for m in most) < BLOCKS and each < max(most, default=0):
        each += 1
    return [min(each, m) for m in most]


def dealt(tones: Sequence[tuple[float, ...]], blocks: int) -> IntArray:
    """Return the block of each of a person's trials, shape (n_trials,).

    They are dealt out like cards, those with the same tones after each other, in time: each
    block has trials of all tones and of the whole session. Who gets which card of a round is
    drawn, or blocks might have one force each.

    Parameters
    ----------
    tones : sequence of tuple of float
        Of each trial, in the order of time.
    blocks : int
        Of one person.
    """
    rng = np.random.default_rng(0)  # the same trials make the same blocks
    rounds = -(-len(tones) // blocks)
    cards = [rng.permutation(blocks) for _ in range(rounds)]
    found = np.empty(len(tones), dtype=np.int64)
    order = sorted(range(len(tones)), key=lambda trial: tones[trial])
    found[order] = np.concatenate([*cards, np.empty(0, dtype=np.int64)])[: len(tones)]
    return found


def units_of(evidence: Sequence[TrialEvidence], response: ResponseName) -> UnitAssignment:
    """Return participants, or blocks of their trials where there are fewer than six.

    Parameters
    ----------
    evidence : sequence of TrialEvidence
        From `comparable`.
    response : {'friction', 'mobility'}
    """
    people = [one.observed.info.participant for one in evidence]
    names = sorted(set(people))
    number = np.array([names.index(each) for each in people], dtype=np.int64)
    if len(names) >= LEAST_UNITS or not names:
        return UnitAssignment(tuple(names), tuple(names), number, "participants")
    telling = telling_of(evidence, response)
    blocks = blocks_of([telling[name] for name in names])
    first = np.cumsum([0, *blocks])
    unit = np.empty(number.size, dtype=np.int64)
    for person, count in enumerate(blocks):
        own = np.flatnonzero(number == person)
        tones = [evidence[trial].observed.info.tones_hz for trial in own.tolist()]
        unit[own] = first[person] + dealt(tones, count)
    owners = tuple(name for place, name in enumerate(names) for _ in range(blocks[place]))
    labels = tuple(
        f"{name}, block {k + 1}"
        for place, name in enumerate(names)
        for k in range(blocks[place])
    )
    return UnitAssignment(labels, owners, unit, "blocks")


def rows_of(
    evidence: Sequence[TrialEvidence], units: UnitAssignment, response: ResponseName
) -> EvidenceRows:
    """Return the rows, sweeps of equal direction and third of a trial taken together.

    Sweeps weigh by the power that drives.

    Parameters
    ----------
    evidence : sequence of TrialEvidence
        From `used`.
    units : UnitAssignment
        Which trial belongs to which unit.
    response : {'friction', 'mobility'}
    """
    minutes = _minutes(evidence)
    sizes = [one.observed.rows.tone_hz.size for one in evidence]
    trial = np.repeat(np.arange(len(evidence)), sizes)

    def column(name: str) -> Any:
        return np.concatenate([getattr(one.observed.rows, name) for one in evidence])

    def harmonic(name: str) -> Any:
        return np.concatenate([getattr(one.harmonics, name) for one in evidence])

    friction = response == "friction"
    weighed = "" if friction else "mobility_"
    measured = column("friction_response" if friction else "mobility")
    variance = column("friction_variance" if friction else "mobility_variance")
    where = ("speed_mm_s", "normal_force_n", "position_mm")
    known = _known(measured, *(column(name) for name in where))
    tones_hz, tone = np.unique(column("tone_hz"), return_inverse=True)
    keys = np.stack([trial, np.ravel(tone), column("direction"), column("third")])
    keys, group = np.unique(keys[:, known], axis=1, return_inverse=True)
    group = np.ravel(group)
    count = keys.shape[1]
    weight = weight_of(np.abs(column("message")))[known]

    def mean(values: Any) -> Any:
        return _mean_of_known(values[known], group, count, weight)

    rows = Probe(
        tone_hz=mean(harmonic(f"{weighed}centroid_hz")),
        message=mean(np.abs(column("message"))).astype(np.complex128),
        message_mean=_filled(mean(harmonic("message_mean")), keys[0]),
        message_power=_filled(mean(harmonic("message_power")), keys[0]),
        circumstances=SlidingConditions(
            mean(column("speed_mm_s")),
            mean(column("normal_force_n")),
            mean(column("position_mm")),
            keys[2].astype(np.float64),
            minutes[keys[0]],
        ),
        spread_hz=mean(harmonic(f"{weighed}spread_hz")),
        skewness=mean(harmonic(f"{weighed}skewness")),
        speed_spread_mm_s=mean(harmonic("speed_spread_mm_s")),
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
    return EvidenceRows(
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
        variance=mean(variance / np.square(np.abs(measured))) / np.bincount(group),
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
        circumstances=SlidingConditions(
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
    everywhere = values[np.isfinite(values)]
    return np.where(np.isfinite(filled), filled, everywhere.mean() if everywhere.size else 0.0)


def _mean_of_known(
    values: Any, group: IntArray, count: int, weight: FloatArray | float = 1.0
) -> Any:
    """Return the mean of what is finite in each group, NaN where nothing is; complex too."""
    known = np.isfinite(values)
    weight = np.broadcast_to(weight, known.shape)
    number = np.bincount(group[known], weight[known], minlength=count)
    parts = [values.real, values.imag] if np.iscomplexobj(values) else [values]
    with np.errstate(invalid="ignore"):
        means = [
            np.bincount(group[known], (weight * part)[known], minlength=count) / number
            for part in parts
        ]
    return means[0] + 1j * means[1] if len(means) == 2 else means[0]

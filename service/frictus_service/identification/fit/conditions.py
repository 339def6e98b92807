"""The rows of all usable trials as flat arrays, and which of them are fitted together."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from frictus_hardware.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from frictus_service.errors import NothingToIdentifyError
from frictus_service.identification.observation.observe import list_reasons
from frictus_service.identification.observation.response import ResponseRows, TrialObservations

LEAST_RELATIVE = 1e-4
"""No response is known better than this share of its size."""


@dataclass(frozen=True, slots=True)
class Condition:
    """One participant at one target speed and one target force."""

    participant: str
    speed_mm_s: float
    force_n: float

    @classmethod
    def of(cls, trial: TrialObservations) -> "Condition":
        """Return the condition of a trial."""
        info = trial.info
        return cls(info.participant, info.speed_mm_s, info.force_n)


@dataclass(frozen=True, slots=True)
class ObservationTable:
    """Rows of all usable trials; arrays of shape (n_rows,), as in `Rows`.

    Attributes
    ----------
    trials : tuple of TrialObservations
        Those that are used.
    trial : ndarray of int
        Index into `trials`.
    conditions : tuple of Condition
        By participant, speed and force.
    condition : ndarray of int
        Index into `conditions`.
    """

    trials: tuple[TrialObservations, ...]
    trial: IntArray
    conditions: tuple[Condition, ...]
    condition: IntArray
    sweep: IntArray
    direction: IntArray
    third: IntArray
    speed_mm_s: FloatArray
    normal_force_n: FloatArray
    tone_hz: FloatArray
    friction_response: ComplexArray
    friction_variance: FloatArray
    mobility: ComplexArray
    mobility_variance: FloatArray

    @classmethod
    def of(cls, observations: Sequence[TrialObservations]) -> "ObservationTable":
        """Collect the rows of the valid trials, of conditions that were measured.

        Raises
        ------
        NothingToIdentifyError
            If there is none.
        """
        usable = [item for item in observations if item.valid and item.rows.tone_hz.size]
        measured = {Condition.of(item) for item in usable if _is_measured(item.rows)}
        used = tuple(item for item in usable if Condition.of(item) in measured)
        if not used:
            raise NothingToIdentifyError(_why_nothing(observations))
        sizes = [item.rows.tone_hz.size for item in used]
        keys = [Condition.of(item) for item in used]
        conditions = sorted(
            set(keys), key=lambda key: (key.participant, key.speed_mm_s, key.force_n)
        )
        place = {key: index for index, key in enumerate(conditions)}
        columns = {
            name: np.concatenate([getattr(item.rows, name) for item in used])
            for name in cls.__dataclass_fields__
            if name not in ("trials", "trial", "conditions", "condition")
        }
        return cls(
            trials=used,
            trial=np.repeat(np.arange(len(used)), sizes),
            conditions=tuple(conditions),
            condition=np.repeat([place[key] for key in keys], sizes),
            **columns,
        )

    @property
    def participants(self) -> tuple[str, ...]:
        """Pseudonyms, sorted."""
        return tuple(sorted({condition.participant for condition in self.conditions}))


@dataclass(frozen=True, slots=True)
class Sample:
    """Responses, and what they share; rows of shape (n_rows,), everything counted from 0.

    Attributes
    ----------
    tone_hz, speed_mm_s : ndarray
        Of each row.
    response : ndarray of complex
        Of each row.
    variance : ndarray
        Of real and imaginary part each.
    segment, trial, cell : ndarray of int
        Third of a sweep of a trial, trial, tone of a trial: what may deviate together.
    trial_of_segment, trial_of_cell, condition_of_trial : ndarray of int
        One parent each; conditions number what is fitted together.
    people : ndarray of int, shape (n_conditions,)
        Participant of each condition.
    """

    tone_hz: FloatArray
    speed_mm_s: FloatArray
    response: ComplexArray
    variance: FloatArray
    segment: IntArray
    trial: IntArray
    cell: IntArray
    trial_of_segment: IntArray
    trial_of_cell: IntArray
    condition_of_trial: IntArray
    people: IntArray

    @property
    def condition(self) -> IntArray:
        """Condition of each row."""
        return self.condition_of_trial[self.trial]

    def of_person(self, person: int) -> "Sample":
        """Return the rows of one participant, who is number 0 in them."""
        conditions = self.people == person
        trials = conditions[self.condition_of_trial]
        segments, cells = trials[self.trial_of_segment], trials[self.trial_of_cell]
        rows = trials[self.trial]
        trial_of = np.cumsum(trials) - 1
        return Sample(
            self.tone_hz[rows],
            self.speed_mm_s[rows],
            self.response[rows],
            self.variance[rows],
            (np.cumsum(segments) - 1)[self.segment[rows]],
            trial_of[self.trial[rows]],
            (np.cumsum(cells) - 1)[self.cell[rows]],
            trial_of[self.trial_of_segment[segments]],
            trial_of[self.trial_of_cell[cells]],
            (np.cumsum(conditions) - 1)[self.condition_of_trial[trials]],
            np.zeros(np.count_nonzero(conditions), dtype=np.int64),
        )


@dataclass(frozen=True, slots=True)
class Selection:
    """A sample, and which of the groups asked for are in it.

    Attributes
    ----------
    sample : Sample
        Rows that are fitted together.
    groups : ndarray of int
        Number of the group that each condition of the sample is.
    tones : ndarray of int, shape (n_groups,)
        Different tones of each group, of the left out ones too.
    """

    sample: Sample
    groups: IntArray
    tones: IntArray


def select(
    table: ObservationTable,
    response: Literal["friction", "mobility"],
    group: IntArray,
    people: IntArray,
    least_tones: int,
    highest_hz: float = np.inf,
) -> Selection:
    """Return the rows of the groups that have enough tones.

    Parameters
    ----------
    table : ObservationTable
        Rows of all usable trials.
    response : {'friction', 'mobility'}
    group : ndarray of int, shape (n_rows,)
        What is fitted together; negative: left out.
    people : ndarray of int, shape (n_groups,)
        Participant of each group.
    least_tones : int
        Of a group that is fitted.
    highest_hz : float
        Tones above are left out.
    """
    value, variance = (
        (table.friction_response, table.friction_variance)
        if response == "friction"
        else (table.mobility, _smoothed(table))
    )
    there = np.isfinite(value) & np.isfinite(variance) & (value != 0.0) & (group >= 0)
    there &= table.tone_hz <= highest_hz
    tones = np.zeros(people.size, dtype=np.int64)
    pairs = np.unique(np.column_stack([group[there], table.tone_hz[there]]), axis=0)
    np.add.at(tones, pairs[:, 0].astype(np.int64), 1)
    there &= np.where(group >= 0, tones[group], 0) >= least_tones
    groups, condition = np.unique(group[there], return_inverse=True)
    sample = _sample(table, there, condition, value, variance, people[groups])
    return Selection(sample, groups, tones)


def _sample(
    table: ObservationTable,
    there: BoolArray,
    condition: IntArray,
    value: ComplexArray,
    variance: FloatArray,
    people: IntArray,
) -> Sample:
    """Return some rows of the table, what they share numbered from 0."""
    trial, condition_of_trial = _number(table.trial[there], condition, parent=condition)
    third = table.sweep[there] * 3 + table.third[there]
    segment, trial_of_segment = _number(trial, third, parent=trial)
    _, tone = np.unique(table.tone_hz[there], return_inverse=True)
    cell, trial_of_cell = _number(trial, tone, parent=trial)
    value, variance = value[there], variance[there]
    return Sample(
        table.tone_hz[there],
        table.speed_mm_s[there],
        value,
        np.maximum(variance, np.square(LEAST_RELATIVE * np.abs(value))),
        segment,
        trial,
        cell,
        trial_of_segment,
        trial_of_cell,
        condition_of_trial,
        people,
    )


def _smoothed(table: ObservationTable) -> FloatArray:
    """Return variances of the mobility that do not follow each row's own error.

    A ratio whose denominator came out small is large and says that it is uncertain; weighted by
    that, large values would count less. Per trial and tone the median relative variance is
    taken, and the median size.
    """
    size = np.square(np.abs(table.mobility))
    with np.errstate(divide="ignore", invalid="ignore"):
        relative = table.mobility_variance / size
    smoothed = np.full(relative.shape, np.nan)
    there = np.flatnonzero(np.isfinite(relative))
    if not there.size:
        return smoothed
    _, tone = np.unique(table.tone_hz[there], return_inverse=True)
    key = table.trial[there] * (tone.max(initial=0) + 1) + tone
    order = np.argsort(key, kind="stable")
    edges = np.flatnonzero(np.diff(key[order])) + 1
    for rows in np.split(there[order], edges):
        smoothed[rows] = np.median(relative[rows]) * np.median(size[rows])
    return smoothed


def _number(first: IntArray, second: IntArray, parent: IntArray) -> tuple[IntArray, IntArray]:
    """Return the number of each pair, from 0, and the parent of each number."""
    key = first * (int(second.max(initial=0)) + 1) + second
    _, at, number = np.unique(key, return_index=True, return_inverse=True)
    return number, parent[at]


def _is_measured(rows: ResponseRows) -> bool:
    """Return whether some row has its speed and its normal force."""
    return bool(np.isfinite(rows.speed_mm_s * rows.normal_force_n).any())


def _why_nothing(observations: Sequence[TrialObservations]) -> str:
    if not observations:
        return "the study has no trial that can be read; accepted: one at least, with a drive"
    reasons = list_reasons(item.reasons or item.notes for item in observations)
    driven = sum(bool(item.info.tones_hz) for item in observations)
    told = f": {reasons}" if reasons else ""
    return (
        f"none of {len(observations)} trials ({driven} driven by tones) can be used{told}; "
        "accepted: trials driven by tones, a steady sweep and valid speed and force "
        "(a broadband drive is for frictus discover, none for study show --friction)"
    )

"""What is compared, measured with simulated, and in which parts its scatter is independent.

The response is compared as the logarithm of its ratio: a share of size, radians of phase. Size
deviates with each contact, all tones and stretches of a trial alike, by a multiple of what it
deviates within a trial; so trial, tone within the trial and stretch within the tone are
readings of their own, each with its own scatter.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Final

import numpy as np

from frictus_hardware.arrays import BoolArray, FloatArray, IntArray

RESPONSE: Final = 0.004
"""Share of the size, and radians: what speed varies and bends within a third of a stroke makes
of a response that follows it; see `tests/hardware/physics/test_observed.py`."""
HARMONICS: Final = 3e-4
LINE_N2: Final = 1e-7
LOW: Final = 0.4
"""Of a logarithm: a factor of one and a half."""

LEAST_IN_GROUP: Final = 8
"""Readings that determine a scatter of their own; fewer share that of their part."""
LARGE: Final = 2.5
"""Readings so many scatters off weigh less (Huber)."""


@dataclass(frozen=True, slots=True)
class Compared:
    """Any quantity of the form of the data: data, prediction, derivative, generic pattern.

    Attributes
    ----------
    size, phase : ndarray, shape (n_rows,)
        ln |H|, and radians.
    second, third : ndarray of float, shape (n_rows, 2)
        Harmonics as shares of the fundamental, real and imaginary part; NaN where not seen.
    line50, line60, low : ndarray, shape (n_trials,)
        Power of the mains lines, N²; ln of the power from 4 to 30 Hz. NaN where not seen.
    """

    size: FloatArray
    phase: FloatArray
    second: FloatArray
    third: FloatArray
    line50: FloatArray
    line60: FloatArray
    low: FloatArray

    @classmethod
    def zeros(cls, n_rows: int, n_trials: int) -> "Compared":
        """Return nothing of everything."""
        row, pair, trial = np.zeros(n_rows), np.zeros((n_rows, 2)), np.zeros(n_trials)
        return cls(row, row, pair, pair, trial, trial, trial)

    def __sub__(self, other: "Compared") -> "Compared":
        """Return the difference; phases within half a turn."""
        parts = {
            field.name: getattr(self, field.name) - getattr(other, field.name)
            for field in fields(self)
        }
        parts["phase"] = np.angle(np.exp(1j * parts["phase"]))
        return Compared(**parts)

    def times(self, rows: FloatArray, trials: FloatArray) -> "Compared":
        """Return it multiplied with a number for each row, and for each trial."""
        return Compared(
            size=self.size * rows,
            phase=self.phase * rows,
            second=self.second * rows[:, np.newaxis],
            third=self.third * rows[:, np.newaxis],
            line50=self.line50 * trials,
            line60=self.line60 * trials,
            low=self.low * trials,
        )

    def __truediv__(self, divisor: float) -> "Compared":
        """Return it by a number."""
        return Compared(
            **{field.name: getattr(self, field.name) / divisor for field in fields(self)}
        )


@dataclass(frozen=True, slots=True)
class Layout:
    """Which rows of a unit make which reading.

    Attributes
    ----------
    trial, cell : ndarray of int, shape (n_rows,)
        Trial of each row, and tone of a trial; both count from 0 within the unit.
    trial_of_cell : ndarray of int, shape (n_cells,)
    tone : ndarray of int, shape (n_cells,)
        Number of its tone in the study.
    seen : ndarray of bool
        Which of all readings exist.
    part : ndarray of int
        Readings of equal part scatter alike.
    n_trials : int
        How many.
    """

    trial: IntArray
    cell: IntArray
    trial_of_cell: IntArray
    tone: IntArray
    seen: BoolArray
    part: IntArray
    n_trials: int


def lay_out(trial: IntArray, tone: IntArray, data: Compared) -> Layout:
    """Return the layout of a unit's data.

    Parameters
    ----------
    trial : ndarray of int, shape (n_rows,)
        Counted from 0 in the unit.
    tone : ndarray of int, shape (n_rows,)
        Number of the tone in the study.
    data : Compared
        Measured; what is NaN is not seen.
    """
    keys, cell = np.unique(np.stack([trial, tone]), axis=1, return_inverse=True)
    cell = np.asarray(cell, dtype=np.int64).ravel()
    n_trials = data.line50.size
    first = Layout(
        trial, cell, keys[0], keys[1], np.ones(0, dtype=np.bool_), keys[0][:0], n_trials
    )
    values = _all(first, data)
    part, useful = _parts(first, n_trials)
    seen = np.isfinite(values) & useful
    return Layout(trial, cell, keys[0], keys[1], seen, part[seen], n_trials)


def reduce(layout: Layout, compared: Compared) -> FloatArray:
    """Return the readings, not whitened, shape (n_readings,).

    Parameters
    ----------
    layout : Layout
        Which rows make which reading.
    compared : Compared
        Measured, predicted or a difference.
    """
    return _all(layout, compared)[layout.seen]


def trials_of(layout: Layout) -> IntArray:
    """Return the trial of each reading, (n_readings,)."""
    trials, cells, rows = np.arange(layout.n_trials), layout.trial_of_cell, layout.trial
    every = [trials, cells, cells, rows, rows, *4 * [cells], *3 * [trials]]
    return np.concatenate(every)[layout.seen]


def accuracy_of(layout: Layout) -> FloatArray:
    """Return how accurate each reading is at best, whatever its scatter, (n_readings,)."""
    n_rows, n_cells, n_trials = layout.cell.size, layout.tone.size, layout.n_trials
    sizes = [n_trials, n_cells, n_cells, n_rows, n_rows, *4 * [n_cells], *3 * [n_trials]]
    best = [*5 * [RESPONSE], *4 * [HARMONICS], LINE_N2, LINE_N2, LOW]
    return np.repeat(best, sizes)[layout.seen]


def noise_of(layout: Layout, variance: FloatArray) -> FloatArray:
    """Return the standard deviation of each reading that noise beside it gives, (n_readings,).

    Parameters
    ----------
    layout : Layout
        Which rows make which reading.
    variance : ndarray, shape (n_rows,)
        Of ln size and of phase of each row. 1 is returned of readings that have none, and of
        those of a whole trial of many tones, which deviates by its contact and not by noise.
    """
    n_cells, n_trials = layout.tone.size, layout.n_trials
    rows = np.where(np.isfinite(variance) & (variance > 0.0), np.sqrt(variance), 1.0)
    count = np.bincount(layout.cell, minlength=n_cells)
    cells = np.sqrt(np.bincount(layout.cell, np.square(rows), minlength=n_cells)) / count
    trials, alone = np.ones(n_trials), _alone(layout)
    trials[layout.trial_of_cell[alone]] = cells[alone]
    parts = [trials, cells, cells, rows, rows, np.ones(4 * n_cells + 3 * n_trials)]
    return np.concatenate(parts)[layout.seen]


def by_kind(layout: Layout) -> Layout:
    """Return a layout whose readings of one kind scatter alike, whatever their tone."""
    return replace(layout, part=layout.part // TONES * TONES)


def _all(layout: Layout, c: Compared) -> FloatArray:
    size_cell = _mean(c.size, layout.cell, layout.tone.size)
    n_trials = c.line50.size
    size_trial = _mean(size_cell, layout.trial_of_cell, n_trials)
    phase_cell = _mean(c.phase, layout.cell, layout.tone.size)
    harmonics = [
        _mean(part[:, k], layout.cell, layout.tone.size)
        for part in (c.second, c.third)
        for k in (0, 1)
    ]
    return np.concatenate(
        [
            size_trial,
            size_cell - size_trial[layout.trial_of_cell],
            phase_cell,
            c.size - size_cell[layout.cell],
            c.phase - phase_cell[layout.cell],
            *harmonics,
            c.line50,
            c.line60,
            c.low,
        ]
    )


TRIAL_SIZE, TONE_SIZE, PHASE, STRETCH_SIZE, STRETCH_PHASE, HARMONIC = range(6)
TONES: Final = 1000
"""More than a study has: tells the parts of one tone from those of another."""


def _parts(layout: Layout, n_trials: int) -> tuple[IntArray, BoolArray]:
    """Return the part of all readings, and whether they say anything."""
    row_tone = layout.tone[layout.cell]
    alone = _alone(layout)
    single = np.bincount(layout.cell)[layout.cell] == 1
    with_rows = np.bincount(layout.trial, minlength=n_trials) > 0
    of_trial = np.full(n_trials, TONES * TRIAL_SIZE)
    only = np.flatnonzero(alone)
    of_trial[layout.trial_of_cell[only]] += 1 + layout.tone[only]
    parts = [
        of_trial,
        TONES * TONE_SIZE + layout.tone,
        TONES * PHASE + layout.tone,
        TONES * STRETCH_SIZE + row_tone,
        TONES * STRETCH_PHASE + row_tone,
        *(TONES * (HARMONIC + 4 * k) + layout.tone for k in range(1, 5)),
        *(np.full(n_trials, TONES * (40 + k)) for k in range(3)),
    ]
    useful = [with_rows, ~alone, None, ~single, ~single, *7 * [None]]
    kept = [
        np.ones(part.size, dtype=np.bool_) if use is None else use
        for part, use in zip(parts, useful, strict=True)
    ]
    return np.concatenate(parts), np.concatenate(kept)


def _alone(layout: Layout) -> BoolArray:
    """Return which cells are a trial's only tone: it says at once what trial and tone say."""
    alone: BoolArray = np.bincount(layout.trial_of_cell)[layout.trial_of_cell] == 1
    return alone


def _mean(values: FloatArray, group: IntArray, n_groups: int) -> FloatArray:
    """Return the mean of what is finite in each group; NaN where nothing is."""
    known = np.isfinite(values)
    if not known.all():
        group, values = group[known], values[known]
    total = np.bincount(group, values, minlength=n_groups)
    count = np.bincount(group, minlength=n_groups)
    with np.errstate(invalid="ignore"):
        mean: FloatArray = total / count
    return mean


def scatters(layouts: Sequence[Layout], residuals: Sequence[FloatArray]) -> list[FloatArray]:
    """Return the standard deviation of each reading, from the median deviation of its part.

    Parameters
    ----------
    layouts : sequence of Layout
        Of all units, which share the scatters.
    residuals : sequence of ndarray
        What the model fitted to each unit leaves.
    """
    part = np.concatenate([layout.part for layout in layouts])
    size = np.abs(np.concatenate(residuals))
    names, index = np.unique(part, return_inverse=True)
    kind = names // TONES
    found = np.empty(names.size)
    for k in range(names.size):
        own = size[index == k]
        if own.size < LEAST_IN_GROUP:
            own = size[np.isin(index, np.flatnonzero(kind == kind[k]))]
        found[k] = np.median(own) / 0.6745
    floor = 1e-3 * np.array([found[kind == each].max(initial=0.0) for each in kind])
    found = np.maximum(np.maximum(found, floor), 1e-12)
    ends = np.cumsum([layout.part.size for layout in layouts])[:-1]
    return np.split(found[index], ends)


def huber(residual: FloatArray, scatter: FloatArray) -> FloatArray:
    """Return the square root of Huber's weights, by which a reading is multiplied.

    Parameters
    ----------
    residual, scatter : ndarray
        Of one shape.
    """
    distance = np.abs(residual) / scatter
    weight: FloatArray = np.sqrt(np.minimum(1.0, LARGE / np.maximum(distance, LARGE)))
    return weight

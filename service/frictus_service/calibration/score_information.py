"""How each trial pulls at the law: score and information, with the gain of a stretch free.

All residuals are relative, as ``ln(z / H)`` to first order. Real parts carry the gain of their
stretch: its weighted mean counts with the certainty that the spread of gains leaves it, and so
again within a trial. Imaginary parts do not know the gain.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, Self

import numpy as np

from frictus_hardware.arrays import ComplexArray, FloatArray, IntArray
from frictus_service.calibration import coordinates
from frictus_service.calibration.coordinates import Prior
from frictus_service.errors import EstimateError
from frictus_service.identification.observation.response import TrialObservations

LEAST_RELATIVE: Final = 1e-4
"""No response is known better than this share of its size."""
_TAIL: Final = 5.0
"""Degrees of freedom of the t distribution whose weights tame outlying stretches."""
_FEW: Final = 10
"""Fewer rows than this do not tell a tone's scatter."""
_CHI_SQUARE_MEDIAN: Final = 0.4549


@dataclass(frozen=True, slots=True)
class GainScatter:
    """Relative standard deviations of the gain, between trials and of stretches within.

    The first values only serve to begin with.
    """

    trial: float = 0.1
    segment: float = 0.1


def usable(observations: Sequence[TrialObservations]) -> list[TrialObservations]:
    """Return the valid trials that have rows.

    Parameters
    ----------
    observations : sequence of TrialObservations
        Of one person or several.
    """
    return [one for one in observations if one.valid and one.rows.tone_hz.size]


def midway(one: TrialObservations) -> TrialObservations:
    """Return a trial in which rows at speeds beyond the law count for less.

    How a finger goes on below 20 and above 100 mm/s is not part of the law: its cutoff may be
    held there, as rendering does, or follow the line. Such rows are taken midway, and known no
    better than these two differ: else a few of them, a little beyond, bend the line between.

    Parameters
    ----------
    one : TrialObservations
        As it was observed: taken midway twice, a row would count for less still.
    """
    rows, typical = one.rows, Prior.weak().mean
    held_mm_s = np.clip(rows.speed_mm_s, coordinates.LOW_MM_S, coordinates.HIGH_MM_S)
    speed_mm_s = 0.5 * (rows.speed_mm_s + held_mm_s)
    straight, held, between = (
        coordinates.response(typical, speed, rows.tone_hz)
        for speed in (rows.speed_mm_s, held_mm_s, speed_mm_s)
    )
    share = 0.5 * np.abs((straight - held) / between)
    unknown = np.square(share * np.abs(rows.friction_response))
    variance = rows.friction_variance + 0.5 * unknown  # of real and imaginary part each
    return replace(one, rows=replace(rows, speed_mm_s=speed_mm_s, friction_variance=variance))


@dataclass(frozen=True, slots=True)
class Data:
    """The rows of all valid trials of one person, in order of their stretches.

    Attributes
    ----------
    speed_mm_s, tone_hz : ndarray, shape (n_rows,)
    response : ndarray of complex, shape (n_rows,)
    variance : ndarray, shape (n_rows,)
        Of real and imaginary part each.
    segment : ndarray of int, shape (n_rows,)
        Number of the stretch (third of a sweep of a trial), from 0, rising.
    trial_of_segment : ndarray of int, shape (n_segments,)
        Number of its trial, from 0, rising.
    condition_of_trial : ndarray of int, shape (n_trials,)
        Number of its target speed and force.
    nominal_hz : ndarray, shape (n_rows,), or None
        Same for rows that are one tone, where `tone_hz` differs a little; None: `tone_hz`.
    typical_mm_s : ndarray, shape (n_rows,), or None
        Speed at which a row speaks of the law's two ends, that of its condition; None:
        `speed_mm_s`. Within a condition speeds differ by little more than they are measured
        to: a slope from there is one towards none, and where responses are known well it
        outweighs that from far speeds (regression dilution).
    """

    speed_mm_s: FloatArray
    tone_hz: FloatArray
    response: ComplexArray
    variance: FloatArray
    segment: IntArray
    trial_of_segment: IntArray
    condition_of_trial: IntArray
    nominal_hz: FloatArray | None = None
    typical_mm_s: FloatArray | None = None

    @classmethod
    def of(cls, observations: Sequence[TrialObservations]) -> Self:
        """Collect the rows of the trials that are `usable`, taken `midway` beyond the law.

        Raises
        ------
        EstimateError
            If there is none, or they are of several people.
        """
        used = [midway(one) for one in usable(observations)]
        people = sorted({item.info.participant for item in used})
        if not used:
            raise EstimateError(f"none of {len(observations)} trials is valid; repeat them")
        if len(people) > 1:
            raise EstimateError(f"trials of several people: {', '.join(people)}; give one's")
        for item in used:
            variance = item.rows.friction_variance
            if not np.all(np.isfinite(item.rows.friction_response)) or not np.all(variance > 0):
                raise EstimateError(
                    f"trial {item.info.id}: a response is not finite or its variance not "
                    "positive; mark the trial invalid"
                )
        trial = np.repeat(np.arange(len(used)), [item.rows.tone_hz.size for item in used])
        key = np.column_stack(
            [
                trial,
                np.concatenate([item.rows.sweep for item in used]),
                np.concatenate([item.rows.third for item in used]),
            ]
        )
        stretches, segment = np.unique(key, axis=0, return_inverse=True)
        order = np.argsort(segment, kind="stable")
        speed_mm_s = np.concatenate([item.rows.speed_mm_s for item in used])
        conditions = _conditions(used)
        condition = conditions[trial]
        mean_mm_s = np.bincount(condition, speed_mm_s) / np.bincount(condition)
        whole = cls(
            speed_mm_s,
            np.concatenate([item.rows.tone_hz for item in used]),
            np.concatenate([item.rows.friction_response for item in used]),
            np.concatenate([item.rows.friction_variance for item in used]),
            segment.ravel(),
            stretches[:, 0],
            conditions,
            typical_mm_s=mean_mm_s[condition],
        )
        return whole._rows(order)

    @property
    def n_segments(self) -> int:
        """Number of stretches."""
        return self.trial_of_segment.size

    @property
    def n_trials(self) -> int:
        """Number of trials."""
        return int(self.trial_of_segment[-1]) + 1

    def _rows(self, order: IntArray) -> Self:
        return replace(
            self,
            speed_mm_s=self.speed_mm_s[order],
            tone_hz=self.tone_hz[order],
            response=self.response[order],
            variance=self.variance[order],
            segment=self.segment[order],
            nominal_hz=None if self.nominal_hz is None else self.nominal_hz[order],
            typical_mm_s=None if self.typical_mm_s is None else self.typical_mm_s[order],
        )


def _conditions(used: Sequence[TrialObservations]) -> IntArray:
    asked = [(item.info.speed_mm_s, item.info.force_n) for item in used]
    number = {condition: place for place, condition in enumerate(sorted(set(asked)))}
    return np.array([number[condition] for condition in asked], dtype=np.int64)


def scores(
    data: Data, at: FloatArray, spread: GainScatter, weights: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return each trial's score and information at a point.

    Parameters
    ----------
    data : Data
        Rows of all trials.
    at : ndarray, shape (4,)
        In `coordinates`.
    spread : GainScatter
        Of gains between trials and stretches.
    weights : ndarray, shape (n_rows,)
        By which the certainty of each row is multiplied.

    Returns
    -------
    score : ndarray, shape (n_trials, 4)
    information : ndarray, shape (n_trials, 4, 4)
    """
    residual, columns, weight = linearised(data, at)
    weight = weight * weights
    trials = data.trial_of_segment[data.segment]
    table = np.column_stack([columns.imag, residual.imag])
    total = _moments(table, weight, trials, data.n_trials)
    real = np.column_stack([columns.real, residual.real])
    within, means, certainty = _centred(real, weight, data.segment, data.n_segments)
    total += _moments(within, weight, trials, data.n_trials)
    weight = 1.0 / (1.0 / certainty + spread.segment**2)
    within, means, certainty = _centred(means, weight, data.trial_of_segment, data.n_trials)
    total += _moments(within, weight, data.trial_of_segment, data.n_trials)
    weight = 1.0 / (1.0 / certainty + spread.trial**2)
    total += weight[:, np.newaxis, np.newaxis] * np.einsum("ti,tj->tij", means, means)
    return total[:, :-1, -1], total[:, :-1, :-1]


def spread_of(data: Data, at: FloatArray) -> tuple[GainScatter, FloatArray]:
    """Return the spread of gains around a law, and weights of the rows from their scatter.

    A tone whose rows scatter within trials more than their variances say weighs less, and so
    does a stretch that lies far from the rest of its trial (weights of a t distribution). How
    far a whole trial lies from the law does not count against it.

    Parameters
    ----------
    data : Data
        Rows of all trials.
    at : ndarray, shape (4,)
    """
    residual, _, weight = linearised(data, at)
    weights = _weights(data, residual, weight)
    real = residual.real[:, np.newaxis]
    _, gains, certainty = _centred(real, weight * weights, data.segment, data.n_segments)
    inner, outer, _ = _centred(
        gains, np.ones(data.n_segments), data.trial_of_segment, data.n_trials
    )
    left = max(data.n_segments - data.n_trials, 1)
    error = float(np.mean(1.0 / certainty))
    segment = max(float(np.sum(inner**2)) / left - error, 0.0)
    count = np.bincount(data.trial_of_segment, minlength=data.n_trials)
    known = float(np.mean((segment + error) / count))
    trial = max(float(np.var(outer, ddof=1)) - known, 0.0) if data.n_trials > 1 else 0.01
    return GainScatter(np.sqrt(trial), np.sqrt(segment)), weights


def start(data: Data, mean: FloatArray) -> FloatArray:
    """Return a point from which Gauss-Newton finds the best law, by trying a grid.

    Parameters
    ----------
    data : Data
        Rows of all trials.
    mean : ndarray, shape (4,)
        The grid scales both its cutoffs alike.
    """
    best, found = np.inf, mean
    for factor in np.linspace(-1.5, 1.5, 13):
        for delay in np.linspace(-100e-6, 400e-6, 21):
            point = np.array([mean[0] + factor, mean[1] + factor, 0.0, delay])
            shape = response(data, point)
            weight = 1.0 / data.variance
            size = np.sum(weight * np.abs(shape) ** 2)
            gain = max(np.sum(weight * (data.response * shape.conj()).real) / size, 1e-6)
            cost = float(np.sum(weight * np.abs(data.response - gain * shape) ** 2))
            if cost < best:
                best, found = cost, np.array([point[0], point[1], np.log(gain), delay])
    return found


def response(data: Data, at: FloatArray) -> ComplexArray:
    """Return the law's response at every row (Equation 4, and the delay), shape (n_rows,)."""
    return coordinates.response(at, data.speed_mm_s, data.tone_hz)


def linearised(data: Data, at: FloatArray) -> tuple[ComplexArray, ComplexArray, FloatArray]:
    """Return relative residuals, d ln H / d coordinates, and certainties of all rows.

    Relative to the law times the gain of the stretch, whose logarithm is in the real part.

    Parameters
    ----------
    data : Data
        Rows of all trials.
    at : ndarray, shape (4,)
        In `coordinates`.
    """
    law = response(data, at)
    ratio = data.response / law
    weight = np.abs(law) ** 2 / data.variance
    total = np.bincount(data.segment, weight)
    gain = np.clip(np.bincount(data.segment, weight * ratio.real) / total, 0.1, 10.0)
    gain = gain[data.segment]
    cutoff = coordinates.cutoff_hz(at, data.speed_mm_s)
    typical_mm_s = data.speed_mm_s if data.typical_mm_s is None else data.typical_mm_s
    columns = coordinates.cutoff_gradient(at, typical_mm_s).astype(np.complex128)
    columns *= (1j * data.tone_hz / (cutoff + 1j * data.tone_hz))[:, np.newaxis]
    columns[:, 2] = 1.0
    columns[:, 3] = -2j * np.pi * data.tone_hz
    certainty = 1.0 / (1.0 / (weight * gain**2) + LEAST_RELATIVE**2)
    return ratio / gain - 1.0 + np.log(gain), columns, certainty


def _centred(
    table: FloatArray, weight: FloatArray, group: IntArray, n_groups: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return rows less their group's weighted mean, the means, and the sums of weights."""
    total = np.bincount(group, weight, n_groups)
    means = np.column_stack(
        [np.bincount(group, weight * column, n_groups) / total for column in table.T]
    )
    return table - means[group], means, np.asarray(total, dtype=np.float64)


def _moments(
    table: FloatArray, weight: FloatArray, group: IntArray, n_groups: int
) -> FloatArray:
    """Return the weighted sum of outer products of rows, by group; groups rise."""
    outer = np.einsum("n,ni,nj->nij", weight, table, table)
    first = np.searchsorted(group, np.arange(n_groups))
    summed: FloatArray = np.add.reduceat(outer, first, axis=0)
    return summed


def _weights(data: Data, residual: ComplexArray, weight: FloatArray) -> FloatArray:
    """Return weights of rows, at most 1, from their scatter within trials."""
    nominal = data.tone_hz if data.nominal_hz is None else data.nominal_hz
    tones, tone = np.unique(nominal, return_inverse=True)
    trial = data.trial_of_segment[data.segment]
    _, replicates = np.unique(trial * tones.size + tone, return_inverse=True)
    count = np.bincount(replicates)[replicates]
    freedom = 1.0 - 1.0 / count
    real = residual.real[:, np.newaxis]
    within, _, _ = _centred(real, weight, data.segment, data.n_segments)
    table = np.column_stack([residual.imag, within[:, 0]])
    inner, _, _ = _centred(table, weight, replicates, int(replicates.max()) + 1)
    square = weight[:, np.newaxis] * inner**2
    weights = np.ones(weight.size)
    for number in range(tones.size):
        rows = (tone == number) & (count > 1)
        if np.count_nonzero(rows) >= _FEW:
            middle = np.median(square[rows, 0] / freedom[rows]) / _CHI_SQUARE_MEDIAN
            weights[tone == number] = 1.0 / max(middle, 1.0)
    expected = np.bincount(data.segment, 2.0 * freedom, data.n_segments)
    scatter = np.bincount(data.segment, weights * square.sum(axis=1), data.n_segments)
    tamed = np.minimum((_TAIL + expected) / (_TAIL + scatter), 1.0)
    return weights * tamed[data.segment]

"""Friction response ``g w0 / (s + w0) exp(-s tau)`` of every condition (paper, Equation 4).

The delay is what the channels add beyond hold and declared skew. Without it 100 µs of delay
bias the cutoff by -32 to -53 %.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from frictus_hardware.arrays import ComplexArray, FloatArray, IntArray
from frictus_service.identification.fit import joint_fit
from frictus_service.identification.fit.conditions import Sample
from frictus_service.identification.fit.joint_fit import JointFit, JointFitProblem, Spreads

GAIN, CUTOFF = 0, 1
"""Columns of the logarithms: gain in N per unit of drive fraction, cutoff in Hz."""
LOWEST: Final = np.log([1e-6, 1.0])
HIGHEST: Final = np.log([50.0, 20_000.0])
_CUTOFFS_HZ: Final = np.geomspace(30.0, 12_000.0, 27)
_DELAYS_S: Final = np.linspace(-150e-6, 500e-6, 27)
_SCATTER: Final = 0.1


@dataclass(frozen=True, slots=True)
class FirstOrder:
    """First-order response, `joint_fit.Law`.

    Attributes
    ----------
    cutoff_ratio : ndarray, shape (n_rows,)
        Cutoff at the row's own speed over that of its condition.
    """

    cutoff_ratio: FloatArray

    def __call__(
        self, log_parameters: FloatArray, tone_hz: FloatArray
    ) -> tuple[ComplexArray, ComplexArray]:
        """Return H and d ln H / d (ln gain, ln cutoff)."""
        cutoff = np.exp(log_parameters[:, CUTOFF]) * self.cutoff_ratio
        below = 1.0 / (1.0 + 1j * (tone_hz / cutoff))
        return (
            np.exp(log_parameters[:, GAIN]) * below,
            np.column_stack([np.ones_like(below), 1.0 - below]),
        )


def fit_friction(
    sample: Sample, n_people: int, cutoff_ratio: FloatArray | None = None
) -> JointFit:
    """Fit gain and cutoff of every condition, and one delay per participant.

    Parameters
    ----------
    sample : Sample
        Rows that are fitted together.
    n_people : int
        How many to draw.
    cutoff_ratio : ndarray, shape (n_rows,), or None
        As in `FirstOrder`. None: 1.

    Returns
    -------
    JointFit
        Logarithms: gain (N per unit of drive fraction), cutoff (Hz).
    """
    ratio = np.ones(sample.tone_hz.size) if cutoff_ratio is None else cutoff_ratio
    problem = JointFitProblem(sample, FirstOrder(ratio), LOWEST, HIGHEST)
    return joint_fit.fit(problem, *_start(sample, n_people))


def refit_friction(
    sample: Sample, begin: FloatArray, delay_s: FloatArray, spreads: Spreads
) -> JointFit:
    """Fit gain and cutoff of parts of conditions, at the delay and with the scatter known.

    Parameters
    ----------
    sample : Sample
        Its conditions are the parts: sweeps, for one.
    begin : ndarray, shape (n_parts, 2)
        Logarithms to begin with.
    delay_s : ndarray, shape (n_people,)
    spreads : Spreads
        Standard deviations that rows of a trial or condition share.
    """
    law = FirstOrder(np.ones(sample.tone_hz.size))
    problem = JointFitProblem(sample, law, LOWEST, HIGHEST, fit_delay=False)
    return joint_fit.fit(problem, begin, delay_s, spreads)


def _start(sample: Sample, n_people: int) -> tuple[FloatArray, FloatArray]:
    """Return the best of a grid: a cutoff per condition, a delay per participant."""
    tone, mean, weight, condition = averages(sample)
    n = sample.people.size
    shapes = 1.0 / (1.0 + 1j * np.divide.outer(tone, _CUTOFFS_HZ))
    power = np.square(np.abs(shapes))

    def total(values: FloatArray) -> FloatArray:
        return np.column_stack(
            [np.bincount(condition, weight * column, n) for column in values.T]
        )

    size = total(power)
    best = np.full(n_people, np.inf)
    logs, delays = np.zeros((n, 2)), np.zeros(n_people)
    for delay in _DELAYS_S:
        undone = mean * np.exp(2j * np.pi * tone * delay)
        along = total((undone[:, np.newaxis] * shapes.conj()).real)
        gain = np.maximum(along / size, np.exp(LOWEST[GAIN]))
        cost = gain**2 * size - 2.0 * gain * along
        at = np.argmin(cost, axis=1)
        cost_of_person = np.bincount(sample.people, cost[np.arange(n), at], n_people)
        better = cost_of_person < best
        best = np.where(better, cost_of_person, best)
        delays[better] = delay
        found = np.log(np.column_stack([gain[np.arange(n), at], _CUTOFFS_HZ[at]]))
        logs = np.where(better[sample.people][:, np.newaxis], found, logs)
    return logs, delays


def averages(sample: Sample) -> tuple[FloatArray, ComplexArray, FloatArray, IntArray]:
    """Return tone, mean response, weight and condition for each tone of each condition."""
    tones, tone = np.unique(sample.tone_hz, return_inverse=True)
    key, group = np.unique(sample.condition * tones.size + tone, return_inverse=True)
    certainty = 1.0 / sample.variance
    total = np.bincount(group, certainty)
    mean = np.bincount(group, certainty * sample.response.real).astype(np.complex128)
    mean += 1j * np.bincount(group, certainty * sample.response.imag)
    mean /= total
    weight = 1.0 / (1.0 / total + np.square(_SCATTER * np.abs(mean)))
    return tones[key % tones.size], mean, weight, key // tones.size

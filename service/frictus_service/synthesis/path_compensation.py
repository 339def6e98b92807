"""Undoes parallel paths of the drive, and tells what that demands of it.

What comes along them is not played once more. A path makes ``y = x + d B[x]`` of a drive x; so
``x = y - d B[x]``, in which all of B[x] is known but what it has of the present x. Where that
is stable: `can_be_undone`.
"""

from collections.abc import Sequence
from typing import Final

import numpy as np
from numba import njit

from frictus_hardware.arrays import ComplexArray, FloatArray
from frictus_hardware.physics import linear
from frictus_hardware.physics.linear import TransferFunction
from frictus_hardware.physics.paths import Branch, DelayLine, ParallelPath
from frictus_hardware.physics.schedule import SlidingConditions

LEAST_FACTOR: Final = 0.1
"""Real part of what a path multiplies with, below which it is not undone."""
FREQUENCIES_HZ: Final = np.append(0.0, np.geomspace(1.0, 10_000.0, 241))
"""The first is at rest."""
ENDLESS_HZ: Final = 1e9
"""Beyond all poles: here a filter passes what it passes at once."""


def _frequencies_hz(branch: Branch) -> FloatArray:
    """Return where a branch is looked at: a narrow resonance lies between any others."""
    if isinstance(branch, TransferFunction):
        natural = np.abs(np.roots(branch.denominator)) / (2.0 * np.pi)
        return np.concatenate([FREQUENCIES_HZ, natural])
    return FREQUENCIES_HZ


def _factors(
    path: ParallelPath, frequency_hz: FloatArray, everywhere: SlidingConditions
) -> ComplexArray:
    """Return what a path multiplies with, shape (2, n): at its least and its largest dose."""
    dose = path.dose.at(everywhere)
    ends = np.array([[float(dose.min())], [float(dose.max())]])
    factors: ComplexArray = 1.0 + ends * path.branch.frequency_response(frequency_hz)
    return factors


def can_be_undone(path: ParallelPath, everywhere: SlidingConditions) -> bool:
    """Return whether a path has a stable inverse at every dose, with some margin.

    It has where what it multiplies with keeps to the right half plane at every frequency. So
    it does in samples: a first-order hold takes means of the response over its aliases. An echo
    passes every phase somewhere, so that less of it must come back than was sent.

    Parameters
    ----------
    path : ParallelPath
        Of the drive.
    everywhere : SlidingConditions
        A grid over all circumstances.
    """
    if isinstance(path.branch, DelayLine):
        largest = float(np.abs(path.dose.at(everywhere)).max())
        return largest <= 1.0 - LEAST_FACTOR
    frequency_hz = np.append(_frequencies_hz(path.branch), ENDLESS_HZ)
    factors = _factors(path, frequency_hz, everywhere)
    return bool(np.all(factors.real >= LEAST_FACTOR))


def demand_of(
    paths: Sequence[ParallelPath], everywhere: SlidingConditions
) -> tuple[float, float]:
    """Return by what a bias is weakened at most, and how much further drives swing about it.

    Parameters
    ----------
    paths : sequence of ParallelPath
        That are undone.
    everywhere : SlidingConditions
        A grid over all circumstances.

    Returns
    -------
    tuple of float
        The first is 1 at most, the second 1 at least.
    """
    weakest, swing = 1.0, 1.0
    for path in paths:
        size = np.abs(_factors(path, _frequencies_hz(path.branch), everywhere))
        weakest *= min(float(size[:, 0].min()), 1.0)
        swing *= max(float(size[:, 0].max() / size.min()), 1.0)
    return weakest, swing


ORDER: Final = 2
"""Of a branch's filters, at most."""


@njit(cache=True, nogil=True)
def undo_filters(weights, numerators, denominators, dose, bias, memory, drive):  # type: ignore[no-untyped-def]
    """Undo a weighted sum of filters that pass nothing at rest, in place.

    Parameters
    ----------
    weights : ndarray, shape (n_filters,)
    numerators, denominators : ndarray, shape (n_filters, ORDER + 1)
        Polynomials in 1/z.
    dose, bias : tuple of float
        At the first sample and at the one after the last; linear in between.
    memory : ndarray, shape (n_filters, ORDER)
    drive : ndarray, shape (n_samples,)
    """
    direct = 0.0
    for k in range(weights.size):
        direct += weights[k] * numerators[k, 0]
    for n in range(drive.size):
        share = n / drive.size
        d = dose[0] + share * (dose[1] - dose[0])
        at_rest = bias[0] + share * (bias[1] - bias[0])
        before = 0.0
        for k in range(weights.size):
            before += weights[k] * memory[k, 0]
        x = (drive[n] - at_rest - d * before) / (1.0 + d * direct)
        drive[n] = x + at_rest
        for k in range(weights.size):
            out = numerators[k, 0] * x + memory[k, 0]
            memory[k, 0] = numerators[k, 1] * x - denominators[k, 1] * out + memory[k, 1]
            memory[k, 1] = numerators[k, 2] * x - denominators[k, 2] * out


@njit(cache=True, nogil=True)
def undo_delay(delay, dose, bias, place, line, drive):  # type: ignore[no-untyped-def]
    """Undo an echo, in place; return where the line goes on.

    Parameters
    ----------
    delay : float
        In samples.
    dose, bias : tuple of float
        At the first sample and at the one after the last; linear in between.
    place : int
        Of the present sample in the line.
    line : ndarray, shape (whole delay + 2,)
        Drives about their bias, as they were played.
    drive : ndarray, shape (n_samples,)
    """
    whole = int(delay)
    part = delay - whole
    size = line.size
    for n in range(drive.size):
        share = n / drive.size
        d = dose[0] + share * (dose[1] - dose[0])
        at_rest = bias[0] + share * (bias[1] - bias[0])
        echo = part * line[(place - whole - 1) % size]
        direct = 0.0
        if whole > 0:
            echo += (1.0 - part) * line[(place - whole) % size]
        else:
            direct = 1.0 - part
        x = (drive[n] - at_rest - d * echo) / (1.0 + d * direct)
        line[place] = x
        place = (place + 1) % size
        drive[n] = x + at_rest / (1.0 + d)
    return place


class PathInverse:
    """Undoes one path.

    Parameters
    ----------
    path : ParallelPath
        Of the drive.
    sample_rate_hz : float
        Samples per second of the device's clock.
    """

    def __init__(self, path: ParallelPath, sample_rate_hz: float) -> None:
        self.path = path
        self._delay = 0.0
        self._place = 0
        if isinstance(path.branch, DelayLine):
            self._delay = path.branch.delay_s * sample_rate_hz
            self._memory = np.zeros(int(self._delay) + 2)
            return
        parts = _parts(path.branch)
        self._weights = np.array([weight for weight, _ in parts])
        self._filters = np.zeros((2, len(parts), ORDER + 1))
        for place, (_, part) in enumerate(parts):
            sampled = linear.sample(part, sample_rate_hz)
            self._filters[0, place, : sampled.numerator.size] = sampled.numerator
            self._filters[1, place, : sampled.denominator.size] = sampled.denominator
        self._memory = np.zeros((len(parts), ORDER))

    def settle(self) -> None:
        """Forget what was played."""
        self._memory[:] = 0.0

    @property
    def finite(self) -> bool:
        """Whether what it remembers is."""
        return bool(np.isfinite(self._memory.sum()))

    def undo(
        self, dose: tuple[float, float], bias: tuple[float, float], drive: FloatArray
    ) -> tuple[float, float]:
        """Undo the path in a drive, in place; return the bias that is left of it.

        Parameters
        ----------
        dose, bias : tuple of float
            At the first sample and at the one after the last.
        drive : ndarray, shape (n_samples,)
        """
        if self._delay:
            self._place = undo_delay(self._delay, dose, bias, self._place, self._memory, drive)
            return bias[0] / (1.0 + dose[0]), bias[1] / (1.0 + dose[1])
        numerators, denominators = self._filters
        undo_filters(self._weights, numerators, denominators, dose, bias, self._memory, drive)
        return bias


def _parts(branch: Branch) -> tuple[tuple[float, TransferFunction], ...]:
    """Return the weighted filters of a branch that is no delay."""
    if isinstance(branch, TransferFunction):
        return ((1.0, branch),)
    assert not isinstance(branch, DelayLine)
    return branch.parts

"""What undoing parallel paths of the drive demands of it, and where it can be done at all."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from frictus_hardware.arrays import ComplexArray, FloatArray
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

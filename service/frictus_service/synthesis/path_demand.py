"""What undoing parallel paths of the drive demands of it, and where it can be done at all."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from frictus_hardware.arrays import ComplexArray
from frictus_hardware.physics.paths import ParallelPath
from frictus_hardware.physics.schedule import SlidingConditions

LEAST_FACTOR: Final = 0.1
"""Real part of what a path multiplies with, below which it is not undone."""
FREQUENCIES_HZ: Final = np.append(0.0, np.geomspace(1.0, 10_000.0, 241))
"""The first is at rest."""


def factors_of(path: ParallelPath, everywhere: SlidingConditions) -> ComplexArray:
    """Return what a path multiplies with, at its least and its largest dose.

    Parameters
    ----------
    path : ParallelPath
        Of the drive.
    everywhere : SlidingConditions
        A grid over all circumstances.

    Returns
    -------
    ndarray of complex, shape (2, n_frequencies)
        At `FREQUENCIES_HZ`.
    """
    dose = path.dose.at(everywhere)
    ends = np.array([[float(dose.min())], [float(dose.max())]])
    factors: ComplexArray = 1.0 + ends * path.branch.frequency_response(FREQUENCIES_HZ)
    return factors


def can_be_undone(path: ParallelPath, everywhere: SlidingConditions) -> bool:
    """Return whether a path has a stable inverse at every dose, with some margin.

    It has where what it multiplies with keeps to the right half plane.

    Parameters
    ----------
    path : ParallelPath
        Of the drive.
    everywhere : SlidingConditions
        A grid over all circumstances.
    """
    return bool(np.all(factors_of(path, everywhere).real >= LEAST_FACTOR))


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
        size = np.abs(factors_of(path, everywhere))
        weakest *= min(float(size[:, 0].min()), 1.0)
        swing *= max(float(size[:, 0].max() / size.min()), 1.0)
    return weakest, swing

"""Which windows of a batch lie in one stroke: a finger differs a little in each."""

from dataclasses import dataclass
from typing import Final, Self

import numpy as np

from frictus_hardware.arrays import BoolArray, IntArray
from frictus_hardware.physics.schedule import SlidingConditions

TURNED_S: Final = 0.25
"""Windows further apart are of two strokes: between them the finger may have turned twice."""


@dataclass(frozen=True, slots=True)
class Strokes:
    """Parts of a batch that lie in one stroke each, in order.

    Attributes
    ----------
    part : ndarray of int, shape (n_windows,)
        Number of each window's part, rising from 0.
    begins : ndarray of bool, shape (n_parts,)
        Whether the part begins a stroke; the first may go on with that of the batch before.
    """

    part: IntArray
    begins: BoolArray

    @classmethod
    def of(cls, around: SlidingConditions, direction: float, minutes: float) -> Self:
        """Divide the windows of a batch.

        Parameters
        ----------
        around : SlidingConditions
            Of each window.
        direction : float
            Of the window before; 0: the finger was not there.
        minutes : float
            Of the window before.
        """
        turned = np.diff(around.direction, prepend=direction) != 0.0
        later_s = 60.0 * np.abs(np.diff(around.minutes, prepend=minutes))
        new = turned | (later_s > TURNED_S)
        part = np.cumsum(new) - int(new[0])
        return cls(part, np.append(new[0], np.ones(int(part[-1]), dtype=bool)))

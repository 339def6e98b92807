"""What finger and force sensor did while an interval was felt, in a few numbers."""

import math
from dataclasses import dataclass
from typing import Final, Self

import numpy as np

from frictus.block import Block
from frictus.gaps import Gap
from frictus.messages import FingerState

STILL_MM: Final = 0.5
"""As far as touch reports of a finger at rest differ."""


@dataclass(frozen=True, slots=True)
class FingerPath:
    """How the finger moved while an interval was felt.

    Attributes
    ----------
    states : int
        Finger states received.
    contact : float
        Share of them in contact.
    path_mm : float
        Length of the way in contact.
    speed_mm_s, speed_max_mm_s : float
        Mean and maximum in contact.
    x_mm, y_mm : tuple of float
        Least and greatest, in contact.
    normal_force_n : float
        Mean in contact.
    stale, extrapolated : float
        Shares of states from an old touch report, and at speeds beyond the model's.
    """

    states: int
    contact: float
    path_mm: float
    speed_mm_s: float
    speed_max_mm_s: float
    x_mm: tuple[float, float]
    y_mm: tuple[float, float]
    normal_force_n: float
    stale: float
    extrapolated: float

    @property
    def still(self) -> bool:
        """Whether it kept to one place: of a texture nothing is felt there."""
        return max(self.x_mm[1] - self.x_mm[0], self.y_mm[1] - self.y_mm[0]) < STILL_MM

    @classmethod
    def of(cls, states: list[FingerState]) -> Self | None:
        """Return the summary of states in their order; None where none is in contact.

        Parameters
        ----------
        states : list of FingerState
            Of an interval.
        """
        touching = [state for state in states if state.in_contact]
        if not touching:
            return None
        contact = np.array([state.in_contact for state in states])
        xy = np.array([(state.x_mm, state.y_mm) for state in states])
        step_mm = np.hypot(*np.diff(xy, axis=0).T)
        speed = np.array([math.hypot(state.vx_mm_s, state.vy_mm_s) for state in touching])
        low, high = np.min(xy[contact], axis=0), np.max(xy[contact], axis=0)
        return cls(
            len(states),
            float(np.mean(contact)),
            float(np.sum(step_mm[contact[1:] & contact[:-1]])),
            float(np.mean(speed)),
            float(np.max(speed)),
            (float(low[0]), float(high[0])),
            (float(low[1]), float(high[1])),
            float(np.mean([state.normal_force_n for state in touching])),
            float(np.mean([state.stale for state in states])),
            float(np.mean([state.extrapolated for state in states])),
        )


@dataclass(frozen=True, slots=True)
class SensedForce:
    """What the force sensor measured while an interval was felt.

    Attributes
    ----------
    samples : int
        Samples of the stream `force` received.
    lost_blocks : int
        Blocks missing among them.
    normal_n, lateral_n, lateral_rms_n : float
        Means of normal and lateral force, and standard deviation of the lateral one along the
        axis where it is greater; as measured, mount included.
    """

    samples: int
    lost_blocks: int
    normal_n: float
    lateral_n: float
    lateral_rms_n: float

    @classmethod
    def of(cls, items: list[Block | Gap]) -> Self | None:
        """Return the summary of blocks of the stream `force`; None where there is none.

        Parameters
        ----------
        items : list of Block or Gap
            Of an interval.
        """
        blocks = [item for item in items if isinstance(item, Block) and len(item.data) >= 3]
        if not blocks:
            return None
        # Anybody may have published some of them, of whatever further channels.
        force = np.concatenate([block.data[:3] for block in blocks], axis=1).astype(np.float64)
        if not np.all(np.isfinite(force)):
            return None
        deviation = np.std(force[:2], axis=1)
        axis = int(np.argmax(deviation))
        return cls(
            force.shape[1],
            sum(item.missing_blocks for item in items if isinstance(item, Gap)),
            float(np.mean(force[2])),
            float(np.mean(force[axis])),
            float(deviation[axis]),
        )

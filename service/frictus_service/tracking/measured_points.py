"""The response as it was measured in the last ten seconds of sliding, by speed and band.

H1 and its interval (Bendat and Piersol, Random Data, chapters 6 and 9), from sums that forget.
"""

from dataclasses import dataclass
from typing import Final, Self

import numpy as np

from frictus.messages import ResponsePoint
from frictus_hardware.arrays import ComplexArray, FloatArray
from frictus_service.tracking.estimation.batch import Batch

GROUPS_MM_S: Final = (10.0, 35.0, 70.0, 150.0)
"""Limits of the groups of speed."""
REMEMBERED: Final = 20.0
"""Batches over which is averaged: 10 s of sliding."""
FEWEST: Final = 4.0
"""Windows of a group, below which it is not shown."""
SHOWN: Final = 1e-2
"""Share of the strongest band's power density below which a band is not shown."""
MOST_N: Final = 1e4
"""A larger response is no finger's, whatever a sensor sent, and no message holds it."""
WIDEST_DB: Final = 6.0
"""Half width beyond which a point is not shown."""


@dataclass(frozen=True, slots=True)
class MeasuredPoints:
    """Sums over the windows of each group; arrays of shape (n_groups, n_bands).

    Attributes
    ----------
    cross : ndarray of complex
        Conjugate of the drive times friction, N.
    drive_power, friction_power : ndarray
        Of the drive fraction, and of the friction in N².
    count, speed_sum : ndarray, shape (n_groups,)
        Windows, and their speeds in mm/s added up.
    """

    cross: ComplexArray
    drive_power: FloatArray
    friction_power: FloatArray
    count: FloatArray
    speed_sum: FloatArray

    @classmethod
    def begin(cls, n_bands: int) -> Self:
        """Return the sums before a first window.

        Parameters
        ----------
        n_bands : int
            Of the windows.
        """
        n_groups = len(GROUPS_MM_S) - 1
        nothing, none = np.zeros((n_groups, n_bands)), np.zeros(n_groups)
        return cls(nothing.astype(np.complex128), nothing, nothing, none, none)

    def seen(self, batch: Batch) -> Self:
        """Return the sums after one more batch.

        Parameters
        ----------
        batch : Batch
            Of windows.
        """
        keep = 1.0 - 1.0 / REMEMBERED
        group = np.digitize(batch.speed_mm_s, GROUPS_MM_S[1:-1])
        inside = (group == np.arange(len(GROUPS_MM_S) - 1)[:, np.newaxis]).astype(float)
        return type(self)(
            keep * self.cross + inside @ batch.cross,
            keep * self.drive_power + inside @ batch.drive_power,
            keep * self.friction_power + inside @ batch.friction_power,
            keep * self.count + inside.sum(axis=1),
            keep * self.speed_sum + inside @ batch.speed_mm_s,
        )

    def points(self, centre_hz: FloatArray, lines: FloatArray) -> tuple[ResponsePoint, ...]:
        """Return the response in each group and band that was driven.

        Parameters
        ----------
        centre_hz, lines : ndarray, shape (n_bands,)
            Mean frequency of each band, and how many frequencies it has.
        """
        found = []
        for group in np.flatnonzero(self.count >= FEWEST):
            power, count = self.drive_power[group], float(self.count[group])
            density = power / lines
            shown = density > SHOWN * density.max()
            response = self.cross[group] / np.where(shown, power, 1.0)
            left = self.friction_power[group] / np.where(shown, power, 1.0)
            left = np.maximum(left - np.square(np.abs(response)), 0.0)
            # Half overlapping Hann windows count half, and one frequency as 1.9.
            sd = np.sqrt(left / (count * (lines + 0.9)))
            size = np.maximum(np.abs(response), 1e-12)
            half = 1.96 * 20.0 / np.log(10.0) * sd / size
            speed = float(self.speed_sum[group]) / count
            found += [
                ResponsePoint(
                    speed_mm_s=speed,
                    centre_hz=float(centre_hz[band]),
                    gain_n=float(size[band]),
                    half_width_db=float(half[band]),
                    phase_deg=float(np.degrees(np.angle(response[band]))),
                )
                for band in np.flatnonzero(shown & (half < WIDEST_DB) & (size <= MOST_N))
            ]
        return tuple(found)

"""Guided taps that tell whether a configured rotation fits how a sensor is mounted.

Someone taps towards +x, +y and +z of the rig, one after another. The first swing of each tap
points along its axis; of the three directions the rotation follows.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from frictus_hardware.arrays import FloatArray
from frictus_hardware.errors import SensorError
from frictus_hardware.sensors.rotation import AXES, angle_deg, nearest_rotation

SWING_SHARE: Final = 0.3
"""Of the peak; what exceeds it is the tap."""
PEAK_OVER_NOISE: Final = 10.0
ALONG_A_LINE: Final = 0.7
"""Share of the power of a tap that must lie along one line."""
LEAST_VOLUME: Final = 0.5
"""Of the three directions; 1 where they are at right angles."""


@dataclass(frozen=True, slots=True, eq=False)
class Orientation:
    """What three taps say of a rotation.

    Attributes
    ----------
    fits : bool
        Whether every tap, rotated as configured, lies along its axis within the limit.
    rotation : ndarray, shape (3, 3)
        What fits the taps best. Where they are mirrored, no rotation fits well.
    off_deg : float
        Angle between the configured rotation and that.
    tap_off_deg : tuple of float
        Angle of each tap, rotated as configured, from its axis.
    mirrored : bool
        The taps form a left-handed frame: a channel has the wrong sign, two are swapped, or
        one tap went the other way.
    """

    fits: bool
    rotation: FloatArray
    off_deg: float
    tap_off_deg: tuple[float, float, float]
    mirrored: bool

    def text(self) -> str:
        """Return a sentence for whoever tapped."""
        taps = ", ".join(
            f"{axis} {off:.0f}°" for axis, off in zip(AXES, self.tap_off_deg, strict=True)
        )
        if self.fits:
            return f"the rotation fits; the taps are off by {taps}"
        if self.mirrored:
            return (
                f"no rotation fits: the taps are off by {taps} and form a left-handed frame. "
                "Tap again towards +x, +y, +z; if it stays so, a channel has the wrong sign or "
                "two are swapped"
            )
        rows = "; ".join(" ".join(f"{value:.4f}" for value in row) for row in self.rotation)
        return (
            f"the rotation does not fit: the taps are off by {taps}. If they went towards +x, "
            f"+y, +z, it is [{rows}], {self.off_deg:.0f}° away"
        )


def check_orientation(
    taps: Sequence[FloatArray], configured: FloatArray, limit_deg: float = 20.0
) -> Orientation:
    """Say whether a rotation fits three taps, and which one would.

    Parameters
    ----------
    taps : sequence of three ndarray, shape (n_samples, 3)
        Signals in the frame of the sensor while the rig was tapped towards +x, +y and +z.
    configured : ndarray, shape (3, 3)
        From the frame of the sensor to the rig's.
    limit_deg : float
        How far a tap by hand may be off its axis.

    Raises
    ------
    SensorError
        If a signal has no tap, or the taps are not along three different lines.
    """
    if len(taps) != len(AXES):
        raise SensorError(f"three taps are needed, along x, y and z; {len(taps)} were given")
    directions = np.array(
        [
            tap_direction(tap, f"the tap along {axis}")
            for tap, axis in zip(taps, AXES, strict=True)
        ]
    )
    volume = float(np.linalg.det(directions))
    if not abs(volume) >= LEAST_VOLUME:
        raise SensorError(
            f"the taps are not along three different lines (their directions span "
            f"{abs(volume):.2f}, at least {LEAST_VOLUME:g} is accepted); tap again"
        )
    best = nearest_rotation(directions.T).T
    along = np.clip(np.diag(configured @ directions.T), -1.0, 1.0)
    off = np.rad2deg(np.arccos(along))
    return Orientation(
        fits=bool(np.all(off <= limit_deg)),
        rotation=best,
        off_deg=angle_deg(configured @ best.T),
        tap_off_deg=(float(off[0]), float(off[1]), float(off[2])),
        mirrored=volume < 0.0,
    )


def tap_direction(signal: FloatArray, what: str = "the tap") -> FloatArray:
    """Return the direction of the first swing of a tap.

    Parameters
    ----------
    signal : ndarray, shape (n_samples, 3)
        At rest for more than half of the time; the rest is taken off.
    what : str
        For the message.

    Returns
    -------
    direction : ndarray, shape (3,)
        Of length 1.

    Raises
    ------
    SensorError
        If nothing stands out of the noise, or it is not along one line.
    """
    if not np.all(np.isfinite(signal)):
        raise SensorError(f"{what} has samples that are not finite; check the sensor")
    swing = signal - np.median(signal, axis=0)
    size = np.linalg.norm(swing, axis=1)
    peak = size.max(initial=0.0)
    if not peak > PEAK_OVER_NOISE * np.median(size):
        raise SensorError(
            f"{what} does not stand out: its peak must be {PEAK_OVER_NOISE:g} times the noise; "
            "tap once, harder, and let go"
        )
    strong = swing[size >= SWING_SHARE * peak]
    _, singular, lines = np.linalg.svd(strong, full_matrices=False)
    if not singular[0] ** 2 >= ALONG_A_LINE * np.sum(singular**2):
        raise SensorError(f"{what} swings along no single line; tap straight along the axis")
    direction: FloatArray = lines[0] * np.sign(lines[0] @ strong[0])
    return direction

"""Rotations from the frame of a sensor to the rig's, and guided taps that check them.

Guided taps that tell whether a configured rotation fits how a sensor is mounted.

Someone taps towards +x, +y and +z of the rig, one after another. The first swing of each tap
points along its axis; of the three directions the rotation follows.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import ArrayLike

from frictus_hardware.arrays import FloatArray
from frictus_hardware.errors import ConfigError, SensorError

Axis = Literal["x", "y", "z"]

AXES: Final[tuple[Axis, ...]] = ("x", "y", "z")
ORTHONORMAL_WITHIN: Final = 1e-3
"""What a matrix written with three decimals is off by; what is accepted is made exact."""


def rotation_about(axis: Axis, angle_deg: float) -> FloatArray:
    """Return the right-handed rotation about one axis.

    Parameters
    ----------
    axis : {"x", "y", "z"}
    angle_deg : float

    Returns
    -------
    rotation : ndarray, shape (3, 3)
        ``rotation @ vector`` is the vector turned.

    Raises
    ------
    ConfigError
        If there is no such axis or the angle is not finite.
    """
    if axis not in AXES:
        raise ConfigError(f"a rotation is about x, y or z, not about {axis!r}")
    if not np.isfinite(angle_deg):
        raise ConfigError(f"a rotation about {axis} by {angle_deg} degrees is not finite")
    angle = np.deg2rad(angle_deg)
    index = AXES.index(axis)
    following, last = (index + 1) % 3, (index + 2) % 3
    rotation = np.eye(3)
    rotation[following, following] = rotation[last, last] = np.cos(angle)
    rotation[last, following] = np.sin(angle)
    rotation[following, last] = -np.sin(angle)
    return rotation


def in_turn(turns: Sequence[tuple[Axis, float]]) -> FloatArray:
    """Return several rotations done one after another, about the fixed axes of the rig.

    Parameters
    ----------
    turns : sequence of (axis, angle_deg)
        The first is done first; none is no rotation. The rig of the paper:
        ``[("x", 155.0), ("y", 180.0)]``.

    Returns
    -------
    rotation : ndarray, shape (3, 3)

    Raises
    ------
    ConfigError
        As `rotation_about`.
    """
    rotation = np.eye(3)
    for axis, angle_deg in turns:
        rotation = rotation_about(axis, angle_deg) @ rotation
    return rotation


def checked_rotation(matrix: ArrayLike) -> FloatArray:
    """Return the rotation nearest to a matrix that is one up to rounding.

    Parameters
    ----------
    matrix : array_like, shape (3, 3)

    Returns
    -------
    rotation : ndarray, shape (3, 3)
        Orthonormal to machine precision.

    Raises
    ------
    ConfigError
        If its columns are not orthonormal within 0.001, or if it mirrors.
    """
    given = np.asarray(matrix, dtype=np.float64)
    if given.shape != (3, 3):
        raise ConfigError(f"a rotation has shape (3, 3), not {given.shape}")
    off = np.abs(given.T @ given - np.eye(3)).max()
    if not off <= ORTHONORMAL_WITHIN:
        raise ConfigError(
            f"the matrix is no rotation: its columns are off orthonormal by {off:.3g}; "
            f"at most {ORTHONORMAL_WITHIN:g} is accepted, so give at least four decimals"
        )
    if np.linalg.det(given) < 0.0:
        raise ConfigError(
            "the matrix mirrors (its determinant is -1); change the sign of one channel instead"
        )
    return nearest_rotation(given)


def nearest_rotation(matrix: FloatArray) -> FloatArray:
    """Return the rotation nearest to a matrix in the least-squares sense.

    Parameters
    ----------
    matrix : ndarray, shape (3, 3)
        Of full rank.

    Returns
    -------
    rotation : ndarray, shape (3, 3)
        Source: Kabsch, Acta Crystallographica A 32 (1976) 922.
    """
    left, _, right = np.linalg.svd(matrix)
    flip = np.diag([1.0, 1.0, np.sign(np.linalg.det(left @ right))])
    rotation: FloatArray = left @ flip @ right
    return rotation


def angle_deg(rotation: FloatArray) -> float:
    """Return by how much a rotation turns, 0 to 180 degrees.

    Parameters
    ----------
    rotation : ndarray, shape (3, 3)
    """
    # From sine and cosine: the cosine alone loses half the digits of a small angle.
    sine = np.linalg.norm(rotation - rotation.T) / np.sqrt(8.0)
    cosine = (np.trace(rotation) - 1.0) / 2.0
    return float(np.rad2deg(np.arctan2(sine, cosine)))


def rotated(vectors: FloatArray, rotation: FloatArray) -> FloatArray:
    """Return vectors of a sensor in the frame of the rig.

    Parameters
    ----------
    vectors : ndarray, shape (n_samples, 3)
    rotation : ndarray, shape (3, 3)

    Returns
    -------
    vectors : ndarray, shape (n_samples, 3)
    """
    turned: FloatArray = vectors @ rotation.T
    return turned


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

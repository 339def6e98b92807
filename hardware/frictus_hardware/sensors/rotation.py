"""Rotations from the frame of a sensor to the frame of the rig."""

from collections.abc import Sequence
from typing import Final, Literal

import numpy as np
from numpy.typing import ArrayLike

from frictus_hardware.arrays import FloatArray
from frictus_hardware.errors import ConfigError

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

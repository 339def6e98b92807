"""A person's law in the coordinates in which people are nearly normal.

``(ln cutoff at 20 mm/s, ln cutoff at 100 mm/s, ln gain, delay in s)``: the ends of the range
that the paper measured. Between them the cutoff is a straight line over speed (Equation 9), so
positive ends mean a positive cutoff everywhere.
"""

from typing import Final

import numpy as np

from frictus_hardware.arrays import FloatArray

LOW_MM_S: Final = 20.0
HIGH_MM_S: Final = 100.0
SIZE: Final = 4
MODEL_PARAMETERS: Final = ("gain_n", "cutoff_0_hz", "slope_hz_per_mm_s", "skew_s")
"""Order of the covariance of a model, with the delay last."""


def cutoff_hz(coordinates: FloatArray, speed_mm_s: FloatArray) -> FloatArray:
    """Return the cutoff at each speed, Hz; at least a tenth of the lower of its ends.

    Parameters
    ----------
    coordinates : ndarray, shape (4,)
    speed_mm_s : ndarray, shape (n,)
        Without sign. A little outside 20 to 100 mm/s the line goes on.
    """
    low, high = np.exp(coordinates[:2])
    share = (speed_mm_s - LOW_MM_S) / (HIGH_MM_S - LOW_MM_S)
    line: FloatArray = np.maximum(low + (high - low) * share, 0.1 * min(low, high))
    return line


def cutoff_gradient(coordinates: FloatArray, speed_mm_s: FloatArray) -> FloatArray:
    """Return d ln cutoff / d coordinates.

    Parameters
    ----------
    coordinates : ndarray, shape (4,)
    speed_mm_s : ndarray, shape (n,)

    Returns
    -------
    ndarray, shape (n, 4)
    """
    share = (speed_mm_s - LOW_MM_S) / (HIGH_MM_S - LOW_MM_S)
    cutoff = cutoff_hz(coordinates, speed_mm_s)
    low, high = np.exp(coordinates[:2])
    gradient = np.zeros((speed_mm_s.size, SIZE))
    gradient[:, 0] = (1.0 - share) * low / cutoff
    gradient[:, 1] = share * high / cutoff
    return gradient


def from_law(
    gain_n: float, cutoff_0_hz: float, slope_hz_per_mm_s: float, skew_s: float
) -> FloatArray:
    """Return the coordinates of a law whose cutoff is positive from 20 to 100 mm/s."""
    ends = cutoff_0_hz + slope_hz_per_mm_s * np.array([LOW_MM_S, HIGH_MM_S])
    return np.array([*np.log(ends), np.log(gain_n), skew_s])


def to_law(coordinates: FloatArray) -> tuple[float, float, float, float]:
    """Return gain (N), cutoff at rest (Hz), slope (Hz per mm/s) and delay (s)."""
    low, high = np.exp(coordinates[:2])
    slope = (high - low) / (HIGH_MM_S - LOW_MM_S)
    return (
        float(np.exp(coordinates[2])),
        float(low - slope * LOW_MM_S),
        float(slope),
        float(coordinates[3]),
    )


def law_jacobian(coordinates: FloatArray) -> FloatArray:
    """Return d `MODEL_PARAMETERS` / d coordinates, shape (4, 4)."""
    low, high = np.exp(coordinates[:2])
    span = HIGH_MM_S - LOW_MM_S
    jacobian = np.zeros((SIZE, SIZE))
    jacobian[0, 2] = np.exp(coordinates[2])
    jacobian[1, :2] = low * (1.0 + LOW_MM_S / span), -high * LOW_MM_S / span
    jacobian[2, :2] = -low / span, high / span
    jacobian[3, 3] = 1.0
    return jacobian

"""Strokes of a finger as rows that touch sensor and accelerometer can be compared by.

Both are brought to one rate and to a band that holds the turns of strokes, 1 to 8 Hz.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d, maximum_filter1d
from scipy.signal import resample_poly

from frictus_hardware.arrays import FloatArray

LARGEST_DELAY_S: Final = 0.06
"""Touch reports that are older or younger than declared by more are not looked for."""
RATE_HZ: Final = 200.0
"""Of what is compared, about: a whole number of samples is one row."""
FILTER_ROWS: Final = 10
"""Reach of the filter of `resample_poly`."""
NARROW_S: Final = 0.03
WIDE_S: Final = 0.2
"""Standard deviations of the Gaussians whose difference is the band."""
MARGIN_S: Final = 4.0 * NARROW_S + 3.0 * WIDE_S
GAP_S: Final = 0.1
"""Touch reports that are further apart are not joined."""


class SensedStrokes(NamedTuple):
    """What was sensed while a finger stroked.

    Attributes
    ----------
    sample_rate_hz : float
        Samples per second.
    force_n, accel_m_s2 : ndarray, shape (n_samples, 3)
        In the rig's frame as configured; NaN where samples are missing.
    touch_s : ndarray, shape (n_reports,)
        When the finger was where it was reported, by the declared latency; rising, the first
        sample is at 0. Only while it touched.
    touch_mm : ndarray, shape (n_reports, 2)
        Where it was.
    """

    sample_rate_hz: float
    force_n: FloatArray
    accel_m_s2: FloatArray
    touch_s: FloatArray
    touch_mm: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class StrokePiece:
    """A stretch without gaps, in rows, without the margins of the band.

    Attributes
    ----------
    rate_hz : float
        Rows per second.
    time_s : ndarray, shape (n_rows,)
        By the device's clock, as `SensedStrokes.touch_s`.
    accel_m_s2 : ndarray, shape (n_rows, 3)
        In the band.
    force_n_s2, force_n_s3 : ndarray, shape (n_rows, 2)
        Second and third derivative of the lateral force, in the band.
    mean_force_n : ndarray, shape (n_rows, 2)
        Averages of the lateral force, of all frequencies.
    mean_m_s2 : ndarray, shape (3,)
        Mean acceleration: gravity, and what zero is off by.
    padded_s : ndarray, shape (n_rows + margins,)
        Times with the margins of the band.
    path : CubicSpline
        Where the finger was, mm.
    """

    rate_hz: float
    time_s: FloatArray
    accel_m_s2: FloatArray
    force_n_s2: FloatArray
    force_n_s3: FloatArray
    mean_force_n: FloatArray
    mean_m_s2: FloatArray
    padded_s: FloatArray
    path: CubicSpline

    def motion(self, delay_s: float, order: int) -> FloatArray:
        """Return a derivative of the position in the band, metres, if touch is so late."""
        return _band(1e-3 * self.path(self.padded_s + delay_s), self.rate_hz, order)


def _band(rows: FloatArray, rate_hz: float, order: int = 0) -> FloatArray:
    """Return a derivative of rows in the band, without the margins."""
    narrow = gaussian_filter1d(rows, NARROW_S * rate_hz, axis=0, order=order, truncate=4.0)
    wide = gaussian_filter1d(narrow, WIDE_S * rate_hz, axis=0, truncate=3.0)
    margin = round(MARGIN_S * rate_hz)
    band: FloatArray = (narrow - wide)[margin:-margin] * rate_hz**order
    return band


def pieces_of(strokes: SensedStrokes) -> Iterator[StrokePiece]:
    """Yield the stretches in which nothing is missing."""
    touch_s, touch_mm = strokes.touch_s, strokes.touch_mm
    per_row = max(round(strokes.sample_rate_hz / RATE_HZ), 1)
    rate_hz = strokes.sample_rate_hz / per_row
    margin = round(MARGIN_S * rate_hz)
    sensed = np.hstack([strokes.force_n, strokes.accel_m_s2])
    missing = ~np.isfinite(sensed.sum(axis=1))
    sensed[missing] = 0.0
    # Averages would not do: where friction reverses, the nail jerks within a millisecond.
    force, accel = np.hsplit(resample_poly(sensed, 1, per_row, axis=0), 2)
    time_s = np.arange(force.shape[0]) / rate_hz
    reach = FILTER_ROWS * per_row
    whole = maximum_filter1d(missing, 2 * reach + 1)[::per_row] == 0
    ends = np.flatnonzero(np.diff(touch_s) > GAP_S) + 1
    for reports in np.split(np.arange(touch_s.size), ends):
        if reports.size < 4:
            continue
        inside = time_s > touch_s[reports[0]] + LARGEST_DELAY_S
        inside &= time_s < touch_s[reports[-1]] - LARGEST_DELAY_S
        edges = np.flatnonzero(np.diff(np.concatenate([[False], whole & inside, [False]])))
        path = CubicSpline(touch_s[reports], touch_mm[reports])
        for begin, end in edges.reshape(-1, 2):
            rows = slice(begin, end)
            if end - begin <= 2 * margin:
                continue
            yield StrokePiece(
                rate_hz=rate_hz,
                time_s=time_s[rows][margin:-margin],
                accel_m_s2=_band(accel[rows], rate_hz),
                force_n_s2=_band(force[rows, :2], rate_hz, 2),
                force_n_s3=_band(force[rows, :2], rate_hz, 3),
                mean_force_n=force[rows][margin:-margin, :2],
                mean_m_s2=accel[rows].mean(axis=0),
                padded_s=time_s[rows],
                path=path,
            )

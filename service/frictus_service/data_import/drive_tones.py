"""The tones that a drive is made of, from its own spectrum; none where it is broadband."""

from typing import Final

import numpy as np

from frictus_hardware.arrays import FloatArray
from frictus_service.identification.observation.validity import (
    HANN_LINES,
    HIGHEST_SHARE,
    LEAST_DRIVE,
)

LOWEST_HZ: Final = 5.0
LINE_POWER: Final = 0.02
"""Of the drive's power, in a tone."""
TONES_POWER: Final = 0.8
"""Of the drive's power in all tones together; less, and the drive is broadband."""
MOST_TONES: Final = 32
NEAR_ROUND: Final = 0.03
"""Of a line's width, within which a tone is taken as a round tenth of a hertz."""


def find_tones(
    drive: FloatArray, rate_hz: float, carrier_hz: float
) -> tuple[float, ...] | None:
    """Return the tones of a drive; empty: broadband; None: no drive.

    Parameters
    ----------
    drive : ndarray, shape (n,)
        Drive fraction; missing samples NaN.
    rate_hz : float
        Of the samples.
    carrier_hz : float
        Its second harmonic is a line of the drive fraction too, and no tone. Where the rate
        folds it into the band the drive counts as broadband, unless the map names its tones.
    """
    values = np.nan_to_num(drive)
    length = values.size
    if length < 64:
        return None
    window = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(length) / length)
    spectrum = np.abs(np.fft.rfft((values - values.mean()) * window)) * 2.0 / window.sum()
    low, high = max(round(LOWEST_HZ * length / rate_hz), 2), int(HIGHEST_SHARE * length)
    if high - low < 8:
        return None
    power = np.square(spectrum)
    whole = float(power[low:high].sum()) / HANN_LINES
    if not np.sqrt(2.0 * whole) >= LEAST_DRIVE:
        return None
    inner = power[low:high]
    rising = inner > power[low - 1 : high - 1]
    peaks = low + np.flatnonzero(rising & (inner >= power[low + 1 : high + 1]))
    folded_hz = abs((2.0 * carrier_hz + rate_hz / 2.0) % rate_hz - rate_hz / 2.0)
    peaks = peaks[np.abs(peaks - folded_hz * length / rate_hz) > 2.0]
    strong = peaks[power[peaks] >= 0.5 * LINE_POWER * whole]
    strong = strong[np.argsort(power[strong])[::-1]][:MOST_TONES]
    lines = [(int(peak), _line_power(power, int(peak))) for peak in strong]
    lines = [(peak, held) for peak, held in lines if held >= LINE_POWER * whole]
    if sum(held for _, held in lines) < TONES_POWER * whole:
        return ()
    step_hz = rate_hz / length
    return tuple(sorted(_rounded(spectrum, peak, step_hz) for peak, _ in lines))


def _line_power(power: FloatArray, peak: int) -> float:
    return float(power[peak - 1 : peak + 2].sum()) / HANN_LINES


def line_hz(spectrum: FloatArray, peak: int, step_hz: float) -> float:
    """Return the frequency of a line, by the ratio of its two highest bins.

    Rife and Vincent 1970; exact for a single tone under Hann's window.

    Parameters
    ----------
    spectrum : ndarray
        Amplitudes.
    peak : int
        Highest bin of the line, neither the first nor the last.
    step_hz : float
        From bin to bin.
    """
    side = 1 if spectrum[peak + 1] >= spectrum[peak - 1] else -1
    ratio = float(spectrum[peak + side] / spectrum[peak])
    return (peak + side * (2.0 * ratio - 1.0) / (ratio + 1.0)) * step_hz


def _rounded(spectrum: FloatArray, peak: int, step_hz: float) -> float:
    found = line_hz(spectrum, peak, step_hz)
    near = round(found, 1)
    return near if abs(near - found) < NEAR_ROUND * step_hz else round(found, 3)

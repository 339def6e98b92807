"""Third-octave bands: the scale on which rendering errors are told."""

from collections.abc import Sequence

import numpy as np
from scipy import signal

from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.linear import TransferFunction

CENTRES_HZ = 10.0 ** (np.arange(15, 31) / 10.0)
"""Third octaves from 31.5 Hz to 1 kHz (IEC 61260, base ten)."""
NOMINAL_HZ = (
    *(31.5, 40.0, 50.0, 63.0, 80.0, 100.0, 125.0, 160.0),
    *(200.0, 250.0, 315.0, 400.0, 500.0, 630.0, 800.0, 1000.0),
)
EDGES_HZ = 10.0 ** (np.arange(14.5, 31.0) / 10.0)
FLOOR_DB = 30.0
"""Bands further than this under the strongest are not judged."""
JND_DB = 1.21
"""Difference threshold of electrovibration amplitude, for orientation."""


def windows(n_samples: int, length: int) -> list[slice]:
    """Return half-overlapping windows that cover a recording."""
    return [slice(at, at + length) for at in range(0, n_samples - length + 1, length // 2)]


def by_band(frequency_hz: FloatArray, power: FloatArray) -> FloatArray:
    """Return the sum in each third octave, shape (16,), of the power of lines."""
    band = np.searchsorted(EDGES_HZ, frequency_hz, side="right") - 1
    inside = (band >= 0) & (band < CENTRES_HZ.size)
    return np.bincount(band[inside], power[inside], CENTRES_HZ.size).astype(np.float64)


def band_power(
    samples: FloatArray,
    sample_rate_hz: float,
    segments: Sequence[slice],
    through: TransferFunction | None = None,
) -> FloatArray:
    """Return the power in each third octave, summed over segments.

    Parameters
    ----------
    samples : ndarray, shape (n_samples,)
    sample_rate_hz : float
        Samples per second of the device's clock.
    segments : sequence of slice
        Each is detrended and weighted with a Hann window over its length; at least 0.1 s.
    through : TransferFunction, optional
        What the samples have passed and shall be freed of.

    Returns
    -------
    ndarray, shape (16,)
        In units of the samples, squared.
    """
    power = np.zeros(CENTRES_HZ.size)
    weight = 0.0
    for segment in segments:
        part = signal.detrend(samples[segment])
        window = signal.windows.hann(part.size, sym=False)
        spectrum = np.square(np.abs(np.fft.rfft(part * window)))
        frequency = np.fft.rfftfreq(part.size, 1.0 / sample_rate_hz).astype(np.float64)
        if through is not None:
            spectrum /= np.square(np.abs(through.frequency_response(frequency)))
        power += 2.0 / part.size * by_band(frequency, spectrum)
        weight += float(np.square(window).sum())
    return power / weight


def error_db(felt: FloatArray, target: FloatArray) -> FloatArray:
    """Return the level error in each band, NaN where the target is too weak to judge.

    Parameters
    ----------
    felt, target : ndarray, shape (16,)
        Powers, as `band_power` returns them.
    """
    judged = target > target.max() * 10.0 ** (-FLOOR_DB / 10.0)
    error = np.full(target.size, np.nan)
    error[judged] = 10.0 * np.log10(np.maximum(felt[judged], 1e-30) / target[judged])
    return error


def rms_db(errors: FloatArray) -> float:
    """Return the root mean square over the judged bands."""
    return float(np.sqrt(np.nanmean(np.square(errors))))

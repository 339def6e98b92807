"""The target, computed without the tables that rendering uses: every sinusoid in full."""

import numpy as np
from numba import njit

from frictus_hardware.arrays import FloatArray
from frictus_service.synthesis.components import Components


def exact_friction(
    sums: list[Components], position_mm: FloatArray, first_sample: int, sample_rate_hz: float
) -> FloatArray:
    """Return the friction that a texture asks for along a path, N.

    Parameters
    ----------
    sums : list of Components
        Sums of sinusoids.
    position_mm : ndarray, shape (n_samples, 2)
        Where the finger truly is.
    first_sample : int
        Device index of the first sample; temporal textures hang on it.
    sample_rate_hz : float
        Samples per second of the device's clock.
    """
    total = np.zeros(position_mm.shape[0])
    for components in sums:
        if components.spatial:
            angle = np.deg2rad(components.angle_deg)
            at = position_mm @ np.array([np.cos(angle), np.sin(angle)])
        else:
            at = (first_sample + np.arange(total.size)) / sample_rate_hz
        _add(2.0 * np.pi * components.frequency, components, at, total)
    return total


def _add(rate: FloatArray, components: Components, at: FloatArray, total: FloatArray) -> None:
    harmonics = components.frequency.max() * (components.period or np.inf)
    if harmonics > 10.0 * rate.size:  # few lines far apart: a cosine costs as much as ten terms
        _sum_cosines(rate, components.amplitude_n, components.phase_rad, at, total)
        return
    assert components.period is not None  # or there would be no end of harmonics
    harmonic = np.round(components.frequency * components.period).astype(np.int64)
    series = np.zeros(harmonic.max() + 1, dtype=complex)
    np.add.at(series, harmonic, components.amplitude_n * np.exp(1j * components.phase_rad))
    _sum_series(series, 2.0 * np.pi * at / components.period, total)


@njit(cache=True, nogil=True)
def _sum_cosines(rate, amplitude, phase, at, total):  # type: ignore[no-untyped-def]
    for n in range(at.size):
        for c in range(rate.size):
            total[n] += amplitude[c] * np.cos(rate[c] * at[n] + phase[c])


@njit(cache=True, nogil=True)
def _sum_series(series, angle, total):  # type: ignore[no-untyped-def]
    """Horner's scheme in ``exp(i angle)``, eight samples at a time."""
    width = 8
    turn = np.empty(width, dtype=np.complex128)
    value = np.empty(width, dtype=np.complex128)
    for start in range(0, angle.size, width):
        n = min(width, angle.size - start)
        for i in range(width):
            a = angle[start + min(i, n - 1)]
            turn[i] = complex(np.cos(a), np.sin(a))
            value[i] = 0.0
        for c in range(series.size - 1, -1, -1):
            for i in range(width):
                value[i] = value[i] * turn[i] + series[c]
        for i in range(n):
            total[start + i] += value[i].real

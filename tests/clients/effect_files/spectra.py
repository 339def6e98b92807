"""What is asked of a rendered effect: its lines, and its likeness to a known course."""

import numpy as np
from numpy.typing import NDArray

from frictus.effect_files import RenderedEffect

FloatArray = NDArray[np.float64]


def times(effect: RenderedEffect) -> FloatArray:
    """Return the time of each sample, s."""
    return np.arange(effect.signal.size) / effect.sample_rate_hz


def line(effect: RenderedEffect, hz: float) -> float:
    """Return the amplitude of a sine that fits a whole number of times into the effect."""
    turned = np.exp(-2j * np.pi * hz * times(effect))
    return float(2.0 * abs(np.mean(effect.signal * turned)))


def strays(effect: RenderedEffect, wanted: FloatArray) -> float:
    """Return how far the effect is from a course, rms, as a share of the course's own.

    Where a course bends or steps, limiting its band moves single samples.
    """
    return float(np.sqrt(np.mean((effect.signal - wanted) ** 2) / np.mean(wanted**2)))


def transform(effect: RenderedEffect, hz: FloatArray) -> NDArray[np.complex128]:
    """Return the Fourier transform at some frequencies, per Hz."""
    turned = np.exp(-2j * np.pi * hz[:, None] * times(effect))
    return np.asarray(turned @ effect.signal / effect.sample_rate_hz)


def burst_transform(hz: FloatArray, of_hz: float, amplitude: float) -> NDArray[np.complex128]:
    """Return that of two cycles of a sine which begin at 0, by its closed form."""
    w, w0, lasts_s = 2.0 * np.pi * hz, 2.0 * np.pi * of_hz, 2.0 / of_hz
    return np.asarray(amplitude * w0 * (1.0 - np.exp(-1j * w * lasts_s)) / (w0**2 - w**2))

"""Friction response of finger and screen: first order, with a cutoff that follows the speed.

Paper, Equation 4 (first-order response) and Equation 9 (speed law). Frequencies are in hertz
and become rad/s exactly where a pole is formed: reading the paper's cutoffs as rad/s would cost
8 dB at 250 Hz.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from frictus_hardware.arrays import FloatArray

FADE_SPEED_MM_S = 2.0
"""Below this speed electrostatic friction fades with the motion."""


@dataclass(frozen=True, slots=True)
class FrictionLaw:
    """``H(s, v) = g w0 / (s + w0)``, ``w0 = 2 pi (cutoff_0 + slope |v|)``.

    Attributes
    ----------
    gain_n : float
        g, newtons of friction per unit of drive fraction. The default is the paper's
        K = 0.0123 N/V times 15.9 V of one upper sideband over its half drive.
    cutoff_0_hz, slope_hz_per_mm_s : float
        The speed law, Equation 9.
    speed_range_mm_s : tuple of float
        Where the law was measured. The cutoff follows the speed clamped to it.
    """

    gain_n: float = 0.39
    cutoff_0_hz: float = 385.68
    slope_hz_per_mm_s: float = 13.811
    speed_range_mm_s: tuple[float, float] = (20.0, 100.0)


def cutoff_hz(law: FrictionLaw, speed_mm_s: FloatArray | float) -> FloatArray:
    """Return the cutoff at a speed (its sign does not matter), in Hz.

    Parameters
    ----------
    law : FrictionLaw
        Gain, cutoff and its slope with speed.
    speed_mm_s : float or ndarray
        Clamped to the law's range: what lies outside was never measured.
    """
    low, high = law.speed_range_mm_s
    clamped = np.clip(np.abs(speed_mm_s), low, high)
    return law.cutoff_0_hz + law.slope_hz_per_mm_s * clamped


def frequency_response(
    law: FrictionLaw, frequency_hz: FloatArray, speed_mm_s: float
) -> NDArray[np.complex128]:
    """Return H at a steady speed, N per unit of drive fraction.

    Parameters
    ----------
    law : FrictionLaw
        Gain, cutoff and its slope with speed.
    frequency_hz : ndarray
        Where it is evaluated.
    speed_mm_s : float
        Its sign does not matter.
    """
    pole = 2.0 * np.pi * cutoff_hz(law, speed_mm_s)
    return law.gain_n * pole / (2j * np.pi * np.asarray(frequency_hz) + pole)


def motion_fade(speed_mm_s: FloatArray) -> FloatArray:
    """Return how much of the electrostatic friction is felt at a speed, 0 to 1."""
    return np.minimum(np.abs(speed_mm_s) / FADE_SPEED_MM_S, 1.0)


def respond(
    law: FrictionLaw,
    drive_fraction: FloatArray,
    speed_mm_s: FloatArray,
    sample_rate_hz: float,
    friction_n: float = 0.0,
) -> tuple[FloatArray, float]:
    """Simulate the response to a held drive, exactly for speed held over each sample.

    ``y[n+1] = a y[n] + (1 - a) g m[n]``, ``a = exp(-w0(v[n]) / fs)``.

    Parameters
    ----------
    law : FrictionLaw
        Gain, cutoff and its slope with speed.
    drive_fraction : ndarray, shape (n_samples,)
        Held from n / fs to (n + 1) / fs.
    speed_mm_s : ndarray, shape (n_samples,)
    sample_rate_hz : float
        Samples per second of the device's clock.
    friction_n : float
        Friction at the first sample.

    Returns
    -------
    friction_n : ndarray, shape (n_samples,)
        Friction at n / fs, the first being the one passed in.
    next_n : float
        Friction at the sample after the last, to go on with.
    """
    decay = np.exp(-2.0 * np.pi * cutoff_hz(law, speed_mm_s) / sample_rate_hz)
    out = np.empty(drive_fraction.size)
    final = _first_order(decay, law.gain_n * drive_fraction, friction_n, out)
    return out, float(final)


@njit(cache=True, nogil=True)
def _first_order(decay, held, state, out):  # type: ignore[no-untyped-def]
    for n in range(out.size):
        out[n] = state
        state = decay[n] * state + (1.0 - decay[n]) * held[n]
    return state

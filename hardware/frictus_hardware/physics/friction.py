"""Friction response of finger and screen: first order, and roll-offs of another order.

Paper, Equation 4 (first-order response) and Equation 9 (speed law). Frequencies are in hertz
and become rad/s exactly where a pole is formed: reading the paper's cutoffs as rad/s would cost
8 dB at 250 Hz.

Friction responses that fall with another order than one.

``g (1 + s / w0)^-(1 + a)`` has no finite number of poles. Its excess, ``(1 + u)^-a`` with
``u = s / w0``, is met by its Padé approximant at u = 0, whose poles and zeros are real, beyond
-1, and crowd where the response bends; it is exact at rest and where a = 0. (G. A. Baker, P.
Graves-Morris, Padé Approximants, 2nd edition, Section 1.2: the binomial function.)
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Final

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


PAIRS: Final = 8
"""For an excess of a half 0.002 dB and 0.02 degrees up to 8 times the cutoff, and 0.05 dB and
0.4 degrees up to 20 times."""


@lru_cache(maxsize=64)
def pole_zero_pairs(excess_order: float) -> tuple[tuple[float, float], ...]:
    """Return (zero, pole) pairs of ``(1 + u)^-a ~ prod (1 + u / zero) / (1 + u / pole)``.

    Parameters
    ----------
    excess_order : float
        a, between -1 and 1.

    Returns
    -------
    tuple of (float, float)
        As multiples of the cutoff: zeros at ``-zero w0``, poles at ``-pole w0``, ascending;
        none where a = 0.
    """
    if excess_order == 0.0:
        return ()
    zeros = _roots(_binomial(excess_order))
    poles = _roots(_binomial(-excess_order))
    return tuple(zip(zeros.tolist(), poles.tolist(), strict=True))


def _binomial(order: float) -> FloatArray:
    """Return 2F1(-n, order - n; -2n; -u), highest power first."""
    terms = [1.0]
    for k in range(PAIRS):
        rise = (k - PAIRS) * (order - PAIRS + k) / ((k - 2 * PAIRS) * (k + 1))
        terms.append(-rise * terms[-1])
    return np.array(terms[::-1])


def _roots(polynomial: FloatArray) -> FloatArray:
    return np.sort(-np.roots(polynomial).real)


@dataclass(frozen=True, slots=True)
class Modes:
    """A response as a sum of first orders: ``sum weight / (1 + u / pole)``, u = s / w0.

    Each follows a held drive exactly, also while the cutoff varies.

    Attributes
    ----------
    pole : ndarray, shape (n_modes,)
        As multiples of the cutoff.
    weight : ndarray, shape (n_modes,)
        They add up to 1.
    """

    pole: FloatArray
    weight: FloatArray

    def at_rest(self) -> FloatArray:
        """Return the state before a first drive of zero, shape (n_modes,)."""
        return np.zeros(self.pole.size)

    def respond(
        self,
        target_n: FloatArray,
        cutoff_hz: FloatArray,
        sample_rate_hz: float,
        early: float,
        state: FloatArray,
    ) -> tuple[FloatArray, FloatArray]:
        """Simulate the response to a held drive.

        Parameters
        ----------
        target_n : ndarray, shape (n_steps,)
            Gain times drive, held during each step.
        cutoff_hz : ndarray, shape (n_steps,)
        sample_rate_hz : float
            Steps per second.
        early : float
            How long before the end of each step friction is looked at, in steps, 0 to 1.
        state : ndarray, shape (n_modes,)
            It is not changed.

        Returns
        -------
        friction_n : ndarray, shape (n_steps,)
            Towards the end of each step.
        state : ndarray, shape (n_modes,)
        """
        turned = (-2.0 * np.pi * cutoff_hz / sample_rate_hz)[:, np.newaxis] * self.pole
        decay = np.exp(turned)
        seen = np.exp((1.0 - early) * turned) if early else decay
        out = np.empty(target_n.size)
        after = state.copy()
        _add_modes(decay, seen, self.weight, target_n, after, out)
        return out, after


@lru_cache(maxsize=64)
def modes(excess_order: float) -> Modes:
    """Return ``(1 + u)^-(1 + a)`` as first orders, by partial fractions.

    Parameters
    ----------
    excess_order : float
        a, between -1 and 1.
    """
    pairs = np.array(pole_zero_pairs(excess_order)).reshape(-1, 2)
    zero, pole = pairs[:, 0], np.append(1.0, pairs[:, 1])
    weight = np.empty(pole.size)
    for k, p in enumerate(pole):
        others = np.delete(pole, k)
        weight[k] = np.prod(1.0 - p / zero) / np.prod(1.0 - p / others)
    return Modes(pole, weight)


@njit(cache=True, nogil=True)
def _add_modes(decay, seen, weight, target, state, out):  # type: ignore[no-untyped-def]
    for n in range(out.size):
        total = 0.0
        for k in range(weight.size):
            total += weight[k] * (seen[n, k] * state[k] + (1.0 - seen[n, k]) * target[n])
            state[k] = decay[n, k] * state[k] + (1.0 - decay[n, k]) * target[n]
        out[n] = total

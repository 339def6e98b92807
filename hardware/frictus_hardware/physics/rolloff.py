"""Friction responses that fall with another order than one.

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

from frictus_hardware.arrays import FloatArray

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

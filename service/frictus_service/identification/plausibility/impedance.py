"""A mass, spring and damper of either sign behind a mobility, and a delay.

A fingertip takes energy up: the real part of its mobility is positive at every frequency. The
likeliest slip of all is a sign, and a delay between the channels turns phases too; so both are
searched together. With ``Y = ± exp(-jωτ) / (b + jωm + k / jω)``, `b`, `m` and `k` follow from
non-negative least squares on the relative error for each sign and delay.

Wiertlewski and Hayward 2012, J. Biomech. 45: lateral damping of fingertips 0.75 to 2.4 N·s/m.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.optimize import nnls

from frictus_hardware.arrays import ComplexArray, FloatArray

DELAYS_S: Final = np.linspace(-1e-3, 1e-3, 81)
"""By which channels of one device may be apart."""
FINE: Final = 26
LEAST_TONES: Final = 3
FLOOR: Final = 0.1
"""Relative error of a response whatever its noise: skins are no mass, spring and damper."""

MOST_MISFIT: Final = 0.5
"""Mean square relative misfit beyond which there is no mass, spring and damper to speak of."""


@dataclass(frozen=True, slots=True)
class Impedance:
    """The best mass, spring and damper; NaN where there are too few tones.

    Attributes
    ----------
    passivity : float
        Mean square relative misfit of the negative sign less that of the positive: near 1 for a
        skin, near -1 for one of the wrong sign, 0 where either would do.
    delay_s : float
        By which the skin's channel is late, at the better sign.
    damping_n_s_m : float
        At the better sign and delay.
    """

    passivity: float
    delay_s: float
    damping_n_s_m: float


UNKNOWN: Final = Impedance(np.nan, np.nan, np.nan)


def fit_impedance(
    frequency_hz: FloatArray, mobility: ComplexArray, variance: FloatArray
) -> Impedance:
    """Return the impedance behind a mobility.

    Parameters
    ----------
    frequency_hz : ndarray, shape (n,)
    mobility : ndarray of complex, shape (n,)
        m/s/N, NaN where unknown.
    variance : ndarray, shape (n,)
        Of real and of imaginary part each.
    """
    known = np.isfinite(mobility) & (mobility != 0.0) & np.isfinite(variance)
    tones_hz, of_tone = np.unique(frequency_hz[known], return_inverse=True)
    if tones_hz.size < LEAST_TONES:
        return UNKNOWN
    relative = 2.0 * variance[known] / np.square(np.abs(mobility[known]))
    weight = 1.0 / (FLOOR**2 + relative)
    total = np.bincount(of_tone, weight)
    real, imaginary = (
        np.bincount(of_tone, weight * part) / total
        for part in (mobility[known].real, mobility[known].imag)
    )
    mean: ComplexArray = real + 1j * imaginary
    # No tone outweighs the others by how often it was played.
    each = total / np.bincount(of_tone).astype(np.float64)
    plus, minus = (_best(tones_hz, sign * mean, each) for sign in (1.0, -1.0))
    chosen = plus if plus[0] <= minus[0] else minus
    passivity = minus[0] - plus[0]
    if chosen[0] > MOST_MISFIT or chosen[2] <= 0.0:
        return Impedance(passivity, np.nan, np.nan)
    return Impedance(passivity, chosen[1], chosen[2])


def _best(
    tones_hz: FloatArray, mobility: ComplexArray, weight: FloatArray
) -> tuple[float, float, float]:
    """Return mean square relative misfit, delay and damping at the best delay."""
    found = min(_fits(tones_hz, mobility, weight, DELAYS_S))
    step = float(DELAYS_S[1] - DELAYS_S[0])
    fine = found[1] + np.linspace(-step, step, FINE)
    return min(found, min(_fits(tones_hz, mobility, weight, fine)))


def _fits(
    tones_hz: FloatArray, mobility: ComplexArray, weight: FloatArray, delays_s: FloatArray
) -> list[tuple[float, float, float]]:
    omega = 2.0 * np.pi * tones_hz
    parts = np.column_stack([np.ones(omega.size), 1j * omega / 1e3, -1j / omega * 1e3])
    root = np.sqrt(weight / weight.sum())
    wanted = np.concatenate([root, np.zeros(root.size)])
    found = []
    for delay_s in delays_s.tolist():
        undone = root * mobility * np.exp(1j * omega * delay_s)
        columns = undone[:, np.newaxis] * parts
        values, norm = nnls(np.concatenate([columns.real, columns.imag]), wanted)
        found.append((float(norm) ** 2, float(delay_s), float(values[0])))
    return found

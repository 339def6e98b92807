"""Rational responses in s, their poles and residues."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complexfloating]


@dataclass(frozen=True, slots=True)
class Rational:
    """Polynomials in s, highest power first, rad/s.

    Attributes
    ----------
    numerator, denominator : tuple of float
    """

    numerator: tuple[float, ...]
    denominator: tuple[float, ...]

    def at(self, s: ComplexArray | FloatArray) -> ComplexArray:
        """Return the value at complex frequencies."""
        value: ComplexArray = np.polyval(self.numerator, s) / np.polyval(self.denominator, s)
        return value

    def upper_poles(self) -> ComplexArray:
        """Return one of each pair of complex poles."""
        poles = np.roots(self.denominator).astype(np.complex128)
        return poles[poles.imag > 0.0]

    def residues(self, poles: ComplexArray) -> ComplexArray:
        """Return the residues at simple poles."""
        slope = np.polyval(np.polyder(np.array(self.denominator)), poles)
        found: ComplexArray = np.polyval(self.numerator, poles) / slope
        return found


def mount(upper_hz: float = 1714.0, damping: float = 0.06) -> Rational:
    """Return the paper's lateral mount, force to force.

    Its upper resonance may be elsewhere; the lower one is damped by the 92 rad/s that its
    antiresonance has.
    """
    upper, zero, lower = (2.0 * np.pi * hz for hz in (upper_hz, 922.0, 856.0))
    numerator = upper**2 * np.array([1.0, 92.0, zero**2])
    denominator = np.polymul(
        [1.0, 2.0 * damping * upper, upper**2], np.array([1.0, 92.0, lower**2])
    )
    return Rational(tuple(numerator.tolist()), tuple(denominator.tolist()))


def other_mount(resonance_hz: float, damping: float) -> Rational:
    """Return a mount of one resonance, with the gain at rest of the paper's."""
    omega = 2.0 * np.pi * resonance_hz
    gain = (922.0 / 856.0) ** 2
    return Rational((gain * omega**2,), (1.0, 2.0 * damping * omega, omega**2))


def skin(mass_kg: float, damping_n_s_m: float, stiffness_n_m: float) -> Rational:
    """Return a mass on spring and damper, from force to acceleration."""
    return Rational((1.0, 0.0, 0.0), (mass_kg, damping_n_s_m, stiffness_n_m))


def with_second_mode(
    first: Rational, share: float, frequency_hz: float, quality: float
) -> Rational:
    """Return a skin with a second resonance beside the first, from force to acceleration.

    Parameters
    ----------
    first : Rational
        From `skin`.
    share : float
        Of the first mode's velocity at resonance.
    frequency_hz, quality : float
        Of the second.
    """
    _, damping_n_s_m, _ = first.denominator
    omega = 2.0 * np.pi * frequency_hz
    width = omega / quality
    second = np.array([1.0, width, omega**2])
    beside = share / damping_n_s_m * width * np.array(first.denominator)
    numerator = np.polymul(np.polyadd(second, beside), [1.0, 0.0, 0.0])
    denominator = np.polymul(first.denominator, second)
    return Rational(tuple(numerator.tolist()), tuple(denominator.tolist()))

"""How gain and cutoff vary with the circumstances of a moving finger."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, Literal, Protocol

import numpy as np

from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.friction import FrictionLaw, cutoff_hz

Quantity = Literal["speed_mm_s", "normal_force_n", "position_mm", "direction", "minutes"]

REFERENCE_SPEED_MM_S: Final = 60.0
REFERENCE_FORCE_N: Final = 0.4
REFERENCE_POSITION_MM: Final = 35.0
"""Middle of the screen."""

LEAST_SPEED_MM_S: Final = 1.0
LEAST_FORCE_N: Final = 0.02
"""Powers of speed and force hold still below these: at rest they would have no end."""
LEAST_CUTOFF_HZ: Final = 1.0
"""A cutoff that falls with the speed stays positive."""
LEAST_GAIN_N: Final = 1e-6
"""So does a gain, or no drive could be found for a friction."""
MOST_TIMES: Final = 1e6
"""Factors together change gain and cutoff no further: effects may meet that each are finite."""


@dataclass(frozen=True, slots=True)
class SlidingConditions:
    """Where, how and when a finger slides; arrays of one shape, or that broadcast.

    Attributes
    ----------
    speed_mm_s : ndarray
        Without sign.
    normal_force_n : ndarray
        Of the finger on the screen.
    position_mm : ndarray
        Along x, from the left edge of the screen.
    direction : ndarray
        +1 left to right, -1 right to left.
    minutes : ndarray
        Since the session began.
    """

    speed_mm_s: FloatArray
    normal_force_n: FloatArray
    position_mm: FloatArray
    direction: FloatArray
    minutes: FloatArray

    def within(self, law: FrictionLaw) -> "SlidingConditions":
        """Return the same with speed and force where effects follow them.

        Parameters
        ----------
        law : FrictionLaw
            Effects follow the speed no further than the law does.
        """
        low, high = (max(end, LEAST_SPEED_MM_S) for end in law.speed_range_mm_s)
        return replace(
            self,
            speed_mm_s=np.clip(self.speed_mm_s, low, high),
            normal_force_n=np.maximum(self.normal_force_n, LEAST_FORCE_N),
        )


class Term(Protocol):
    """A number that varies with the circumstances."""

    def at(self, circumstances: SlidingConditions) -> FloatArray:
        """Return it."""
        ...


@dataclass(frozen=True, slots=True)
class Power:
    """``(x / reference)^exponent``."""

    quantity: Quantity
    reference: float
    exponent: float

    def at(self, circumstances: SlidingConditions) -> FloatArray:
        """Return it in given circumstances."""
        x: FloatArray = getattr(circumstances, self.quantity) / self.reference
        return x**self.exponent


@dataclass(frozen=True, slots=True)
class Exponential:
    """``exp(rate (x - reference))``."""

    quantity: Quantity
    reference: float
    rate: float

    def at(self, circumstances: SlidingConditions) -> FloatArray:
        """Return it in given circumstances."""
        x: FloatArray = getattr(circumstances, self.quantity) - self.reference
        return np.exp(self.rate * x)


@dataclass(frozen=True, slots=True)
class Linear:
    """``at_reference + slope (x - reference)``."""

    quantity: Quantity
    reference: float
    slope: float
    at_reference: float = 0.0

    def at(self, circumstances: SlidingConditions) -> FloatArray:
        """Return it in given circumstances."""
        x: FloatArray = getattr(circumstances, self.quantity) - self.reference
        return self.at_reference + self.slope * x


@dataclass(frozen=True, slots=True)
class Switch:
    """``exp(log_change)`` beyond a threshold and 1 below it, with a rise of a width."""

    quantity: Quantity
    threshold: float
    width: float
    log_change: float

    def at(self, circumstances: SlidingConditions) -> FloatArray:
        """Return it in given circumstances."""
        x: FloatArray = (getattr(circumstances, self.quantity) - self.threshold) / self.width
        return np.exp(0.5 * self.log_change * (1.0 + np.tanh(0.5 * x)))


@dataclass(frozen=True, slots=True)
class Knee:
    """``(x / threshold)^exponent`` far to one side of a threshold, 1 far to the other.

    It bends within ``softness`` of ``ln x`` around the threshold.
    """

    quantity: Quantity
    threshold: float
    exponent: float
    above: bool
    softness: float

    def at(self, circumstances: SlidingConditions) -> FloatArray:
        """Return it in given circumstances."""
        x = np.log(getattr(circumstances, self.quantity) / self.threshold)
        side = 1.0 if self.above else -1.0
        bent = side * self.softness * np.logaddexp(0.0, side * x / self.softness)
        factor: FloatArray = np.exp(self.exponent * bent)
        return factor


@dataclass(frozen=True, slots=True)
class Coupling:
    """``exp(exponent ln(v / v0) ln(F / F0))``: how speed matters depends on the force."""

    exponent: float

    def at(self, circumstances: SlidingConditions) -> FloatArray:
        """Return it in given circumstances."""
        speed = np.log(circumstances.speed_mm_s / REFERENCE_SPEED_MM_S)
        force = np.log(circumstances.normal_force_n / REFERENCE_FORCE_N)
        return np.exp(self.exponent * speed * force)


@dataclass(frozen=True, slots=True)
class LawSchedule:
    """What gain and cutoff of a law are multiplied with, and what is added to the cutoff.

    Attributes
    ----------
    gain_factors, cutoff_terms_hz, cutoff_factors : tuple of Term
        ``gain = g product``, ``cutoff = (c(v) + sum) product``.
    """

    gain_factors: tuple[Term, ...] = ()
    cutoff_terms_hz: tuple[Term, ...] = ()
    cutoff_factors: tuple[Term, ...] = ()

    def gain_n(self, law: FrictionLaw, circumstances: SlidingConditions) -> FloatArray:
        """Return the friction per unit of drive fraction, 1e-6 N at least.

        Parameters
        ----------
        law : FrictionLaw
            Gain, cutoff and its slope with speed.
        circumstances : SlidingConditions
            Speed, force, position, direction and time.
        """
        if not self.gain_factors:
            return np.full((), law.gain_n)
        factor = product(self.gain_factors, circumstances.within(law))
        return np.maximum(law.gain_n * factor, LEAST_GAIN_N)

    def cutoff_hz(self, law: FrictionLaw, circumstances: SlidingConditions) -> FloatArray:
        """Return the cutoff, 1 Hz at least.

        Parameters
        ----------
        law : FrictionLaw
            Gain, cutoff and its slope with speed.
        circumstances : SlidingConditions
            Speed, force, position, direction and time.
        """
        own = cutoff_hz(law, circumstances.speed_mm_s)
        if not self.cutoff_terms_hz and not self.cutoff_factors:
            return own
        within = circumstances.within(law)
        for term in self.cutoff_terms_hz:
            own = own + term.at(within)
        return np.maximum(own * product(self.cutoff_factors, within), LEAST_CUTOFF_HZ)


def product(factors: Sequence[Term], circumstances: SlidingConditions) -> FloatArray:
    """Return the product of terms, 1 if there are none, from ``-MOST_TIMES`` to `MOST_TIMES`.

    Parameters
    ----------
    factors : sequence of Term
        Each a function of the circumstances.
    circumstances : SlidingConditions
        `SlidingConditions.within` a law.
    """
    total: FloatArray = np.ones(())
    for factor in factors:
        total = np.clip(total * factor.at(circumstances), -MOST_TIMES, MOST_TIMES)
    return total

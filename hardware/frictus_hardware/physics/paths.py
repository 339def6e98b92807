"""Parallel paths of the drive: what the friction response has beside a first order.

The drive fraction reaches the finger along a further path, so that the response is multiplied
by ``1 + dose B(f)``: with a band pass for B it has one more resonance, with a high-pass one
more pole and zero, with a pure delay an echo. The dose may depend on how the finger slides.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from frictus_hardware.arrays import ComplexArray, FloatArray
from frictus_hardware.physics import linear
from frictus_hardware.physics.linear import TransferFunction
from frictus_hardware.physics.schedule import Quantity, SlidingConditions
from frictus_hardware.physics.twin import Signals

MEASURED: Final[dict[Quantity, tuple[float, float]]] = {
    "speed_mm_s": (20.0, 100.0),
    "normal_force_n": (0.2, 0.6),
    "position_mm": (5.0, 65.0),
    "direction": (-1.0, 1.0),
    "minutes": (0.0, 20.0),
}
"""Of each quantity: -1 and 1 on its scale. A dose follows it no further."""


def scaled(quantity: Quantity, circumstances: SlidingConditions) -> FloatArray:
    """Return a quantity on the scale from -1 to 1 of `MEASURED`; beyond, it holds still.

    Parameters
    ----------
    quantity : str
        A key of `MEASURED`.
    circumstances : SlidingConditions
        Of any shape.
    """
    low, high = MEASURED[quantity]
    value = np.asarray(getattr(circumstances, quantity), dtype=np.float64)
    x: FloatArray = np.clip((2.0 * value - low - high) / (high - low), -1.0, 1.0)
    return x


@dataclass(frozen=True, slots=True)
class Dose:
    """``size (level + sum of rate x)``, x the scaled quantities.

    Attributes
    ----------
    size : float
        Of which the rest is a multiple.
    rates : tuple of (str, float)
        By quantity.
    level : float
        1, or 0 for a dose that vanishes in the middle of its quantity's range.
    """

    size: float
    rates: tuple[tuple[Quantity, float], ...] = ()
    level: float = 1.0

    def at(self, circumstances: SlidingConditions) -> FloatArray:
        """Return it in given circumstances."""
        total = np.full(np.shape(circumstances.speed_mm_s), self.level)
        for quantity, rate in self.rates:
            if rate:
                total = total + rate * scaled(quantity, circumstances)
        return self.size * total


@dataclass(frozen=True, slots=True)
class DelayLine:
    """A pure delay.

    Attributes
    ----------
    delay_s : float
        In the twin, between its steps, interpolated: 0.1 dB at 2 kHz.
    """

    delay_s: float

    def frequency_response(self, frequency_hz: FloatArray) -> ComplexArray:
        """Return ``exp(-s delay)`` at ``s = 2 pi i f``."""
        response: ComplexArray = np.exp(-2j * np.pi * self.delay_s * np.asarray(frequency_hz))
        return response


@dataclass(frozen=True, slots=True)
class FilterBank:
    """A weighted sum of filters.

    Attributes
    ----------
    parts : tuple of (float, TransferFunction)
        Weights, and filters of equal order.
    """

    parts: tuple[tuple[float, TransferFunction], ...]

    def frequency_response(self, frequency_hz: FloatArray) -> ComplexArray:
        """Return the sum of the weighted responses at ``s = 2 pi i f``."""
        total: ComplexArray = np.zeros(np.shape(frequency_hz), dtype=np.complex128)
        for weight, part in self.parts:
            total = total + weight * part.frequency_response(frequency_hz)
        return total


Branch = TransferFunction | DelayLine | FilterBank


@dataclass(frozen=True, slots=True)
class ParallelPath:
    """A factor ``1 + dose B(f)`` of the friction response.

    Attributes
    ----------
    dose : Dose
        How strong it is, and what that follows.
    branch : TransferFunction, DelayLine or FilterBank
        B, proper.
    """

    dose: Dose
    branch: Branch

    def factor(
        self, frequency_hz: FloatArray, circumstances: SlidingConditions
    ) -> ComplexArray:
        """Return the factor in the steady state.

        Parameters
        ----------
        frequency_hz : ndarray
            Where it is evaluated.
        circumstances : SlidingConditions
            Arrays that broadcast with the frequencies.
        """
        return 1.0 + self.dose.at(circumstances) * self.branch.frequency_response(frequency_hz)


def factor_of(
    paths: Sequence[ParallelPath], frequency_hz: FloatArray, circumstances: SlidingConditions
) -> ComplexArray:
    """Return the product of the factors of paths, 1 if there are none.

    Parameters
    ----------
    paths : sequence of ParallelPath
        Of the drive.
    frequency_hz : ndarray
        Where it is evaluated.
    circumstances : SlidingConditions
        Arrays that broadcast with the frequencies.
    """
    total: ComplexArray = np.ones((), dtype=np.complex128)
    for path in paths:
        total = total * path.factor(frequency_hz, circumstances)
    return total


@dataclass(frozen=True, slots=True)
class FollowPath:
    """A path in the twin: adds what comes along it to the drive fraction.

    Attributes
    ----------
    path : ParallelPath
        That is followed.
    minutes : float
        Since the session began.
    """

    path: ParallelPath
    minutes: float = 0.0

    def initial(self) -> None:
        """Return None: nothing has been driven."""

    def run(self, signals: Signals, state: FloatArray | None) -> tuple[Signals, FloatArray]:
        """Change `drive_fraction`."""
        drive, rate_hz = signals.drive_fraction, signals.sample_rate_hz
        passed, state = _along(self.path.branch, drive, rate_hz, state)
        velocity = signals.velocity_mm_s
        around = SlidingConditions(
            speed_mm_s=np.hypot(velocity[:, 0], velocity[:, 1]),
            normal_force_n=signals.normal_force_n,
            position_mm=signals.position_mm[:, 0],
            direction=np.sign(velocity[:, 0]),
            minutes=np.array(self.minutes),
        )
        driven = drive + self.path.dose.at(around) * passed
        return replace(signals, drive_fraction=driven), state


def _along(
    branch: Branch, drive: FloatArray, rate_hz: float, state: FloatArray | None
) -> tuple[FloatArray, FloatArray]:
    """Return what leaves a branch, and its memory."""
    if isinstance(branch, DelayLine):
        whole, share = divmod(branch.delay_s * rate_hz, 1.0)
        waiting = int(whole) + 1
        line = np.concatenate([np.zeros(waiting) if state is None else state, drive])
        earlier, later = line[: drive.size], line[1 : drive.size + 1]
        return (1.0 - share) * later + share * earlier, line[drive.size :]
    parts = branch.parts if isinstance(branch, FilterBank) else ((1.0, branch),)
    total, memories = np.zeros(drive.size), []
    for place, (weight, part) in enumerate(parts):
        sampled = linear.sample(part, rate_hz)
        before = sampled.at_rest(1) if state is None else state[place]
        passed, after = sampled.run(drive[:, np.newaxis], before)
        total += weight * passed[:, 0]
        memories.append(after)
    return total, np.stack(memories)

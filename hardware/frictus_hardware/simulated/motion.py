"""How a virtual finger moves, and how hard it presses."""

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from frictus_hardware.arguments import LEAST_N, NonNegative, StrictModel
from frictus_hardware.arrays import FloatArray


@dataclass(frozen=True, slots=True)
class FingerMotion:
    """A finger at given instants.

    Attributes
    ----------
    position_mm, velocity_mm_s : ndarray, shape (n_samples, 2)
        On the screen; the velocity is the derivative of the position.
    normal_force_n : ndarray, shape (n_samples,)
        0 where there is no contact.
    in_contact : ndarray of bool, shape (n_samples,)
    """

    position_mm: FloatArray
    velocity_mm_s: FloatArray
    normal_force_n: FloatArray
    in_contact: NDArray[np.bool_]


def least_jerk(share: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return a movement of least jerk from rest to rest (Flash and Hogan 1985).

    Parameters
    ----------
    share : ndarray
        Of its time that is over, 0 to 1.

    Returns
    -------
    gone : ndarray
        Share of the way.
    pace : ndarray
        Its derivative by `share`.
    """
    gone = share**3 * (10.0 + share * (-15.0 + 6.0 * share))
    pace = 30.0 * np.square(share * (1.0 - share))
    return gone, pace


class Finger(Protocol):
    """A virtual finger."""

    def at(self, time_s: FloatArray) -> FingerMotion:
        """Return the finger at increasing times, shape (n_samples,), device seconds."""
        ...


@dataclass(frozen=True)
class Wander:
    """A sum of slow sinusoids: continuous, reproducible, a pure function of time.

    Attributes
    ----------
    frequency_hz, phase_rad, amplitude : ndarray, shape (n_components,)
    """

    frequency_hz: FloatArray
    phase_rad: FloatArray
    amplitude: FloatArray

    @classmethod
    def draw(
        cls,
        rng: np.random.Generator,
        band_hz: tuple[float, float],
        rms: float,
        n_components: int = 6,
    ) -> "Wander":
        """Return random sinusoids of equal size within a band.

        Parameters
        ----------
        rng : Generator
            Source of everything random.
        band_hz : tuple of float
            Lowest and highest.
        rms : float
            Of the sum.
        n_components : int
            How many sinusoids.
        """
        return cls(
            rng.uniform(*band_hz, n_components),
            rng.uniform(0.0, 2.0 * np.pi, n_components),
            np.full(n_components, rms * np.sqrt(2.0 / n_components)),
        )

    @property
    def bound(self) -> float:
        """Largest magnitude the sum can have."""
        return float(np.sum(np.abs(self.amplitude)))

    def value(self, time_s: FloatArray) -> FloatArray:
        """Return the sum, shape (n_samples,)."""
        return self.sums(time_s)[0]

    def rate(self, time_s: FloatArray) -> FloatArray:
        """Return its derivative, per second."""
        return self.sums(time_s)[1]

    def sums(self, time_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return `value` and `rate`, for little more than one of them costs."""
        # Late, because a process that only reads a configuration needs no compiler.
        from frictus_hardware.simulated.kernels import add_sinusoids

        time_s = np.ascontiguousarray(time_s, dtype=np.float64)
        value, rate = np.empty(time_s.size), np.empty(time_s.size)
        add_sinusoids(time_s, self.table, value, rate)
        return value, rate

    @cached_property
    def table(self) -> FloatArray:
        """Frequency, phase and amplitude for `add_sinusoids`, shape (3, n_components)."""
        return np.array([self.frequency_hz, self.phase_rad, self.amplitude])


class Press(StrictModel):
    """Settings of the normal force.

    Attributes
    ----------
    target_n : float
        What the finger aims at, 0.05 to 5 N.
    wander_n : float
        Standard deviation of what it does instead, between 0.1 and 2 Hz.
    """

    target_n: float = Field(default=0.4, ge=LEAST_N, le=5.0)
    wander_n: NonNegative = 0.04

    def start(self, rng: np.random.Generator) -> "NormalForce":
        """Return the force as a function of time."""
        return NormalForce(self.target_n, Wander.draw(rng, (0.1, 2.0), self.wander_n))


@dataclass(frozen=True, slots=True)
class NormalForce:
    """A force that wanders around its target."""

    target_n: float
    wander: Wander

    def at(self, time_s: FloatArray) -> FloatArray:
        """Return the force, N, shape (n_samples,)."""
        return np.maximum(self.target_n + self.wander.value(time_s), LEAST_N)

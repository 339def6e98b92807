"""How a finger moves, and how hard it presses."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


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


class Finger(Protocol):
    """A virtual finger."""

    def at(self, time_s: FloatArray) -> FingerMotion:
        """Return the finger at increasing times, shape (n_samples,), device seconds."""
        ...


@dataclass(frozen=True, slots=True)
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
        band_hz : tuple of float
        rms : float
            Of the sum.
        n_components : int
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
        out: FloatArray = np.sin(self._phase(time_s)) @ self.amplitude
        return out

    def rate(self, time_s: FloatArray) -> FloatArray:
        """Return its derivative, per second."""
        turn = 2.0 * np.pi * self.frequency_hz
        out: FloatArray = np.cos(self._phase(time_s)) @ (turn * self.amplitude)
        return out

    def _phase(self, time_s: FloatArray) -> FloatArray:
        return 2.0 * np.pi * np.multiply.outer(time_s, self.frequency_hz) + self.phase_rad

"""How friction falls with frequency, as a sum of real poles that scale with the cutoff."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complexfloating]


@dataclass(frozen=True, slots=True)
class Rolloff:
    """sum of weight / (s / w0 + pole).

    Attributes
    ----------
    poles, weights : ndarray, shape (n,)
    """

    poles: FloatArray
    weights: FloatArray

    def at(self, s: ComplexArray) -> ComplexArray:
        """Return the value at s / w0, of any shape."""
        value: ComplexArray = (self.weights / (s[..., np.newaxis] + self.poles)).sum(axis=-1)
        return value


FIRST_ORDER = Rolloff(np.array([1.0]), np.array([1.0]))


def power_of_first_order(order: float) -> Rolloff:
    """Return (1 + s / w0)^-order."""
    return _fitted(lambda s: (1.0 + s) ** -order)


def first_order_of_power(order: float) -> Rolloff:
    """Return 1 / (1 + (s / w0)^order)."""
    return _fitted(lambda s: 1.0 / (1.0 + s**order))


def _fitted(response: Callable[[ComplexArray], ComplexArray]) -> Rolloff:
    """Return real poles that follow a response to about 1e-4 from 0.01 to 30 times w0."""
    poles = np.geomspace(0.02, 400.0, 28)
    s = 1j * np.geomspace(0.003, 60.0, 400)
    wanted = response(s)
    relative = 1.0 / (s[:, np.newaxis] + poles) / wanted[:, np.newaxis]
    stacked = np.concatenate([relative.real, relative.imag])
    target = np.concatenate([np.ones(s.size), np.zeros(s.size)])
    weights = np.linalg.lstsq(stacked, target, rcond=1e-8)[0]
    return Rolloff(poles, weights)

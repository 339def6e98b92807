"""How hard a virtual finger presses."""

from dataclasses import dataclass

import numpy as np
from pydantic import Field

from frictus_hardware.arrays import FloatArray
from frictus_hardware.simulated.motion import Wander
from frictus_hardware.simulated.strict import NonNegative, StrictModel

LEAST_N = 0.05
"""A finger on the screen presses at least this hard."""


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

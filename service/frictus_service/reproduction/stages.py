"""Stages that a simulated study adds to the standard twin."""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy import signal

from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.friction import motion_fade
from frictus_hardware.physics.twin import Signals

ROUGHNESS: Final = 0.05
ROUGHNESS_HZ: Final = 100.0


@dataclass(frozen=True, slots=True)
class Rubbing:
    """Friction noise of skin on glass: in proportion to friction, and stronger at low pitch.

    White noise through a first-order low-pass.

    Attributes
    ----------
    friction_coefficient : float
        Of skin on glass, friction over normal force without drive.
    seed : int
        Of everything random; the same seed gives the same result.
    share : float
        Its rms, as a share of ``mu F_n``.
    corner_hz : float
        Above it the noise falls.
    """

    friction_coefficient: float
    seed: int
    share: float = ROUGHNESS
    corner_hz: float = ROUGHNESS_HZ

    def initial(self) -> tuple[np.random.Generator, FloatArray]:
        """Return a generator, which moves on with each run, and the filter at rest."""
        return np.random.default_rng(self.seed), np.zeros(1)

    def run(
        self, signals: Signals, state: tuple[np.random.Generator, FloatArray]
    ) -> tuple[Signals, tuple[np.random.Generator, FloatArray]]:
        """Add noise to `friction_n`."""
        rng, kept = state
        decay = np.exp(-2.0 * np.pi * self.corner_hz / signals.sample_rate_hz)
        white = rng.standard_normal(signals.friction_n.size)
        noise, kept = signal.lfilter([np.sqrt(1.0 - decay**2)], [1.0, -decay], white, zi=kept)
        speed = np.hypot(signals.velocity_mm_s[:, 0], signals.velocity_mm_s[:, 1])
        rubbed = self.friction_coefficient * signals.normal_force_n * motion_fade(speed)
        felt = signals.friction_n + self.share * rubbed * noise * signals.in_contact
        return replace(signals, friction_n=felt), (rng, kept)


@dataclass(frozen=True, slots=True)
class LateDrive:
    """A channel between monitor and screen that passes everything on too late.

    Attributes
    ----------
    delay_s : float
        At least one step of the twin, and a multiple of it.
    """

    delay_s: float

    def initial(self) -> FloatArray | None:
        """Return None: before its first sample the screen is at 0 V."""
        return None

    def run(self, signals: Signals, state: FloatArray | None) -> tuple[Signals, FloatArray]:
        """Delay `screen_v`."""
        steps = self.delay_s * signals.sample_rate_hz
        if not (steps > 0.5 and abs(steps - round(steps)) < 1e-6):
            raise ValueError(
                f"a delay of {self.delay_s} s is {steps:g} steps of the twin; accepted: whole "
                f"multiples of {1.0 / signals.sample_rate_hz:g} s"
            )
        waiting = np.zeros(round(steps)) if state is None else state
        both = np.concatenate([waiting, signals.screen_v])
        passed, waiting = np.split(both, [signals.screen_v.size])
        return replace(signals, screen_v=passed), waiting

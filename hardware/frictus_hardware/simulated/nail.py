"""What an accelerometer on a fingernail senses besides the vibration of the skin."""

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.linear import SampledFilter, TransferFunction, sample
from frictus_hardware.physics.twin import Signals
from frictus_hardware.sensors.rotation import in_turn
from frictus_hardware.simulated.config import NailConfig
from frictus_hardware.simulated.motion import Wander

GRAVITY_M_S2: Final = 9.80665
TILT_HZ: Final = (0.05, 0.4)


@dataclass(frozen=True, slots=True)
class _NailState:
    """Samples so far, velocity of the last one, and the memory of the resonance."""

    n_samples: int
    velocity_mm_s: FloatArray
    memory: FloatArray | None


@dataclass(frozen=True, slots=True)
class NailSensor:
    """Adds what moves a finger as a whole to `accel_m_s2`, and gravity; a stage of the twin.

    An accelerometer senses acceleration less gravity: at rest 1 g away from the screen, of
    which a part lies along the screen as soon as the nail leans.

    Attributes
    ----------
    config : NailConfig
        Tilt, resonance and mounting.
    screen_mm : tuple of float
        Width and height.
    lean_x, lean_y : Wander
        Degrees that the nail leans besides, towards x and y.
    """

    config: NailConfig
    screen_mm: tuple[float, float]
    lean_x: Wander
    lean_y: Wander

    @classmethod
    def draw(
        cls, config: NailConfig, screen_mm: tuple[float, float], rng: np.random.Generator
    ) -> "NailSensor":
        """Return the sensor on a nail that leans at random.

        Parameters
        ----------
        config : NailConfig
            Tilt, resonance and mounting.
        screen_mm : tuple of float
            Width and height.
        rng : Generator
            Source of everything random.
        """
        leans = (Wander.draw(rng, TILT_HZ, config.wander_tilt_deg) for _ in range(2))
        return cls(config, screen_mm, *leans)

    def initial(self) -> None:
        """Return None: the finger moves on as at the first sample."""

    def run(self, signals: Signals, state: _NailState | None) -> tuple[Signals, _NailState]:
        """Set `accel_m_s2` to what the sensor puts out, without its noise."""
        velocity = signals.velocity_mm_s
        if state is None:
            state = _NailState(0, velocity[0], None)
        n_samples = velocity.shape[0]
        step = np.diff(velocity, axis=0, prepend=state.velocity_mm_s[np.newaxis])
        accel = signals.accel_m_s2 + self._gravity(signals, state.n_samples)
        accel[:, :2] += 1e-3 * signals.sample_rate_hz * step
        memory = state.memory
        if self.config.resonance_hz is not None:
            resonance = self._resonance(signals.sample_rate_hz)
            if memory is None:
                memory = resonance.at_rest(3)
            accel, memory = resonance.run(accel, memory)
        if any(self.config.mounted_deg):
            x_deg, y_deg, z_deg = self.config.mounted_deg
            accel = accel @ in_turn((("x", x_deg), ("y", y_deg), ("z", z_deg))).T
        after = _NailState(state.n_samples + n_samples, velocity[-1], memory)
        return replace(signals, accel_m_s2=accel), after

    def _gravity(self, signals: Signals, first_sample: int) -> FloatArray:
        time_s = (first_sample + np.arange(signals.voltage_v.size)) / signals.sample_rate_hz
        along = signals.position_mm[:, 0] / self.screen_mm[0] - 0.5
        lean_x = np.deg2rad(self.config.stroke_tilt_deg * along + self.lean_x.value(time_s))
        lean_y = np.deg2rad(self.lean_y.value(time_s))
        upright = -np.cos(lean_x) * np.cos(lean_y)
        gravity: FloatArray = GRAVITY_M_S2 * np.column_stack(
            [np.sin(lean_x), np.sin(lean_y), upright]
        )
        return gravity

    def _resonance(self, rate_hz: float) -> SampledFilter:
        assert self.config.resonance_hz is not None
        natural = 2.0 * math.pi * self.config.resonance_hz
        damped = 2.0 * self.config.resonance_damping * natural
        return sample(TransferFunction((natural**2,), (1.0, damped, natural**2)), rate_hz)

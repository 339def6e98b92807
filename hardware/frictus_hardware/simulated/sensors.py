"""The sensors of the simulated rig: the touch sensor, and the accelerometer on the nail."""

import math
from collections import deque
from dataclasses import dataclass
from typing import Annotated, Final

import numpy as np
from pydantic import Field

from frictus_hardware.arguments import NonNegative, Positive, StrictModel
from frictus_hardware.arrays import FloatArray
from frictus_hardware.base import TouchReport
from frictus_hardware.physics.linear import SampledFilter, TransferFunction, sample
from frictus_hardware.physics.twin import Signals
from frictus_hardware.sensors.rotation import in_turn
from frictus_hardware.simulated.motion import FingerMotion, Wander


class TouchConfig(StrictModel):
    """Settings of the touch sensor.

    Attributes
    ----------
    rate_hz : float
        Reports per second, whether the finger touches or not.
    resolution_mm : float
        Positions are rounded to it; 0 for none.
    latency_s : float
        From measurement to arrival, in the mean.
    latency_sd_s : float
        Standard deviation of it from report to report, which the times of reports then have, as
        of a sensor without a clock of its own.
    declared_latency_s : float or None
        What the rig declares, and takes off the arrival. None: the true latency.
    """

    rate_hz: Positive = 60.0
    resolution_mm: NonNegative = 0.1
    latency_s: float = Field(default=0.030, ge=0.0, le=1.0)
    latency_sd_s: float = Field(default=0.0, ge=0.0, le=0.1)
    declared_latency_s: float | None = Field(default=None, ge=0.0, le=1.0)

    @property
    def declared_s(self) -> float:
        """Declared age of a report when it arrives."""
        return self.latency_s if self.declared_latency_s is None else self.declared_latency_s


@dataclass(frozen=True, slots=True)
class _Pending:
    arrival_sample: float
    x_mm: float
    y_mm: float
    in_contact: bool


class TouchSensor:
    """Scans a finger at a fixed rate; a report arrives one latency after its scan.

    Parameters
    ----------
    config : TouchConfig
        Rate, latency and resolution.
    sample_rate_hz : float
        Samples per second of the device's clock.
    seed : int
        Of how the latency differs.
    """

    def __init__(self, config: TouchConfig, sample_rate_hz: float, seed: int = 0) -> None:
        self._rng = np.random.default_rng(seed)
        self._latency_sd = config.latency_sd_s * sample_rate_hz
        self._resolution_mm = config.resolution_mm
        self._period = sample_rate_hz / config.rate_hz
        self._latency = config.latency_s * sample_rate_hz
        self._declared = config.declared_s * sample_rate_hz
        self._scans = 0
        self._pending: deque[_Pending] = deque()

    def step(self, first_sample: int, motion: FingerMotion) -> tuple[TouchReport, ...]:
        """Scan during a block, and return the reports that arrive during it, oldest first.

        Parameters
        ----------
        first_sample : int
            Blocks must follow one another.
        motion : FingerMotion
            The finger at each sample of the block.
        """
        end = first_sample + motion.in_contact.size
        while (scan := int(np.ceil(self._scans * self._period))) < end:
            self._scan(scan, motion, scan - first_sample)
            self._scans += 1
        arrived = []
        while self._pending and self._pending[0].arrival_sample < end:
            report = self._pending.popleft()
            arrived.append(
                TouchReport(
                    measured_sample=report.arrival_sample - self._declared,
                    x_mm=report.x_mm,
                    y_mm=report.y_mm,
                    in_contact=report.in_contact,
                )
            )
        return tuple(arrived)

    def _scan(self, sample: int, motion: FingerMotion, row: int) -> None:
        x, y = (self._round(float(value)) for value in motion.position_mm[row])
        arrival = sample + self._latency
        if self._latency_sd:
            arrival += self._latency_sd * self._rng.standard_normal()
            before = self._pending[-1].arrival_sample if self._pending else sample
            arrival = max(arrival, before, sample)  # none overtakes another, nor the finger
        self._pending.append(_Pending(arrival, x, y, bool(motion.in_contact[row])))

    def _round(self, value_mm: float) -> float:
        if self._resolution_mm == 0.0:
            return value_mm
        return round(value_mm / self._resolution_mm) * self._resolution_mm


GRAVITY_M_S2: Final = 9.80665
TILT_HZ: Final = (0.05, 0.4)


class NailConfig(StrictModel):
    """Settings of the accelerometer's place on the nail.

    Attributes
    ----------
    stroke_tilt_deg : float
        By which the nail leans over from one edge of the screen to the other, and gravity with
        it; 1 degree is 0.17 m/s².
    wander_tilt_deg : float
        Standard deviation of what it leans besides, slowly, about both axes.
    resonance_hz : float or None
        Of the sensor on its wax; None: the wax is rigid.
    resonance_damping : float
        Damping ratio of that.
    mounted_deg : tuple of float
        By which the sensor is turned about x, y and z (in this order) against the frame that
        the rig takes it to be in.
    """

    stroke_tilt_deg: float = Field(default=2.0, ge=-45.0, le=45.0)
    wander_tilt_deg: NonNegative = 0.7
    resonance_hz: float | None = Field(default=None, ge=10.0, le=10_000.0)
    resonance_damping: float = Field(default=0.05, gt=0.0, le=1.0)
    mounted_deg: Annotated[tuple[float, float, float], Field(strict=False)] = (0.0, 0.0, 0.0)


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
        # Late, because a process that only reads a configuration needs no compiler.
        from frictus_hardware.simulated.kernels import sense_nail

        velocity = signals.velocity_mm_s
        if state is None:
            state = _NailState(0, velocity[0], None)
        n_samples = velocity.shape[0]
        accel = signals.accel_m_s2.copy()
        sense_nail(
            state.n_samples,
            signals.sample_rate_hz,
            np.ascontiguousarray(signals.position_mm),
            np.ascontiguousarray(velocity),
            state.velocity_mm_s,
            self.screen_mm[0],
            self.config.stroke_tilt_deg,
            GRAVITY_M_S2,
            self.lean_x.table,
            self.lean_y.table,
            accel,
        )
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
        return signals.sensed(signals.force_n, accel), after

    def _resonance(self, rate_hz: float) -> SampledFilter:
        assert self.config.resonance_hz is not None
        natural = 2.0 * math.pi * self.config.resonance_hz
        damped = 2.0 * self.config.resonance_damping * natural
        return sample(TransferFunction((natural**2,), (1.0, damped, natural**2)), rate_hz)

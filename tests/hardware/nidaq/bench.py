"""A rig on the fake device: its wiring, what is wired to it, and a touch sensor beside it."""

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass

import numpy as np
from tests.hardware.nidaq.fake_device import PCIE, FakeDevice, Plant
from tests.hardware.nidaq.fake_server import FakeServer

from frictus_hardware.arrays import FloatArray
from frictus_hardware.base import TouchReport
from frictus_hardware.nidaq.backend import NiRig
from frictus_hardware.nidaq.config import Inputs, NiConfig
from frictus_hardware.nidaq.sensing import Sensed
from frictus_hardware.physics.twin import Signals
from frictus_hardware.simulated.config import SimulatedConfig
from frictus_hardware.simulated.motion import Finger
from frictus_hardware.simulated.rig import SimulatedRig
from frictus_hardware.simulated.sensors import TouchConfig, TouchSensor
from frictus_hardware.simulated.twin import make_twin

FORCE = Inputs(tuple(f"ai{index}" for index in range(6)))
ACCEL = Inputs(("ai6", "ai7", "ai8"), range_v=5.0, terminals="rse")
MONITOR = Inputs(("ai9",), terminals="rse")

GAUGE_V_PER_N = np.array(
    [[1.0, 0, 0], [-0.5, 0.8, 0], [-0.5, -0.8, 0], [0, 0, 1.0], [0.2, 0, 1.0], [0, 0.2, 1.0]]
)
"""Six gauges that see three axes of force; any such matrix of rank 3 would do."""
ACCEL_V_PER_M_S2 = 0.02
ACCEL_BIAS_V = np.full(3, 1.5)


def wiring(**changes: object) -> NiConfig:
    return NiConfig(**({"force": FORCE, "accel": ACCEL, "monitor": MONITOR} | changes))  # type: ignore[arg-type]


@dataclass(frozen=True)
class LinearConversion:
    """Every quantity a matrix times volts; all channels taken at one time, no tare wanted.

    `force_n_per_v` is (3, n_force), `accel_m_s2_per_v` (3, n_accel); the monitor is last.
    """

    force_n_per_v: FloatArray
    accel_m_s2_per_v: FloatArray
    monitor_gain: float
    accel_bias_v: FloatArray
    delay_samples: int = 0
    tare_samples: int = 0

    def tare(self, input_v: FloatArray) -> None:
        raise AssertionError("no tare was asked for")

    def start(self, conversion_rate_hz: float) -> None:
        """Do nothing: there is no state."""

    def prime(self, input_v: FloatArray) -> None:
        raise AssertionError("nothing to prime")

    def __call__(self, input_v: FloatArray) -> Sensed:
        n_force = self.force_n_per_v.shape[1]
        accel_v = input_v[:, n_force:-1] - self.accel_bias_v
        return Sensed(
            force_n=input_v[:, :n_force] @ self.force_n_per_v.T,
            accel_m_s2=accel_v @ self.accel_m_s2_per_v.T,
            voltage_v=input_v[:, -1] * self.monitor_gain,
        )


def conversion(config: NiConfig) -> LinearConversion:
    return LinearConversion(
        force_n_per_v=np.linalg.pinv(GAUGE_V_PER_N),
        accel_m_s2_per_v=np.eye(3) / ACCEL_V_PER_M_S2,
        monitor_gain=config.monitor_gain,
        accel_bias_v=ACCEL_BIAS_V,
    )


def input_volts(
    force_n: FloatArray, accel_m_s2: FloatArray, monitor_v: FloatArray
) -> FloatArray:
    """Return what the sensors put out; the inverse of `conversion`."""
    accel_v = ACCEL_BIAS_V + accel_m_s2 * ACCEL_V_PER_M_S2
    return np.vstack([GAUGE_V_PER_N @ force_n.T, accel_v.T, monitor_v])


def loop_back(output_v: FloatArray, first_sample: int) -> FloatArray:
    """Feed the output back to the monitor; each sample's force and acceleration are its own."""
    index = np.arange(first_sample, first_sample + output_v.size)
    force_n = 1e-4 * index[:, np.newaxis] * np.array([1.0, -1.0, 0.5])
    return input_volts(force_n, 10.0 * force_n, output_v)


def finger_of(config: SimulatedConfig) -> Finger:
    return config.finger.start(config.screen_mm, np.random.default_rng(config.seed))


def twin_plant(config: SimulatedConfig, amplifier_gain: float = 50.0) -> Plant:
    """Return a plant that is the physical model: amplifier, screen, finger and sensors."""
    with SimulatedRig(config):
        pass  # compiled now: the first call has a deadline
    twin, finger = make_twin(config), finger_of(config)
    states = twin.initial()

    def plant(output_v: FloatArray, first_sample: int) -> FloatArray:
        nonlocal states
        index = np.arange(first_sample, first_sample + output_v.size)
        motion = finger.at(index / config.sample_rate_hz)
        signals, states = twin.run(
            Signals.driven(
                config.sample_rate_hz,
                amplifier_gain * output_v,
                motion.position_mm,
                motion.velocity_mm_s,
                motion.normal_force_n,
                motion.in_contact,
            ),
            states,
        )
        return input_volts(signals.force_n, signals.accel_m_s2, output_v)

    return plant


class FingerTouch:
    """A touch sensor above a simulated finger."""

    finger_source = "touch"

    def __init__(self, config: SimulatedConfig) -> None:
        self.wrong: str | None = None
        self._config = config
        self.start()

    @property
    def latency_s(self) -> float:
        return self._config.touch.declared_s

    def start(self) -> None:
        self._finger = finger_of(self._config)
        self._sensor = TouchSensor(self._config.touch, self._config.sample_rate_hz)

    def arrived(self, first_sample: int, n_samples: int) -> tuple[TouchReport, ...]:
        index = np.arange(first_sample, first_sample + n_samples)
        motion = self._finger.at(index / self._config.sample_rate_hz)
        return self._sensor.step(first_sample, motion)

    def health(self) -> str | None:
        return self.wrong

    def stop(self) -> None:
        self.wrong = None


@dataclass(frozen=True)
class Bench:
    """One rig and all that it stands on."""

    rig: NiRig
    server: FakeServer
    touch: FingerTouch

    @property
    def device(self) -> FakeDevice:
        return self.server.device


BenchMaker = Callable[..., Bench]


def make_bench(
    stack: ExitStack,
    plant: Plant = loop_back,
    record: bool = False,
    bus: int = PCIE,
    **changes: object,
) -> Bench:
    """Return a bench whose rig is not open yet; the stack closes it."""
    server = stack.enter_context(FakeServer(FakeDevice(plant, record=record, bus=bus)))
    patience = {"deadline_s": 20.0}  # a busy machine shall not spoil a test
    config = wiring(address=server.address, **(patience | changes))
    touch = FingerTouch(SimulatedConfig(touch=TouchConfig()))
    return Bench(NiRig(config, conversion(config), touch), server, touch)

"""A block loop on a fake NI device whose clock passes by reads alone, turned by hand."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np
from tests.hardware.nidaq.bench import FingerTouch, LinearConversion, conversion, wiring
from tests.hardware.nidaq.bench import input_volts as volts
from tests.hardware.nidaq.fake_device import FakeDevice
from tests.hardware.nidaq.fake_server import FakeServer

from frictus.textures import Component, Region, Scene, Spectrum
from frictus_hardware import SimulatedConfig
from frictus_hardware.arrays import FloatArray
from frictus_hardware.base import TouchReport
from frictus_hardware.errors import SensorError
from frictus_hardware.nidaq.backend import NiRig
from frictus_hardware.nidaq.sensing import Sensed
from frictus_hardware.physics.friction import FrictionLaw
from frictus_hardware.simulated.strokes import SteadyStrokes
from frictus_service.config import Config
from frictus_service.daemon.block_loop.block_record import BlockRecord
from frictus_service.daemon.block_loop.lead import RetryingBackend
from frictus_service.daemon.block_loop.loop import BlockLoop
from frictus_service.daemon.control import Interlock
from frictus_service.daemon.inboxes import LoopInbox, SceneUpdate
from frictus_service.daemon.safety import Arm, Reset
from frictus_service.synthesis.compensability import placeholder_model, screen_of
from frictus_service.synthesis.scene import compile_scene

from .conftest import UTC_NS, Heartbeat, NoWaiting, orders_of

RATE_HZ = 20_000.0
BLOCK = 100
LAW = FrictionLaw()
TEXTURE = Scene(
    regions=[
        Region(texture=Spectrum(components=[Component(amplitude_n=0.08, cycles_per_mm=2.0)]))
    ]
)


@dataclass
class World:
    """What is wrong with it."""

    overloaded: bool = False
    monitor_gain: float = 1.0
    force_n: float = 0.4
    silent: bool = False

    def __call__(self, output_v: FloatArray, first_sample: int) -> FloatArray:
        force_n = np.tile([0.0, 0.0, self.force_n], (output_v.size, 1))
        return volts(force_n, np.zeros_like(force_n), self.monitor_gain * output_v)


@dataclass(frozen=True)
class Sensors:
    """The bench's, or overloaded."""

    world: World
    sound: LinearConversion
    delay_samples: int = 0
    tare_samples: int = 0

    def tare(self, input_v: FloatArray) -> None:
        raise AssertionError("no tare was asked for")

    def start(self, conversion_rate_hz: float) -> None:
        """Do nothing."""

    def prime(self, input_v: FloatArray) -> None:
        raise AssertionError("nothing to prime")

    def __call__(self, input_v: FloatArray) -> Sensed:
        if self.world.overloaded:
            raise SensorError("gauge 3 in 100 of 100 samples at the end of its output")
        return self.sound(input_v)


class Touch(FingerTouch):
    """A finger on the screen whose sensor may fall silent."""

    def __init__(self, world: World) -> None:
        super().__init__(SimulatedConfig(finger=SteadyStrokes(speed_mm_s=60.0)))
        self._world = world

    def arrived(self, first_sample: int, n_samples: int) -> tuple[TouchReport, ...]:
        reports = super().arrived(first_sample, n_samples)
        return () if self._world.silent else reports


@dataclass
class DeviceTime:
    """Time that passes with the device's samples, also over its restarts."""

    device: FakeDevice
    before: int = 0
    last: int = 0

    @property
    def sample(self) -> int:
        now = self.device.now
        if now < self.last:
            self.before += self.last
        self.last = now
        return self.before + now

    def __call__(self) -> int:
        return round(self.sample * 1e9 / RATE_HZ)


@dataclass
class Bench:
    server: FakeServer
    world: World
    loop: BlockLoop
    backend: RetryingBackend
    interlock: Interlock
    orders: LoopInbox
    time: DeviceTime
    seen: list[str] = field(default_factory=list)
    """Kinds of the faults that came up, since `forget`."""
    known: object = None

    @property
    def device(self) -> FakeDevice:
        return self.server.device

    def play(self, scene: Scene) -> None:
        """Give the loop a scene."""
        compiled = compile_scene(scene, LAW, screen_of(self.backend.info), RATE_HZ)
        self.orders.scene.append(SceneUpdate(compiled))

    def turn(self, blocks: int) -> list[BlockRecord]:
        """Turn the loop, which never raises, so often; return what it handed over."""
        turns = []
        for _ in range(blocks):
            self.loop.turn()
            while not self.loop.handover.empty():
                turns.append(self.loop.handover.get())
            if self.loop.parked:
                self.loop.wait_for_device(NoWaiting())
            fault = self.interlock.state.fault
            if fault is not None and fault != self.known:
                self.seen.append(fault[0])
        return turns

    def arm(self) -> None:
        """Arm, after a reset where it takes one, and see that the screen is driven."""
        if self.interlock.state.state == "tripped":
            assert self.interlock.feed(Reset(), 1e-9 * self.time()) is None
        self.turn(20)
        refused = self.interlock.feed(Arm("ann", 3_600.0), 1e-9 * self.time())
        assert refused is None, refused
        self.turn(150)  # contact and speed become known, the ramp in passes
        assert np.any(self.device.played_v[-2_000:]), self.interlock.state

    def forget(self) -> None:
        """Look only at what comes up from now on; the status keeps the last fault."""
        self.known = self.interlock.state.fault
        self.seen.clear()


@contextmanager
def running(**wired: object) -> Iterator[Bench]:
    world = World()
    with FakeServer(FakeDevice(world, record=True)) as server:
        config = wiring(address=server.address, deadline_s=20.0, **wired)
        rig = NiRig(config, Sensors(world, conversion(config)), Touch(world))
        time = DeviceTime(server.device)
        backend = RetryingBackend(rig, time)
        interlock, orders = Interlock(), orders_of(placeholder_model())
        settings = Config(backend=SimulatedConfig(clock="virtual"))
        rig.open()
        try:
            loop = BlockLoop(
                backend,
                settings,
                interlock,
                orders,
                Heartbeat(),
                7,
                time,
                lambda: UTC_NS + time(),
            )
            bench = Bench(server, world, loop, backend, interlock, orders, time)
            bench.play(TEXTURE)
            yield bench
        finally:
            server.servicer.faults.clear()
            rig.close()

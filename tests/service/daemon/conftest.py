"""A rig's loop on a virtual clock, as the tests of the daemon turn it by hand."""

import threading
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import pytest
from numpy.typing import NDArray

from frictus.model import Model
from frictus.textures import Component, Region, Scene, Spectrum
from frictus_hardware import SimulatedConfig
from frictus_hardware.physics.friction import FrictionLaw
from frictus_hardware.physics.screen import Screen
from frictus_hardware.simulated.clock import VirtualClock
from frictus_hardware.simulated.rig import SimulatedRig
from frictus_hardware.simulated.strokes import SteadyStrokes
from frictus_service.config import Config, Limits
from frictus_service.daemon.block_loop.block_record import BlockRecord
from frictus_service.daemon.block_loop.lead import RetryingBackend
from frictus_service.daemon.block_loop.loop import BlockLoop
from frictus_service.daemon.control import Interlock
from frictus_service.daemon.inboxes import LoopInbox, ModelSlot, SceneUpdate
from frictus_service.daemon.model_controller import rendered_model
from frictus_service.daemon.safety import Arm, Event
from frictus_service.synthesis.compensability import placeholder_model
from frictus_service.synthesis.scene import compile_scene

from .desk import Desk

UTC_NS = 1_795_000_000_000_000_000


def orders_of(model: Model) -> LoopInbox:
    return LoopInbox(ModelSlot(rendered_model(model, Screen())))


class NoWaiting(threading.Event):
    """An event whose wait lets no time pass."""

    def wait(self, timeout: float | None = None) -> bool:
        return self.is_set()


@dataclass
class Heartbeat:
    value: int = 0


@dataclass
class Bench:
    """A loop with all that it needs; time is what the device's clock says."""

    config: Config
    rig: SimulatedRig
    clock: VirtualClock
    interlock: Interlock
    orders: LoopInbox
    loop: BlockLoop
    heartbeat: Heartbeat
    delay_ns: int = 0
    turns: list[BlockRecord] = field(default_factory=list)

    @property
    def rate_hz(self) -> float:
        return self.config.sample_rate_hz

    @property
    def now_s(self) -> float:
        return self.clock.sample() / self.rig.info.clock_hz + 1e-9 * self.delay_ns

    def feed(self, event: Event) -> None:
        refused = self.interlock.feed(event, self.now_s)
        assert refused is None, refused

    def arm(self, lease_s: float = 10.0) -> None:
        self.feed(Arm("ann", lease_s))

    def play(self, scene: Scene) -> None:
        compiled = compile_scene(scene, FrictionLaw(), self.rig.config.screen, self.rate_hz)
        self.orders.scene.append(SceneUpdate(compiled))

    def turn(self, seconds: float) -> list[BlockRecord]:
        """Turn the loop for so long and return what it handed over meanwhile."""
        until = self.loop.tally.blocks + round(seconds * self.rate_hz / 100)
        stop = NoWaiting()
        taken = []
        for _ in range(10 * until):
            if self.loop.tally.blocks >= until:
                break
            self.loop.turn()
            if self.loop.parked:
                self.loop.wait_for_device(stop)
            while not self.loop.handover.empty():
                taken.append(self.loop.handover.get())
        self.turns += taken
        return taken

    def voltage_v(self) -> NDArray[np.float64]:
        """What the screen got since the beginning, by device sample."""
        run = self.turns[-1].run
        return np.concatenate(
            [turn.exchange.voltage_v for turn in self.turns if turn.run == run]
        )

    def last_output_s(self) -> float:
        """Device time of the last sample that was not zero."""
        (driven,) = np.nonzero(self.voltage_v())
        return float(driven[-1] + 1) / self.rate_hz if driven.size else 0.0


MakeBench = Callable[..., Bench]


@pytest.fixture
def texture() -> Scene:
    component = Component(amplitude_n=0.08, cycles_per_mm=2.0)
    return Scene(regions=[Region(texture=Spectrum(components=[component]))])


def build_bench(limits: Limits | None = None, **rig_settings: object) -> Bench:
    """Build a bench; keyword arguments go to the simulated rig, or replace limits."""
    simulated = SimulatedConfig.model_validate(
        {"clock": "virtual", "finger": SteadyStrokes(), **rig_settings}
    )
    config = Config(backend=simulated, limits=limits or Limits())
    clock = VirtualClock()
    rig = SimulatedRig(simulated, clock=clock)
    rig.open()
    interlock, orders, heartbeat = Interlock(), orders_of(placeholder_model()), Heartbeat()
    bench: Bench

    def monotonic_ns() -> int:
        return round(clock.sample() * 1e9 / rig.info.clock_hz) + bench.delay_ns

    backend = RetryingBackend(rig, monotonic_ns)
    bench = Bench(config, rig, clock, interlock, orders, None, heartbeat)  # type: ignore[arg-type]
    bench.loop = BlockLoop(
        backend,
        config,
        interlock,
        orders,
        heartbeat,
        7,
        monotonic_ns,
        lambda: UTC_NS + monotonic_ns(),
    )
    return bench


@pytest.fixture
def make_bench() -> MakeBench:
    return build_bench


@pytest.fixture
def desk() -> Desk:
    return Desk()

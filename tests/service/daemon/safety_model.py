"""Every reachable state of a rig's safety, visited: the real loop, interlock, renderer and
output queue on the smallest device, whose lead and ramp are as short as a block.

An oracle beside it knows who holds the rig, until when, whether a finger was reported and
whether all sensors are well, from what was asked and answered alone. Two states are the same if
what follows from both is: clocks and counters are taken relative to now.
"""

import copy
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final
from unittest.mock import patch

import numpy as np
from numpy.typing import NDArray

from frictus.messages import Excitation
from frictus_hardware import SimulatedConfig
from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.screen import Screen
from frictus_service.config import Config, Limits
from frictus_service.daemon.block_loop.loop import BlockLoop
from frictus_service.daemon.control import Interlock
from frictus_service.daemon.inboxes import ModelSlot, ModelUpdate, RenderedModel, SceneUpdate
from frictus_service.daemon.model_controller import rendered_model
from frictus_service.daemon.safety import Arm, ClientVanished, Disarm, Renew, Reset, Stop
from frictus_service.synthesis.compensability import placeholder_model
from frictus_service.synthesis.renderer import RAMP_S
from frictus_service.synthesis.scene import compile_excitation

from .conftest import Heartbeat, orders_of
from .safety_device import RATE_HZ, Device, OneTry, Punctuality
from .safety_events import (
    ADAPT,
    CLIENTS,
    EVENTS,
    FINGER,
    HEALTH,
    MEANWHILE,
    TRIPPING,
)

LEASE_BLOCKS: Final = 3
STALE_MS: Final = 40
CONFIG: Final = Config(
    backend=SimulatedConfig(clock="virtual"),
    limits=Limits(finger_stale_ms=STALE_MS, missed_deadlines=1),
)


@dataclass
class Rights:
    """What the oracle knows: since when, in samples, each condition of output does not hold.

    Attributes
    ----------
    lost : dict
        Cause and sample by condition: `owner`, `contact`, `sensors`.
    """

    owner: str | None = None
    keeps_model: bool = False
    lease_until: int = 0
    tripped: bool = False
    lost: dict[str, tuple[str, int]] = field(
        default_factory=lambda: {"owner": ("never armed", 0), "contact": ("no finger yet", 0)}
    )

    def lose(self, condition: str, cause: str, sample: int) -> None:
        if condition == "owner":
            self.owner = None
            self.keeps_model = False
        self.lost.setdefault(condition, (cause, sample))


class World:
    """A rig in one of its states.

    Parameters
    ----------
    block_samples : int
        A block is also the lead; the ramp takes 20 samples.
    """

    def __init__(self, block_samples: int = 20) -> None:
        self.device = Device(block_samples)
        self.interlock = Interlock()
        self.orders = orders_of(placeholder_model())
        law = self.orders.model.in_force.inverse.law
        steady = compile_excitation(Excitation(bias=0.25), law, RATE_HZ)
        self.orders.scene.append(SceneUpdate(steady))
        config = CONFIG.model_copy(
            update={
                "backend": SimulatedConfig(clock="virtual", sample_rate_hz=RATE_HZ),
                "block_ms": 1e3 * block_samples / RATE_HZ,
            }
        )
        self.loop = BlockLoop(
            self.device,
            config,
            self.interlock,
            self.orders,
            Heartbeat(),
            1,
            self.device.monotonic_ns,
            self.device.monotonic_ns,
        )
        self.loop.lateness = Punctuality(self.device)  # type: ignore[assignment]
        self.rights = Rights()
        self.ended = False
        self.last_v = 0.0
        self.wrong: list[str] = []
        self.zero_after: dict[str, int] = {}
        self.models = (self.orders.model.in_force, _another_model())
        self.played = (steady, compile_excitation(Excitation(bias=0.1), law, RATE_HZ))
        self._shared = (
            config,
            self.models,
            *self.models,
            *(model.inverse for model in self.models),
            self.played,
            *self.played,
            self.device.info,
            self.loop.handover,
            self.interlock._lock,
        )

    def copy(self) -> "World":
        memo: dict[int, Any] = {id(each): each for each in self._shared}
        memo[id(self.orders.model)] = ModelSlot(self.orders.model.in_force)  # none waits
        return copy.deepcopy(self, memo)

    @property
    def sample(self) -> int:
        """Samples since the beginning, openings of the device included."""
        return self.device.began + self.device.now

    def after(self, event: str) -> "World":
        """Return the rig one block after an event."""
        world = self.copy()
        world._step(event)
        return world

    def _step(self, event: str) -> None:
        device, loop = self.device, self.loop
        self.zero_after = {}
        began, played = self.sample, device.voltage_v.size
        self._pass_time()
        if event in CLIENTS:
            self._ask(event)
        elif event.endswith(MEANWHILE):
            device.meanwhile = lambda: self._ask(event.removesuffix(MEANWHILE))
        elif event in FINGER:
            device.finger = event
        elif event in HEALTH:
            device.wrong = event if event == "sensor lost" else None
        device.happens = event
        order, kept = self._offer() if event == ADAPT else None, self.rights.keeps_model
        mismatch = self._mismatch()
        if loop.parked:
            loop.wait_for_device(OneTry())
            device.voltage_v = np.zeros(0)
        else:
            try:
                loop.turn()
            except ZeroDivisionError:  # the second in a row ends the process
                device.close()
                self.ended = True
            self._note_causes(event, began, mismatch)
            self._judge(began, device.voltage_v[played:])
        if order is not None and order.done.is_set() and kept:
            self.wrong.append("the model changed though its owner keeps it")
        elif order is not None and not order.done.is_set() and not (kept or loop.parked):
            self.wrong.append("the model did not change though nobody keeps it")
        if order is not None:
            self.orders.model.withdraw(order)
        device.meanwhile, device.happens = None, "nothing"
        device.voltage_v = np.zeros(0)
        while not loop.handover.empty():
            loop.handover.get()
        if device.refused:
            self.wrong.append("the device was asked for output while it was disarmed")
        if device.armed and not loop._energised:
            self.wrong.append("the device is armed, and the loop does not know")

    def _offer(self) -> ModelUpdate:
        """Have the loop adapt the model, which here lowers the drive, or raises it again."""
        now = self.orders.model.in_force is self.models[1]
        order = ModelUpdate(self.models[not now], self.played[not now], fades=True)  # type: ignore[arg-type]
        self.orders.model.offer(order)
        return order

    def _ask(self, name: str) -> None:
        rights, now = self.rights, self.sample
        event, lease = CLIENTS[name], LEASE_BLOCKS * self.device.block_samples
        if isinstance(event, Arm):
            event = replace(event, lease_s=lease / RATE_HZ)
        held = rights.owner
        refused = self.interlock.feed(event, now / RATE_HZ) is not None
        match event:
            case Arm() if not refused:
                if rights.tripped or held not in (None, event.client):
                    self.wrong.append(f"{name} was granted though tripped or held by {held}")
                rights.owner, rights.lease_until = event.client, now + lease
                rights.keeps_model = event.keep_model
                rights.lost.pop("owner", None)
            case Renew() if not refused:
                if held != event.client:
                    self.wrong.append(f"{name} was granted though held by {held}")
                rights.lease_until = now + lease
            case Stop():
                rights.lose("owner", "stop", now)
            case Disarm() if held == event.client:
                rights.lose("owner", "disarm", now)
            case ClientVanished() if held == event.client:
                rights.lose("owner", "owner vanished", now)
            case Reset() if not refused:
                rights.tripped = False

    def _pass_time(self) -> None:
        rights = self.rights
        if rights.owner is not None and self.sample >= rights.lease_until:
            rights.lose("owner", "lease over", rights.lease_until)

    def _note_causes(self, event: str, now: int, mismatch: bool) -> None:
        rights, loop = self.rights, self.loop
        if event == "overrun":  # the loop had no part in the time that was lost
            rights.lost = {
                condition: (cause, since + self.device.block_samples)
                for condition, (cause, since) in rights.lost.items()
            }
        noticed = {
            "deadline": loop._energised,  # late blocks of zeros are only counted
            # What a ramp of the device makes of the drive is not known.
            "monitor mismatch": mismatch and now - self.device.began >= loop._zero_from,
        }
        if (event in TRIPPING or event == "link_lost") and noticed.get(event, True):
            rights.lose("owner", event, now)
            rights.tripped |= event != "link_lost"
        if event in ("sensor", "sensor lost"):
            rights.lose("sensors", event, now)

    def _mismatch(self) -> bool:
        """Return whether a monitor at half of what plays is beyond its tolerance."""
        now, n = self.device.now, self.device.block_samples
        if np.any(self._unknown(n)):
            return False
        rms_v = np.sqrt(np.square(self.device.queue.read(now, n)).mean())
        return bool(0.5 * rms_v > CONFIG.limits.monitor_tolerance_v)

    def _unknown(self, n_samples: int) -> NDArray[np.bool_]:
        return np.isnan(self.loop._checks._monitor._told_v.read(self.device.now, n_samples))

    def _judge(self, began: int, volts: FloatArray) -> None:
        device, rights, loop = self.device, self.rights, self.loop
        played = np.flatnonzero(volts)
        n = device.block_samples
        bounds = {
            "owner": n + round(RAMP_S * RATE_HZ),
            "contact": n + device.info.lead_samples + round(RAMP_S * RATE_HZ),
        }
        bounds["sensors"] = bounds["contact"]
        for condition, (cause, since) in rights.lost.items():
            if not played.size:
                continue
            lasted = began + int(played[-1]) + 1 - since
            self.zero_after[cause] = max(lasted, 0)
            if lasted > bounds[condition]:
                self.wrong.append(f"output {lasted} ms after {cause}")
        rises = np.diff(volts, prepend=self.last_v)
        # The drive's square root is steepest at zero: sqrt(3) of a straight ramp.
        steepest = 1.8 * 0.5 * device.info.screen_peak_v / round(RAMP_S * RATE_HZ)
        if np.max(rises, initial=0.0) > steepest:
            self.wrong.append(f"a step of {np.max(rises):.1f} V")
        self.last_v = float(volts[-1]) if volts.size else self.last_v
        self._look_at_finger()
        if (
            loop._checks.sensor_lost is False
            and device.wrong is None
            and not self._sensor_lasts()
        ):
            rights.lost.pop("sensors", None)
        if loop.parked:
            self.last_v = 0.0

    def _sensor_lasts(self) -> bool:
        return any(kind == "sensor" for kind, _ in self.interlock.state.lasting)

    def _look_at_finger(self) -> None:
        device, rights, now = self.device, self.rights, self.sample
        if device.finger == "finger back":
            rights.lost.pop("contact", None)
        elif device.finger == "finger lifted":
            rights.lose("contact", "finger lifted", now - 1)
        elif self.loop.rendering.estimator.stale(device.now):
            last = self.loop.rendering.estimator.report_age_s(device.now)
            age = round(last * RATE_HZ) if np.isfinite(last) else STALE_MS
            rights.lose("contact", "finger stale", now - age + STALE_MS)

    def key(self) -> tuple[object, ...]:
        """Return what decides on all that follows."""
        safety, loop, device = self.interlock.state, self.loop, self.device
        rights, queue, now = self.rights, self.device.queue, self.device.now
        armed = safety.state == "armed"
        age = loop.rendering.estimator.report_age_s(now) * RATE_HZ
        return (
            safety.state,
            safety.owner,
            round(1e3 * safety.lease_until_s) - self.sample if armed else None,
            frozenset(kind for kind, _ in safety.lasting),
            safety.device_ready,
            safety.armings == loop._arming,
            loop._energised,
            max(loop._zero_from - loop._sensed_end(), 0) if not loop.parked else 0,
            loop._parked,
            loop._checks.sensor_lost,
            loop._broken,
            loop.rendering.chain.renderer._level,
            loop.rendering.chain.renderer._share,
            self.orders.model.in_force is self.models[1],
            safety.keep_model,
            loop.rendering.estimator.in_contact,
            min(age, 2.0 * STALE_MS),
            self._unknown(2 * device.block_samples).tobytes(),
            device.armed,
            device.finger,
            device.wrong,
            min(queue._returned, queue._return_samples),
            np.round(queue.read(now, 2 * device.block_samples), 6).tobytes(),
            round(self.last_v, 6),
            rights.owner,
            rights.lease_until - self.sample if rights.owner is not None else None,
            rights.tripped,
            tuple(
                sorted(
                    (condition, min(self.sample - since, 5 * device.block_samples))
                    for condition, (_, since) in rights.lost.items()
                )
            ),
        )


def _another_model() -> RenderedModel:
    """Return a model that asks for another drive."""
    model = placeholder_model()
    base = model.base.model_copy(update={"gain_n": 0.5})
    return rendered_model(model.model_copy(update={"base": base}), Screen())


@dataclass(frozen=True)
class Found:
    """What a search has come upon.

    Attributes
    ----------
    states, transitions : int
    complete : bool
        Whether every reachable state was visited.
    wrong : list
        Path of events and what was wrong at its end.
    zero_after_ms : dict
        Longest time from each cause to the last output.
    """

    states: int
    transitions: int
    complete: bool
    wrong: list[tuple[tuple[str, ...], str]]
    zero_after_ms: dict[str, int]


def search(
    events: Sequence[str] = EVENTS, block_samples: int = 20, most_states: int = 1_000_000
) -> Found:
    """Visit the states that events lead to in any order, nearest first."""
    with (
        patch("frictus_service.daemon.block_loop.loop.HEALTH_BLOCKS", 1),
        patch("frictus_service.daemon.block_loop.block_checks.RING_SAMPLES", 1 << 9),
    ):
        first = World(block_samples)
        paths: dict[tuple[object, ...], tuple[str, ...]] = {first.key(): ()}
        queue = deque([first])
        transitions, wrong, slowest = 0, [], dict[str, int]()
        while queue and len(paths) < most_states:
            world = queue.popleft()
            path = paths[world.key()]
            for event in events:
                after = world.after(event)
                transitions += 1
                for cause, lasted in after.zero_after.items():
                    slowest[cause] = max(slowest.get(cause, 0), lasted)
                if after.wrong:
                    wrong.append(((*path, event), after.wrong[0]))
                    continue
                key = after.key()
                if not after.ended and key not in paths:
                    paths[key] = (*path, event)
                    queue.append(after)
        return Found(len(paths), transitions, not queue, wrong, slowest)

"""A rig's commands without a network, as the tests of the daemon send them."""

import json
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from frictus.messages import Reply
from frictus.model import Model
from frictus.stream import StreamFrame
from frictus_hardware.physics.screen import Screen
from frictus_service.config import Limits
from frictus_service.daemon.commands import RENDERING_CALLS, Commands
from frictus_service.daemon.control import Control, Interlock
from frictus_service.daemon.inboxes import IncomingCommand, LoopInbox, ModelSlot, ModelUpdate
from frictus_service.daemon.model_controller import ModelController, rendered_model
from frictus_service.daemon.safety import Safety
from frictus_service.daemon.scene_controller import SceneController
from frictus_service.synthesis.compensability import placeholder_model

UTC_NS = 1_795_000_000_000_000_000
WAVE = (0.05 * np.sin(2.0 * np.pi * np.arange(64) / 64.0)).astype(np.float32)
TEXTURE = {"kind": "spectrum", "components": [{"amplitude_n": 0.05, "cycles_per_mm": 1.0}]}
SCENE = {"regions": [{"texture": TEXTURE}]}


class Obeyed(ModelSlot):
    """A slot whose orders are in force at once, as with a loop that turns."""

    def offer(self, order: ModelUpdate) -> None:
        super().offer(order)
        self.take(Safety(), energised=False)
        order.done.set()


class TakenAtTheLastMoment(ModelSlot):
    """A slot whose orders the loop takes just before they would be withdrawn."""

    def withdraw(self, order: ModelUpdate) -> bool:
        self.take(Safety(), energised=False)
        order.done.set()
        return super().withdraw(order)


@dataclass
class Info:
    finger_source: str
    finger_takeover: bool = False


class NoFinger:
    """A backend without a virtual finger."""

    info = Info("touch")


class Finger:
    """A backend whose virtual finger clients move."""

    def __init__(self, info: Info | None = None) -> None:
        self.info = info or Info("pointer")
        self.moves: list[tuple[float, float, bool, float]] = []

    def move_finger(
        self, x_mm: float, y_mm: float, in_contact: bool, normal_force_n: float
    ) -> None:
        self.moves.append((x_mm, y_mm, in_contact, normal_force_n))


@dataclass
class Desk:
    """Commands without a network; both clocks are set by hand."""

    limits: Limits = field(default_factory=Limits)
    backend: Any = field(default_factory=NoFinger)
    now_s: float = 100.0
    slot: type[ModelSlot] = Obeyed

    def __post_init__(self) -> None:
        self.interlock = Interlock()
        self.orders = LoopInbox(self.slot(rendered_model(placeholder_model(), Screen())))
        self.stage = SceneController(
            Screen(),
            20_000.0,
            self.interlock,
            self.orders,
            lambda: self.now_s,
        )
        self.said: list[str] = []
        self.models = ModelController(
            Screen(),
            self.interlock,
            self.orders,
            self.stage,
            lambda: self.now_s,
            say=self.said.append,
        )
        control = Control(self.interlock, self.backend, self.limits, lambda: self.now_s)
        self.commands = Commands(
            control, self.stage, self.models, self.interlock, self.limits, lambda: self.utc_ns
        )
        for client in ("ann", "ben", "cid", "owner"):
            self.commands.presence.on_token(client, True)

    @property
    def utc_ns(self) -> int:
        return UTC_NS + round(1e9 * self.now_s)

    def send(self, name: str, payload: bytes) -> Reply:
        renders = name in RENDERING_CALLS or name == "texture"
        decide = self.commands.render if renders else self.commands.keep_safe
        return decide(IncomingCommand(name, payload))

    def call(self, name: str, client: str = "ann", **fields: Any) -> Reply:
        request = {"client": client, "utc_ns": self.utc_ns, **fields}
        return self.send(name, json.dumps(request).encode())

    def frame(self, ticket: int, sequence: int = 0, **fields: Any) -> bytes:
        frame = StreamFrame(ticket, sequence, self.utc_ns, 200, 1.0, True, 0.0, WAVE)
        values = {name: getattr(frame, name) for name in StreamFrame.__slots__}
        return StreamFrame(**{**values, **fields}).pack()

    def streaming(self) -> int:
        assert self.call("arm").ok
        ticket = self.call("open_stream", peak_n=0.06).ticket
        assert ticket is not None
        return ticket


def scaled(model: Model, gain: float = 1.0, cutoff: float = 1.0, **changes: Any) -> Model:
    """A model whose gain and cutoffs are so many times another's."""
    base = model.base.model_copy(
        update={
            "gain_n": gain * model.base.gain_n,  # type: ignore[union-attr]
            "cutoff_0_hz": cutoff * model.base.cutoff_0_hz,  # type: ignore[union-attr]
            "slope_hz_per_mm_s": cutoff * model.base.slope_hz_per_mm_s,  # type: ignore[union-attr]
        }
    )
    return model.model_copy(update={"base": base, **changes})

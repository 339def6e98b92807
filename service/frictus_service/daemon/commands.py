"""Commands from the network: callbacks enqueue, two threads decide and answer.

What makes the output safe (stop, disarm, leases) has a thread of its own, so that it never
waits for a scene to be compiled. Whatever is refused is counted, and answered where it was a
call; no payload can do more harm than that.
"""

import contextlib
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import TracebackType
from typing import Any, Final, Self

import zenoh
from zenoh.handlers import Callback

from frictus.errors import RefusedError
from frictus.keys import CALLS, RigKeys, Topics
from frictus.messages import (
    MESSAGES,
    LeaseRenewal,
    PointerState,
    RefusalCode,
    Reply,
    Request,
)
from frictus_service.config import Limits
from frictus_service.daemon.control import Control
from frictus_service.daemon.gate import Gate
from frictus_service.daemon.interlock import Interlock
from frictus_service.daemon.mailbox import Mailbox
from frictus_service.daemon.stage import Stage

URGENT: Final = {
    "stop": 8,
    "vanished": 16,
    "lease": 16,
    "pointer": 1,
    "guidance": 1,
    "call": 32,
}
"""Boxes of the thread that keeps the rig safe, most urgent first."""
RENDERING: Final = {"texture": 1, "call": 16}
"""Boxes of the thread that compiles; of texture updates the newest wins."""
RENDERING_CALLS: Final = ("scene", "open_stream", "close_stream", "excite", "model")


@dataclass(frozen=True, slots=True)
class Message:
    """A payload with the call it is to answer, if it is one."""

    name: str
    payload: bytes
    query: zenoh.Query | None = None
    key: str = ""
    """Of the call; a query may have asked under a wildcard, a reply must not."""

    def answer(self, reply: Reply) -> None:
        """Send the reply."""
        if self.query is None:
            return
        # Whoever asked may be gone; that must not end the thread that keeps the rig safe.
        with contextlib.suppress(Exception), self.query:
            self.query.reply(
                self.key,
                reply.to_json(),
                encoding=zenoh.Encoding.APPLICATION_JSON,
            )


class Commands:
    """Serves a rig's calls and command topics while it is entered.

    Parameters
    ----------
    control : Control
    stage : Stage
    interlock : Interlock
    limits : Limits
    utc_ns : callable
        UTC, ns.
    """

    def __init__(
        self,
        control: Control,
        stage: Stage,
        interlock: Interlock,
        limits: Limits,
        utc_ns: Callable[[], int] = time.time_ns,
    ) -> None:
        self._control = control
        self._stage = stage
        self._interlock = interlock
        self._limits = limits
        self._gate = Gate(limits)
        self._utc_ns = utc_ns
        self._urgent: Mailbox[Message] = Mailbox(URGENT)
        self._rendering: Mailbox[Message] = Mailbox(RENDERING)
        self._declared: list[Any] = []
        self._threads: list[threading.Thread] = []
        self._refused = 0
        self._refused_rendering = 0
        self.updates_expired = 0

    @property
    def refused(self) -> int:
        """Commands refused so far, those that full boxes lost included."""
        lost = (self._urgent.lost, self._rendering.lost)
        overrun = sum(count for box in lost for name, count in box.items() if name == "call")
        return self._refused + self._refused_rendering + overrun

    @property
    def updates_lost(self) -> int:
        """Texture updates that gave way to a newer one before they were looked at."""
        return self._rendering.lost["texture"]

    def declare(self, session: zenoh.Session, keys: RigKeys) -> None:
        """Declare what listens, and start the threads.

        Parameters
        ----------
        session : zenoh.Session
            Outlives this.
        keys : RigKeys
        """
        for name in CALLS:
            key = keys.call(name)
            post = Callback(self._poster_of_call(name, key), indirect=False)
            self._declared.append(session.declare_queryable(key, post, complete=True))
        listeners: dict[str, tuple[Mailbox[Message], str]] = {
            keys.of(Topics.TEXTURE): (self._rendering, "texture"),
            keys.of(Topics.LEASE): (self._urgent, "lease"),
            keys.of(Topics.POINTER): (self._urgent, "pointer"),
        }
        if self._control.follows_guidance:
            listeners[keys.of(Topics.GUIDANCE)] = (self._urgent, "guidance")
        for key, (mailbox, box) in listeners.items():
            self._declared.append(
                session.declare_subscriber(
                    key, Callback(_poster_of_topic(mailbox, box), indirect=False)
                )
            )
        self._declared.append(
            session.liveliness().declare_subscriber(
                keys.any_client_alive, Callback(self._on_token, indirect=False)
            )
        )

    def _poster_of_call(self, name: str, key: str) -> Callable[[zenoh.Query], None]:
        mailbox = self._rendering if name in RENDERING_CALLS else self._urgent
        box = "stop" if name == "stop" else "call"

        def post(query: zenoh.Query) -> None:
            payload = query.payload.to_bytes() if query.payload else b""
            mailbox.post(box, Message(name, payload, query, key))

        return post

    def _on_token(self, sample: zenoh.Sample) -> None:
        if sample.kind == zenoh.SampleKind.DELETE:
            client = str(sample.key_expr).rsplit("/", 1)[1]
            self._urgent.post("vanished", Message("vanished", client.encode()))

    def serve_urgent(self) -> None:
        """Work through the urgent boxes until closed."""
        while (taken := self._urgent.take()) is not None:
            message = taken[1]
            reply = self.keep_safe(message)
            self._refused += not reply.ok
            message.answer(reply)

    def serve_rendering(self) -> None:
        """Work through what has to be compiled until closed."""
        while (taken := self._rendering.take()) is not None:
            message = taken[1]
            reply = self.render(message)
            self._refused_rendering += not reply.ok
            message.answer(reply)

    def keep_safe(self, message: Message) -> Reply:
        """Decide on an urgent message."""
        if message.name == "stop":
            # Whatever it carries and however old it is: a stop always stops.
            return self._answered(lambda: self._control.stop("anyone"))
        if message.name == "vanished":
            return self._answered(lambda: self._done(self._control.vanish, message))
        if message.name == "guidance":
            return self._answered(lambda: self._guide(message.payload))
        handlers: Mapping[str, tuple[type[Request], Callable[[Any], Reply | None]]] = {
            "arm": (MESSAGES["ArmRequest"], self._control.arm),  # type: ignore[dict-item]
            "disarm": (Request, self._control.disarm),
            "reset": (Request, self._control.reset),
            "lease": (LeaseRenewal, self._control.renew),
            "pointer": (PointerState, self._control.point),
        }
        kind, handle = handlers[message.name]
        return self._answered(lambda: handle(self._read(kind, message)))

    def render(self, message: Message) -> Reply:
        """Decide on a message that concerns what is rendered."""
        if message.name == "texture":
            return self._answered(lambda: self._update(message.payload))
        kind = MESSAGES[CALLS[message.name]]
        handlers: Mapping[str, Callable[[Any], Reply]] = {
            "scene": self._stage.set_scene,
            "open_stream": self._stage.open_stream,
            "close_stream": self._stage.close_stream,
            "excite": self._stage.excite,
            "model": self._stage.set_model,
        }
        handle = handlers[message.name]
        return self._answered(lambda: handle(self._read(kind, message)))

    def _update(self, payload: bytes) -> None:
        try:
            frame, good_for_s = self._gate.read_frame(payload, self._utc_ns())
        except RefusedError as error:
            self.updates_expired += error.code == "stale"
            raise
        self._stage.update(frame, good_for_s)

    def _guide(self, payload: bytes) -> None:
        self._control.guide(self._gate.read_guidance(payload, self._utc_ns()))

    def _read(self, kind: Any, message: Message) -> Any:
        limits = self._limits
        scene = message.name == "scene"
        most = limits.max_scene_bytes if scene else limits.max_payload_bytes
        return self._gate.read(kind, message.payload, self._utc_ns(), most)

    def _answered(self, handle: Callable[[], Reply | None]) -> Reply:
        """Return what the handler says, with the state after it; refusals become replies."""
        try:
            reply = handle() or Reply(ok=True)
        except RefusedError as error:
            code: RefusalCode = error.code  # type: ignore[assignment]
            reply = Reply(ok=False, code=code, message=str(error))
        except Exception as error:  # a command must never end this thread
            reply = Reply(
                ok=False,
                code="not_feasible",
                message=f"the rig failed on it: {type(error).__name__}: {error}",
            )
        return reply.model_copy(update={"state": self._interlock.state.state})

    def _done(self, handle: Callable[[str], None], message: Message) -> None:
        handle(message.payload.decode())

    def __enter__(self) -> Self:
        """Start the threads."""
        self._threads = [
            threading.Thread(target=self.serve_urgent, name="frictus-control", daemon=True),
            threading.Thread(target=self.serve_rendering, name="frictus-stage", daemon=True),
        ]
        for thread in self._threads:
            thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Stop listening and end the threads."""
        for declared in self._declared:
            declared.undeclare()
        self._declared.clear()
        self._urgent.close()
        self._rendering.close()
        for thread in self._threads:
            thread.join()


def _poster_of_topic(mailbox: Mailbox[Message], box: str) -> Callable[[zenoh.Sample], None]:
    def post(sample: zenoh.Sample) -> None:
        mailbox.post(box, Message(box, sample.payload.to_bytes()))

    return post

"""Commands from the network: what makes the output safe is decided in the callback itself.

Stop, disarm, arming, leases and fallen tokens are one short step of the safety machine each:
they wait in no box, so that nobody else's burst can push one out. Whatever has to be compiled,
and every answer, waits for a thread, each sender's in turn. Whatever is refused is counted,
and answered where it was a call; no payload can do more harm than that.
"""

import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, Final, Self

import zenoh
from zenoh.handlers import Callback

from frictus.errors import FrameError, RefusedError
from frictus.keys import CALLS, RigKeys, Topics
from frictus.messages import (
    MESSAGES,
    ArmRequest,
    LastCall,
    LeaseRenewal,
    PointerState,
    RefusalCode,
    Reply,
    Request,
)
from frictus.names import MAX_NAME, name_in
from frictus.stream import ticket_of
from frictus_service.command_validation import CommandValidator
from frictus_service.config import Limits
from frictus_service.daemon.control import ClientPresence, Control, Interlock
from frictus_service.daemon.inboxes import CommandQueue, IncomingCommand
from frictus_service.daemon.last_calls import LastCalls
from frictus_service.daemon.model_controller import ModelController
from frictus_service.daemon.scene_controller import SceneController

ANSWERING: Final = {"pointer": 1, "guidance": 1, "answer": 64}
"""Boxes of the thread that moves virtual fingers and answers, by the sender."""
RENDERING: Final = {"texture": 1, "call": 16}
"""Boxes of the thread that compiles; of texture updates the newest wins."""
OWNERS_CALLS: Final = (
    "scene",
    "open_stream",
    "close_stream",
    "excite",
    "compensation",
    "model",
)
RENDERING_CALLS: Final = (*OWNERS_CALLS, "adaptation", "adapt")
UNNAMED_BYTES: Final = 64_000
"""Of a call whose attachment names nobody: to tell who sent it, all of it has to be read."""
OVERRUN: Final = Reply(
    ok=False, code="unavailable", message="newer calls of the same sender took its place"
)


class Commands:
    """Serves a rig's calls and command topics while it is entered.

    Parameters
    ----------
    control : Control
        Answers what concerns ownership.
    stage : SceneController
        What is rendered.
    models : ModelController
        With which model.
    interlock : Interlock
        Holds the safety state.
    limits : Limits
        Of what a rig accepts.
    utc_ns : callable
        UTC, ns.
    """

    def __init__(
        self,
        control: Control,
        stage: SceneController,
        models: ModelController,
        interlock: Interlock,
        limits: Limits,
        utc_ns: Callable[[], int] = time.time_ns,
    ) -> None:
        self._control = control
        self._stage = stage
        self._models = models
        self._interlock = interlock
        self._gate = CommandValidator(limits)
        self._utc_ns = utc_ns
        self.presence = ClientPresence(control.vanish)
        """Of those who may arm."""
        self._answering: CommandQueue[IncomingCommand] = CommandQueue(ANSWERING)
        self._rendering: CommandQueue[IncomingCommand] = CommandQueue(RENDERING)
        self._newest_scene: dict[str, IncomingCommand] = {}
        """Of each sender, as long as it waits or is compiled."""
        self._declared: list[Any] = []
        self._threads: list[threading.Thread] = []
        self._counting = threading.Lock()
        self._refused = 0
        self.updates_expired = 0
        self._calls = LastCalls(utc_ns)

    @property
    def refused(self) -> int:
        """Commands refused so far, and those whose call or answer a full box lost."""
        return self._refused

    @property
    def last_calls(self) -> dict[str, LastCall]:
        """Who changed what, by the name of the call: its last that was accepted."""
        return self._calls.by_name()

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
            Keys of the rig.
        """
        for name in CALLS:
            key = keys.call(name)
            post = Callback(self._poster_of_call(name, key), indirect=False)
            self._declared.append(session.declare_queryable(key, post, complete=True))
        posts: dict[str, Callable[[zenoh.Sample], None]] = {
            keys.of(Topics.TEXTURE): self._post_texture,
            keys.of(Topics.LEASE): self._take_lease,
            keys.of(Topics.POINTER): self._post_pointer,
        }
        if self._control.follows_guidance:
            posts[keys.of(Topics.GUIDANCE)] = self._post_guidance
        for key, listen in posts.items():
            self._declared.append(
                session.declare_subscriber(key, Callback(listen, indirect=False))
            )
        self._declared.append(
            session.liveliness().declare_subscriber(
                keys.any_client_alive, Callback(self._on_token, indirect=False), history=True
            )
        )

    def _poster_of_call(self, name: str, key: str) -> Callable[[zenoh.Query], None]:
        def post(query: zenoh.Query) -> None:
            sender = _name_in(query.attachment)
            message = IncomingCommand(name, sender=sender, query=query, key=key)
            if name == "stop":  # its payload is of no account
                self._decide(message)
                return
            refused = self._refusal_unread(name, sender, query.payload)
            if refused is not None:
                self._to_answer(message, refused)
                return
            payload = b"" if query.payload is None else query.payload.to_bytes()
            message = replace(message, payload=payload)
            if name not in RENDERING_CALLS:
                self._decide(message)
                return
            if name == "scene" and sender:
                self._newest_scene[sender] = message
            for lost in self._rendering.post("call", message, sender):
                self._forget(lost)
                self._to_answer(lost, OVERRUN)

        return post

    def _refusal_unread(
        self, name: str, sender: str, payload: zenoh.ZBytes | None
    ) -> Reply | None:
        """Return why a payload is not even copied: who sent it, or how long it is."""

        def check() -> None:
            if name in OWNERS_CALLS and sender:
                self._stage.check_owner(sender)
            size_bytes = len(payload or b"")
            self._gate.check_size(size_bytes, self._gate.most_bytes(name))
            if not sender and size_bytes > UNNAMED_BYTES:
                raise RefusedError(
                    "too_large",
                    f"{size_bytes} bytes, and the attachment names no client; at most "
                    f"{UNNAMED_BYTES} are accepted so: attach the client's name",
                )

        reply = self._answered(check)
        return None if reply.ok else reply

    def _decide(self, message: IncomingCommand) -> None:
        self._to_answer(message, self.keep_safe(message))

    def _to_answer(self, message: IncomingCommand, reply: Reply) -> None:
        self._count(reply)
        if message.query is not None:
            answer = replace(message, reply=reply)
            for _unanswered in self._answering.post("answer", answer, message.sender):
                self._count(OVERRUN)

    def _count(self, reply: Reply) -> None:
        if not reply.ok:
            with self._counting:
                self._refused += 1

    def _copied(self, name: str, sample: zenoh.Sample) -> bytes | None:
        """Return a payload, or count it as refused: to copy a long one stops the loop."""
        refused = self._refusal_unread(name, "", sample.payload)
        if refused is not None:
            self._count(refused)
            return None
        return sample.payload.to_bytes()

    def _take_lease(self, sample: zenoh.Sample) -> None:
        payload = self._copied("lease", sample)
        if payload is not None:
            self._count(self.keep_safe(IncomingCommand("lease", payload)))

    def _post_texture(self, sample: zenoh.Sample) -> None:
        payload = self._copied("texture", sample)
        if payload is None:
            return
        # Anybody's would push out the update of whom the stream belongs to.
        reply = self._answered(lambda: self._stage.check_ticket(ticket_of(payload)))
        self._count(reply)
        if reply.ok:
            self._rendering.post("texture", IncomingCommand("texture", payload))

    def _post_pointer(self, sample: zenoh.Sample) -> None:
        payload = self._copied("pointer", sample)
        if payload is not None:
            sender = _name_in(sample.attachment)
            self._answering.post("pointer", IncomingCommand("pointer", payload), sender)

    def _post_guidance(self, sample: zenoh.Sample) -> None:
        payload = self._copied("guidance", sample)
        if payload is not None:
            self._answering.post("guidance", IncomingCommand("guidance", payload))

    def _on_token(self, sample: zenoh.Sample) -> None:
        client = str(sample.key_expr).rsplit("/", 1)[1]
        self.presence.on_token(client, sample.kind == zenoh.SampleKind.PUT)

    def serve_answers(self) -> None:
        """Move virtual fingers and answer calls until closed."""
        while (taken := self._answering.take()) is not None:
            box, message = taken
            if box == "answer":
                message.answer()
            else:
                self._count(self.keep_safe(message))

    def serve_rendering(self) -> None:
        """Work through what has to be compiled until closed."""
        while (taken := self._rendering.take()) is not None:
            message = taken[1]
            self._to_answer(message, self.render(message))
            self._forget(message)

    def keep_safe(self, message: IncomingCommand) -> Reply:
        """Decide on a message that is about safety, or moves a virtual finger."""
        if message.name == "stop":
            # Whatever it carries and however old it is: a stop always stops. It is noted, since
            # a calibration, armed for its trials alone, ends by one between them, too.
            with self._calls.noted("stop", message.sender):
                return self._answered(lambda: self._control.stop(message.sender))
        if message.name == "guidance":
            return self._answered(lambda: self._guide(message.payload))
        handlers: Mapping[str, tuple[type[Request], Callable[[Any], Reply | None]]] = {
            "arm": (ArmRequest, self._arm),
            "disarm": (Request, self._control.disarm),
            "reset": (Request, self._reset),
            "lease": (LeaseRenewal, self._control.renew),
            "pointer": (PointerState, self._control.point),
        }
        kind, handle = handlers[message.name]
        return self._answered(lambda: handle(self._read(kind, message)))

    def render(self, message: IncomingCommand) -> Reply:
        """Decide on a message that concerns what is rendered."""
        if message.name == "texture":
            return self._answered(lambda: self._update(message.payload))
        kind = MESSAGES[CALLS[message.name]]

        def give_way() -> None:
            if self._newest_scene.get(message.sender, message) is not message:
                raise RefusedError("unavailable", OVERRUN.message)

        handlers: Mapping[str, Callable[[Any], Reply]] = {
            "scene": lambda request: self._stage.set_scene(request, give_way),
            "open_stream": self._stage.open_stream,
            "close_stream": self._stage.close_stream,
            "excite": self._stage.excite,
            "compensation": self._stage.compensate,
            "model": self._models.set_model,
            "adaptation": self._models.choose_policy,
            "adapt": self._models.adapt,
        }
        handle = handlers[message.name]

        def work() -> Reply:
            if message.name == "scene":
                give_way()
            request = self._read(kind, message)
            with self._calls.noted(message.name, request.client):
                return handle(request)

        return self._answered(work)

    def _forget(self, message: IncomingCommand) -> None:
        if self._newest_scene.get(message.sender) is message:
            self._newest_scene.pop(message.sender, None)

    def _update(self, payload: bytes) -> None:
        try:
            frame, good_for_s = self._gate.read_frame(payload, self._utc_ns())
        except RefusedError as error:
            self.updates_expired += error.code == "stale"
            raise
        self._stage.update(frame, good_for_s)

    def _arm(self, request: ArmRequest) -> Reply:
        reply = self._control.arm(request)
        self.presence.on_armed(request.client)
        return reply

    def _reset(self, request: Request) -> Reply:
        with self._calls.noted("reset", request.client):
            return self._control.reset(request)

    def _guide(self, payload: bytes) -> None:
        self._control.guide(self._gate.read_guidance(payload, self._utc_ns()))

    def _read(self, kind: Any, message: IncomingCommand) -> Any:
        most_bytes = self._gate.most_bytes(message.name)
        request = self._gate.read(kind, message.payload, self._utc_ns(), most_bytes)
        if message.sender not in ("", request.client):
            raise RefusedError(
                "bad_request",
                f"client: {request.client!r}, but the attachment names {message.sender!r}",
            )
        return request

    def _answered(self, handle: Callable[[], Reply | None]) -> Reply:
        """Return what the handler says, with the state after it; refusals become replies."""
        try:
            reply = handle() or Reply(ok=True)
        except RefusedError as error:
            code: RefusalCode = error.code  # type: ignore[assignment]
            reply = Reply(ok=False, code=code, message=str(error))
        except FrameError as error:
            reply = Reply(ok=False, code="bad_request", message=str(error))
        except Exception as error:  # a command must never end this thread
            reply = Reply(
                ok=False,
                code="not_feasible",
                message=f"the rig failed on it: {type(error).__name__}: {error}",
            )
        state = self._interlock.state.state
        return reply.model_copy(update={"state": state, "utc_ns": self._utc_ns()})

    def __enter__(self) -> Self:
        """Start the threads."""
        self._threads = [
            threading.Thread(target=self.serve_answers, name="frictus-answers", daemon=True),
            threading.Thread(target=self.serve_rendering, name="frictus-stage", daemon=True),
        ]
        for thread in self._threads:
            thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Stop listening and end the threads."""
        for declared in self._declared:
            declared.undeclare()
        self._declared.clear()
        self.presence.close()
        self._answering.close()
        self._rendering.close()
        for thread in self._threads:
            thread.join()


def _name_in(attachment: zenoh.ZBytes | None) -> str:
    """Return the client's name that an attachment holds; empty where it holds none."""
    if attachment is None or len(attachment) > MAX_NAME:
        return ""
    return name_in(attachment.to_bytes())

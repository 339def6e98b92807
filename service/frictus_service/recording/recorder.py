"""The recorder part: records its rig when it is asked to, by client, REST or command line."""

import logging
import queue
import threading
import time
from collections.abc import Callable
from typing import Any, Final, Self

import zenoh
from zenoh.handlers import Callback

import frictus
from frictus.errors import FrictusError, RefusedError
from frictus.keys import RECORDER_CALLS, Topics
from frictus.messages import (
    RecordingState,
    RecordRequest,
    RefusalCode,
    Reply,
    Request,
)
from frictus.session import declare_latest_publisher
from frictus_service.command_validation import CommandValidator
from frictus_service.config import Config
from frictus_service.errors import NotWrittenError
from frictus_service.processes import ReadySignal
from frictus_service.recording.recording import BEAT_S, SUFFIX, RecordingSession
from frictus_service.recording.summary import unfinished
from frictus_service.security.members import tls_of_rig

STATE_S: Final = 0.5
"""The state is told this often while something is recorded, and at every change."""
TIMEOUT_S: Final = 2.0
WAITING_CALLS: Final = 16
_LOG: Final = logging.getLogger(__name__)


class Recorder:
    """Answers the recorder's calls while it is entered; one thread turns it.

    Parameters
    ----------
    config : Config
        Site, rig, router, folder and limits.
    say : callable
        Told what an operator should know.

    Raises
    ------
    LinkError
        If no router answers.
    """

    def __init__(self, config: Config, say: Callable[[str], None]) -> None:
        self._config = config
        self._say = say
        self._gate = CommandValidator(config.limits)
        self._calls: queue.Queue[tuple[str, zenoh.Query]] = queue.Queue(WAITING_CALLS)
        self._recording: RecordingSession | None = None
        self._idle = RecordingState(utc_ns=time.time_ns(), recording=False)
        self._refused_calls = 0
        self._told_s = 0.0
        self._client = frictus.connect(
            config.router.endpoint,
            timeout_s=TIMEOUT_S,
            tls=tls_of_rig(config),
            patient=True,
        )
        session, keys = self._client.session, config.keys
        self._publisher = declare_latest_publisher(
            session, keys.of(Topics.RECORDING), Topics.RECORDING
        )
        self._declared: list[Any] = [
            session.declare_queryable(
                keys.call(name), Callback(self._poster(name), indirect=False), complete=True
            )
            for name in RECORDER_CALLS
        ]

    def tell_of_unfinished(self) -> None:
        """Say so where the last recording in the folder was torn."""
        torn = unfinished(self._config.recordings)
        if torn is not None:
            problem = (
                f"the recorder ended while it wrote {torn}: what was synced can be read as it "
                "is; `frictus recover` makes a finished file of it"
            )
            self._say(problem)
            self._idle = self._idle.model_copy(
                update={"name": torn.stem, "path": str(torn), "problem": problem}
            )
        self._tell()

    def turn(self) -> None:
        """Wait a beat for a call and answer it; write what has come."""
        try:
            name, query = self._calls.get(timeout=BEAT_S)
        except queue.Empty:
            pass
        else:
            self._answer(name, query)
        recording = self._recording
        if recording is None:
            return
        recording.beat()
        if recording.ended:
            self._say(f"{recording.path} ended: {recording.problem}")
            self._set_down()
        elif time.monotonic() - self._told_s >= STATE_S:
            self._tell()

    def _poster(self, name: str) -> Callable[[zenoh.Query], None]:
        def post(query: zenoh.Query) -> None:
            try:
                self._calls.put_nowait((name, query))
            except queue.Full:
                query.drop()  # type: ignore[no-untyped-call]

        return post

    def _answer(self, name: str, query: zenoh.Query) -> None:
        try:
            self._gate.check_size(len(query.payload or b""), self._gate.most_bytes(name))
            payload = query.payload.to_bytes() if query.payload else b""
            reply = self._record(payload) if name == "record" else self._end(payload)
        except RefusedError as error:
            code: RefusalCode = error.code  # type: ignore[assignment]
            reply = Reply(ok=False, code=code, message=str(error))
        except FrictusError as error:
            reply = Reply(ok=False, code="unavailable", message=str(error))
        except Exception as error:  # a call must never end the recorder
            _LOG.exception("a call of %s", name)
            told = f"the recorder failed on it: {type(error).__name__}: {error}"
            reply = Reply(ok=False, code="not_feasible", message=told)
        if not reply.ok:
            self._refused_calls += 1
            self._tell()
        try:
            with query:
                # A query may have asked under a wildcard; a reply must not.
                query.reply(self._config.keys.call(name), reply.to_json())
        except zenoh.ZError as error:
            self._say(f"whoever asked for {name} is gone: {error}")

    def _record(self, payload: bytes) -> Reply:
        most = self._config.limits.max_payload_bytes
        request = self._gate.read(RecordRequest, payload, time.time_ns(), most)
        if self._recording is not None:
            raise RefusedError(
                "conflict", f"{self._recording.name} is being recorded: end it first"
            )
        path = self._config.recordings.resolve() / f"{request.name}{SUFFIX}"
        if path.exists():
            raise RefusedError(
                "conflict", f"there is a recording {path} already; take another name"
            )
        rig = self._client.rig(self._config.rig, self._config.site)
        try:
            self._recording = RecordingSession(self._client, rig, request, path, self._config)
        except NotWrittenError as error:
            raise RefusedError("unavailable", str(error)) from error
        self._say(f"records {path}")
        self._tell()
        return Reply(ok=True, message=str(path))

    def _end(self, payload: bytes) -> Reply:
        most = self._config.limits.max_payload_bytes
        self._gate.read(Request, payload, time.time_ns(), most)
        recording = self._recording
        if recording is None:
            raise RefusedError("conflict", "nothing is being recorded")
        recording.end()
        self._say(f"{recording.path} ended")
        self._set_down()
        return Reply(ok=True, message=str(recording.path))

    def _set_down(self) -> None:
        assert self._recording is not None
        self._idle = self._recording.state()
        self._recording = None
        self._tell()

    def _tell(self) -> None:
        recording = self._recording
        state = self._idle if recording is None else recording.state()
        told = state.model_copy(update={"refused_calls": self._refused_calls})
        self._publisher.put(told.to_json())
        self._told_s = time.monotonic()

    def __enter__(self) -> Self:
        """Return self."""
        return self

    def __exit__(self, *_: object) -> None:
        """End what is recorded, and leave."""
        if self._recording is not None:
            self._recording.end("the recorder was stopped")
            self._set_down()
        for declared in (*self._declared, self._publisher):
            declared.undeclare()
        self._client.close()


def run_recorder(
    config: Config,
    ready: ReadySignal,
    stop: threading.Event,
    say: Callable[[str], None] = lambda _line: None,
) -> None:
    """Run a recorder until told to stop; then finish what is being recorded.

    Parameters
    ----------
    config : Config
        Of the service.
    ready : Event
        Set once calls are answered.
    stop : threading.Event
        Ends the recorder.
    say : callable
        Told what an operator should know.

    Raises
    ------
    LinkError
        If no router answers.
    """
    with Recorder(config, say) as recorder:
        recorder.tell_of_unfinished()
        ready.set()
        while not stop.is_set():
            recorder.turn()

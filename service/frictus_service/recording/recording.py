"""A recording under way: what comes from the network goes into the file, beat by beat."""

import contextlib
import logging
import platform
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from importlib.metadata import version
from pathlib import Path
from types import TracebackType
from typing import Final, Protocol, Self

import zenoh

import frictus
from frictus.block import Block
from frictus.client import RigName
from frictus.closing import Closing
from frictus.errors import FrameError
from frictus.gaps import BlockFeed, Gap
from frictus.keys import STREAMS, RigKeys, Topic
from frictus.mailbox import Arrival
from frictus.messages import MAX_COUNT, MESSAGES, RecordingState, RecordRequest
from frictus.reception import Declare, Feed
from frictus.session import declare_reader
from frictus_service.config import Config
from frictus_service.errors import NotWrittenError
from frictus_service.recording.records import STREAM_NAMES, GapNote, RecordingInfo
from frictus_service.recording.writer import STATES, RecordingWriter

BLOCK_QUEUE: Final = 2_048
"""Blocks held while the disk is slow: 10 s of 5 ms blocks."""
STATE_QUEUE: Final = 4_096


@dataclass(frozen=True, slots=True)
class _Came:
    """A state as it came; `index` counts the arrivals of its topic."""

    index: int
    payload: bytes
    utc_ns: int | None


class Sink(Protocol):
    """What takes what comes from a rig."""

    def state(self, topic: Topic, payload: bytes, utc_ns: int) -> None:
        """Take a state as it was published, and what time it holds for."""

    def gap(self, note: GapNote) -> None:
        """Take word of what is missing; it stands before what follows the gap."""

    def block(self, block: Block) -> None:
        """Take samples."""


class Intake(Closing):
    """Follows a rig's streams and states until it is closed; a context manager.

    Parameters
    ----------
    session : zenoh.Session
        Open session.
    keys : RigKeys
        Keys of the rig.
    streams : iterable of int
        Of `STREAMS`.
    """

    def __init__(
        self, session: zenoh.Session, keys: RigKeys, streams: Iterable[int] = tuple(STREAMS)
    ) -> None:
        def declare(topic: Topic) -> Declare:
            return partial(declare_reader, session, keys.of(topic), topic)

        self._blocks = {
            stream: BlockFeed(declare(STREAMS[stream]), STREAMS[stream], BLOCK_QUEUE)
            for stream in streams
        }
        self._states = {
            topic: Feed(declare(topic), partial(_came, topic), STATE_QUEUE) for topic in STATES
        }
        self._due = dict.fromkeys(STATES, 0)
        self._run = 0

    @property
    def received_blocks(self) -> int:
        """Blocks that came."""
        return sum(feed.received for feed in self._blocks.values())

    @property
    def lost_blocks(self) -> int:
        """Blocks that never came."""
        # A forged sequence number may claim that any number of blocks were sent.
        return min(sum(feed.lost for feed in self._blocks.values()), MAX_COUNT)

    def drain_into(self, writer: Sink, utc_ns: int) -> None:
        """Write everything that is there, gaps where something is not; does not wait.

        Parameters
        ----------
        writer : Sink
            Takes blocks, states and gaps.
        utc_ns : int
            Now.

        Raises
        ------
        NotWrittenError
        """
        for topic in STATES:
            self._drain_states(topic, writer, utc_ns)
        for stream in self._blocks:
            self._drain_blocks(stream, writer, utc_ns)

    def _drain_states(self, topic: Topic, writer: Sink, utc_ns: int) -> None:
        for came in self._states[topic].drain():
            missing = came.index - self._due[topic]
            self._due[topic] = came.index + 1
            if missing:
                writer.gap(
                    GapNote(
                        utc_ns=utc_ns,
                        stream=topic.suffix,
                        missing_blocks=missing,
                        reason="overflow",
                        detail="dropped by the recorder's queue, or not of the protocol",
                    )
                )
            writer.state(topic, came.payload, utc_ns if came.utc_ns is None else came.utc_ns)

    def _drain_blocks(self, stream: int, writer: Sink, utc_ns: int) -> None:
        gaps: list[Gap] = []
        for item in self._blocks[stream].drain():
            if isinstance(item, Gap):
                gaps.append(item)
                continue
            self._run = item.run
            self._tell(stream, gaps, writer, utc_ns)
            writer.block(item)
        self._tell(stream, gaps, writer, utc_ns)  # an unreadable one that nothing follows yet

    def _tell(self, stream: int, gaps: list[Gap], writer: Sink, utc_ns: int) -> None:
        for gap in gaps:
            writer.gap(
                GapNote(
                    utc_ns=utc_ns,
                    stream=STREAM_NAMES[stream],
                    run=self._run,
                    first_missing_sequence=gap.first_missing_sequence,
                    missing_blocks=gap.missing_blocks,
                    missing_samples=gap.samples,
                    reason=gap.reason,
                    detail=gap.detail,
                )
            )
        gaps.clear()

    def close(self) -> None:
        """Stop following."""
        for blocks in self._blocks.values():
            blocks.close()
        for states in self._states.values():
            states.close()


def _came(topic: Topic, arrival: Arrival) -> list[_Came]:
    message = MESSAGES[topic.message].from_json(arrival.payload)
    utc_ns = getattr(message, "utc_ns", None)
    if utc_ns is not None and not 0 <= utc_ns < 2**63:
        raise FrameError("utc_ns is out of range: nanoseconds from 1970 to 2262 are accepted")
    return [_Came(arrival.index, arrival.payload, utc_ns)]


BEAT_S: Final = 0.05
"""The network's queues are emptied this often."""
STOOD_STILL_S: Final = 0.5
"""A recorder that was not run for so long, as on a machine that slept, has missed blocks."""
CATCH_UP_S: Final = 0.5
"""After which it knows what it has missed: a gap is told by the block that follows it."""
GONE_S: Final = 60.0
"""A rig that has vanished may come back within this time, as one that is started again does;
then the recording ends."""
SUFFIX: Final = ".mcap"
ASTRAY: Final = (
    "{} is no longer the file that was written: somebody has moved, deleted, shortened or "
    "replaced it while it was recorded. Start another recording"
)
_LOG: Final = logging.getLogger(__name__)
SECRETS: Final[dict[str, bool | set[str]]] = {
    "api": {"tokens"},
    "registry": True,
    "backend": {"authkey"},
}
"""Parts of the configuration that stay out of a file that is passed on."""


class RecordingSession:
    """Records a rig until it is ended, or cannot go on; a context manager. One thread.

    Parameters
    ----------
    client : Client
        Connected.
    rig : Rig
        Present.
    request : RecordRequest
        Name, participant and notes.
    path : Path
        Must not exist.
    config : Config
        Attached, without what is secret in it.
    gone_s : float
        How long the rig may be away.
    utc_ns : callable
        Clock, ns.

    Raises
    ------
    NotWrittenError
        If the file cannot be made.
    LinkError
        If the rig does not say what it is.
    """

    def __init__(
        self,
        client: frictus.Client,
        rig: frictus.Rig,
        request: RecordRequest,
        path: Path,
        config: Config,
        gone_s: float = GONE_S,
        utc_ns: Callable[[], int] = time.time_ns,
    ) -> None:
        self.name = request.name
        self.path = path
        self.problem: str | None = None
        self._utc_ns = utc_ns
        self._gone_s = gone_s
        self._rig = RigName(rig.site, rig.name)
        self._gone_since_s: float | None = None
        self._ended = False
        self._writer = RecordingWriter(
            path, self._info(rig, request), _attachments(rig, config), time.monotonic
        )
        self._begun_s = self._end_s = self._beaten_s = time.monotonic()
        self._caught_up_s = self._begun_s
        self._intake = Intake(client.session, rig.keys)
        self._presence = client.presence(rig.site)

    def _info(self, rig: frictus.Rig, request: RecordRequest) -> RecordingInfo:
        return RecordingInfo(
            name=request.name,
            site=rig.site,
            rig=rig.name,
            participant=request.participant,
            notes=request.notes,
            started_utc_ns=self._utc_ns(),
            software=f"frictus {version('frictus')}",
            host=platform.node(),
            converter_steps=rig.status().converter_steps,
        )

    @property
    def ended(self) -> bool:
        """Whether it has ended, for whatever reason."""
        return self._ended

    def beat(self) -> None:
        """Write what has come since the last beat; call it every `BEAT_S`.

        What goes wrong ends the recording, and `problem` says what it was.
        """
        if self._ended:
            return
        self._note_beat()
        if not self._writer.in_place:
            self.end("its file was taken away")
            return
        with self._finished_by_failure():
            self._follow_presence()
            self._intake.drain_into(self._writer, self._utc_ns())
            self._writer.tick()
        if self._ended:
            return
        gone_s = 0.0
        if self._gone_since_s is not None:
            gone_s = time.monotonic() - self._gone_since_s
        if gone_s > self._gone_s:
            problem = f"rig {self._rig.name} vanished and was not back after {gone_s:.0f} s"
            self.end(problem)
            self.problem = self.problem or problem

    def end(self, reason: str = "asked for") -> None:
        """Write what has come, and finish the file. Ending twice is harmless."""
        if self._ended:
            return
        astray = None if self._writer.in_place else ASTRAY.format(self.path)
        self._note_beat()
        with self._finished_by_failure():
            while time.monotonic() < self._caught_up_s:
                self._intake.drain_into(self._writer, self._utc_ns())
                time.sleep(BEAT_S)
            self._intake.drain_into(self._writer, self._utc_ns())
            self._writer.end(reason, self._utc_ns(), time.monotonic() - self._begun_s)
            self._finish(astray)

    def state(self) -> RecordingState:
        """Return what is to be told of it."""
        until_s = self._end_s if self._ended else time.monotonic()
        return RecordingState(
            utc_ns=self._utc_ns(),
            recording=not self._ended,
            name=self.name,
            path=str(self.path),
            bytes_written=self._writer.bytes_written,
            seconds=until_s - self._begun_s,
            blocks=self._intake.received_blocks,
            lost_blocks=self._intake.lost_blocks,
            problem=self.problem,
        )

    def _note_beat(self) -> None:
        now_s = time.monotonic()
        if now_s - self._beaten_s > STOOD_STILL_S:
            self._caught_up_s = now_s + CATCH_UP_S
        self._beaten_s = now_s

    def _follow_presence(self) -> None:
        for change in self._presence.drain():
            if change.rig != self._rig or change.present == (self._gone_since_s is None):
                continue
            self._gone_since_s = None if change.present else time.monotonic()
            self._writer.presence(change.present, self._utc_ns())

    @contextlib.contextmanager
    def _finished_by_failure(self) -> Iterator[None]:
        try:
            yield
        except NotWrittenError as error:
            self._finish(str(error))
        except Exception as error:  # what comes from the network never ends the recorder
            _LOG.exception("recording %s", self.path)
            self._finish(f"the recorder failed: {type(error).__name__}: {error}")

    def _finish(self, problem: str | None) -> None:
        self._ended = True
        self.problem = problem
        self._end_s = time.monotonic()
        self._writer.close()
        self._intake.close()
        self._presence.close()

    def __enter__(self) -> Self:
        """Return self."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """End."""
        self.end("ended with an error" if error else "asked for")


def _attachments(rig: frictus.Rig, config: Config) -> dict[str, bytes]:
    return {
        "status.json": rig.status().to_json(),
        "model.json": rig.model().to_json(),
        "scene.json": rig.scene().to_json(),
        "time.json": rig.time().to_json(),
        "configuration.json": config.model_dump_json(exclude=SECRETS).encode(),
    }

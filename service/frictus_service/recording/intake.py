"""Everything that a rig publishes, taken from the network as fast as it comes."""

from dataclasses import dataclass
from functools import partial
from types import TracebackType
from typing import Final, Self

import zenoh

from frictus.errors import FrameError
from frictus.gaps import BlockFeed, Gap
from frictus.keys import STREAMS, RigKeys, Topic
from frictus.messages import MAX_COUNT, MESSAGES
from frictus.reception import Arrival, Declare, Feed
from frictus.session import declare_reader
from frictus_service.recording.records import STREAM_NAMES, GapNote
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


class Intake:
    """Follows a rig's streams and states until it is closed; a context manager.

    Parameters
    ----------
    session : zenoh.Session
        Open session.
    keys : RigKeys
        Keys of the rig.
    """

    def __init__(self, session: zenoh.Session, keys: RigKeys) -> None:
        def declare(topic: Topic) -> Declare:
            return partial(declare_reader, session, keys.of(topic), topic)

        self._blocks = {
            stream: BlockFeed(declare(topic), topic, BLOCK_QUEUE)
            for stream, topic in STREAMS.items()
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

    def drain_into(self, writer: RecordingWriter, utc_ns: int) -> None:
        """Write everything that is there, gaps where something is not; does not wait.

        Parameters
        ----------
        writer : RecordingWriter
            Takes blocks, states and gaps.
        utc_ns : int
            Now.

        Raises
        ------
        NotWrittenError
        """
        for topic in STATES:
            self._drain_states(topic, writer, utc_ns)
        for stream in STREAMS:
            self._drain_blocks(stream, writer, utc_ns)

    def _drain_states(self, topic: Topic, writer: RecordingWriter, utc_ns: int) -> None:
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

    def _drain_blocks(self, stream: int, writer: RecordingWriter, utc_ns: int) -> None:
        gaps: list[Gap] = []
        for item in self._blocks[stream].drain():
            if isinstance(item, Gap):
                gaps.append(item)
                continue
            self._run = item.run
            self._tell(stream, gaps, writer, utc_ns)
            writer.block(item)
        self._tell(stream, gaps, writer, utc_ns)  # an unreadable one that nothing follows yet

    def _tell(self, stream: int, gaps: list[Gap], writer: RecordingWriter, utc_ns: int) -> None:
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

    def __enter__(self) -> Self:
        """Return self."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Close."""
        self.close()


def _came(topic: Topic, arrival: Arrival) -> list[_Came]:
    message = MESSAGES[topic.message].from_json(arrival.payload)
    utc_ns = getattr(message, "utc_ns", None)
    if utc_ns is not None and not 0 <= utc_ns < 2**63:
        raise FrameError("utc_ns is out of range: nanoseconds from 1970 to 2262 are accepted")
    return [_Came(arrival.index, arrival.payload, utc_ns)]

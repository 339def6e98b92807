"""Reads a recording from its beginning as far as it can be trusted, and says how far that is.

No value is returned that was not written: every chunk's checksum is compared before anything in
it is looked at, and messages are counted per channel, so that a chunk that vanished is noticed.
Where something is wrong, reading ends; `RecordingReader.ending` says where and why.
"""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from mcap.records import Channel
from mcap.records import Message as Stored
from pydantic import ValidationError

from frictus.closing import Closing
from frictus.errors import FrameError
from frictus.files import require_file
from frictus.keys import STREAMS
from frictus.messages import MESSAGES, Message, RigStatus
from frictus_service.errors import RecordingError, TornError
from frictus_service.recording.records import (
    NOTES,
    EndNote,
    GapNote,
    Inner,
    Note,
    PresenceNote,
    RecordingInfo,
    RecordScanner,
)
from frictus_service.recording.samples import Samples
from frictus_service.recording.writer import STATES

STREAM_SUFFIXES: Final = {topic.suffix: number for number, topic in STREAMS.items()}
STATE_KINDS: Final = {topic.suffix: MESSAGES[topic.message] for topic in STATES}


@dataclass(frozen=True, slots=True)
class State:
    """A message of a rig, as it came.

    Attributes
    ----------
    topic : str
        Suffix of its key, such as `state/touch`.
    utc_ns : int
        What it holds for, or when it came.
    message : Message
        As it was published.
    payload : bytes
        The JSON itself, with what this version does not know.
    """

    topic: str
    utc_ns: int
    message: Message
    payload: bytes


Item = Samples | State | GapNote | PresenceNote | EndNote


@dataclass(frozen=True, slots=True)
class Ending:
    """How far a recording could be read.

    Attributes
    ----------
    complete : bool
        To its proper end; all checksums agree.
    clean_bytes, total_bytes : int
        That can be trusted, and of the file.
    clean_s : float
        Length of what was read, by the device's clock.
    reason : str
        Why reading ended early; empty if it did not.
    """

    complete: bool
    clean_bytes: int
    total_bytes: int
    clean_s: float
    reason: str = ""

    @property
    def lost_s(self) -> float:
        """About how much the bytes that cannot be read held, s."""
        rate = self.clean_s / self.clean_bytes if self.clean_bytes else 0.0
        return rate * (self.total_bytes - self.clean_bytes)

    def __str__(self) -> str:
        """Return it as a sentence."""
        if self.complete:
            return f"complete: {self.clean_s:.2f} s"
        unread = self.total_bytes - self.clean_bytes
        return (
            f"ends early after {self.clean_s:.2f} s: {self.reason}. {unread} of "
            f"{self.total_bytes} bytes cannot be trusted, about {self.lost_s:.2f} s"
        )


class RecordingReader(Closing):
    """One recording, open for reading; a context manager.

    Parameters
    ----------
    path : Path

    Attributes
    ----------
    info : RecordingInfo
        Rig, name, participant and software.
    attachments : dict of name to bytes

    Raises
    ------
    RecordingError
        If the file is no recording, or torn before anything was recorded.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.attachments: dict[str, bytes] = {}
        require_file(path)
        self._size = path.stat().st_size
        self._file = path.open("rb")
        self._ending: Ending | None = None
        try:
            self.info = self._read_info()
        except BaseException:
            self._file.close()
            raise

    @property
    def status(self) -> RigStatus:
        """Of the rig when the recording began.

        Raises
        ------
        RecordingError
            If the file lacks it.
        """
        content = self.attachments.get("status.json")
        if content is None:
            raise RecordingError(f"{self.path} does not say what its rig is: no status.json")
        return RigStatus.from_json(content)

    @property
    def ending(self) -> Ending:
        """How far the recording could be read; known once `items` has come to its end."""
        if self._ending is None:
            for _ in self.items():
                pass
        assert self._ending is not None
        return self._ending

    def items(self) -> Iterator[Item]:
        """Yield what was recorded in the order in which it was written.

        Streams are in order each; between streams the order may be off by 0.1 s.
        """
        self._file.seek(0)
        channels = _Channels()
        span = _Span()
        clean = 0
        try:
            for piece in RecordScanner(self._file, self._size).pieces():
                for item in channels.items(piece.inner, clean):
                    span.add(item)
                    yield item
                clean = piece.end
        except TornError as error:
            self._ending = Ending(False, clean, self._size, span.seconds, str(error))
        else:
            self._ending = Ending(True, self._size, self._size, span.seconds)

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def _read_info(self) -> RecordingInfo:
        """Read up to the first chunk: everything that does not change stands before it."""
        try:
            for piece in RecordScanner(self._file, self._size).pieces():
                if piece.attachment is not None:
                    self.attachments[piece.attachment.name] = piece.attachment.data
                elif piece.inner:
                    break
        except TornError as error:
            if "recording.json" not in self.attachments:
                raise RecordingError(f"{self.path} cannot be read: {error}") from error
        content = self.attachments.get("recording.json")
        if content is None:
            raise RecordingError(
                f"{self.path} is an MCAP file, but no recording of frictus: it has no "
                "attachment recording.json"
            )
        try:
            return RecordingInfo.model_validate_json(content)
        except ValidationError as error:
            raise RecordingError(
                f"{self.path}: its recording.json is of a version that this reader does not "
                f"know ({error.error_count()} faults): update frictus"
            ) from error


class _Span:
    """How many seconds of the device's clock the longest stream covers, runs added up."""

    def __init__(self) -> None:
        self._bounds: dict[tuple[int, int], tuple[int, int, float]] = {}

    def add(self, item: Item) -> None:
        if isinstance(item, Samples):
            key = (item.stream, item.run)
            first = self._bounds.get(key, (item.first_sample,))[0]
            self._bounds[key] = (first, item.end_sample, item.sample_rate_hz)

    @property
    def seconds(self) -> float:
        streams: dict[int, float] = {}
        for (stream, _run), (first, end, rate_hz) in self._bounds.items():
            streams[stream] = streams.get(stream, 0.0) + (end - first) / rate_hz
        return max(streams.values(), default=0.0)


class _Channels:
    """Turns the records of chunks into items; holds each channel to its count."""

    def __init__(self) -> None:
        self._topics: dict[int, str] = {}
        self._counts: dict[int, int] = {}

    def items(self, inner: tuple[Inner, ...], offset: int) -> list[Item]:
        """Return a chunk's items.

        Raises
        ------
        TornError
            Where messages are missing before it, or one is not what its channel says.
        """
        found: list[Item] = []
        for record in inner:
            if isinstance(record, Channel):
                self._topics[record.id] = record.topic
            elif isinstance(record, Stored):
                item = self._item(record, offset)
                found += [] if item is None else [item]
        return found

    def _item(self, record: Stored, offset: int) -> Item | None:
        topic = self._topics.get(record.channel_id)
        due = self._counts.get(record.channel_id, 0)
        if topic is None or record.sequence != due:
            raise TornError(
                offset,
                f"messages are missing: {topic or 'an unknown channel'} goes on with "
                f"{record.sequence} instead of {due}",
            )
        self._counts[record.channel_id] = due + 1
        try:
            return _decoded(topic, record)
        except (RecordingError, FrameError, ValidationError, json.JSONDecodeError) as error:
            raise TornError(offset, f"a message of {topic} cannot be read: {error}") from error


def _decoded(topic: str, record: Stored) -> Item | None:
    """Return the item; None for a channel that a later version has added."""
    if topic in STREAM_SUFFIXES:
        samples = Samples.unpack(record.data)
        if samples.stream != STREAM_SUFFIXES[topic]:
            raise RecordingError(f"samples of stream {samples.stream}")
        return samples
    if topic in STATE_KINDS:
        message = STATE_KINDS[topic].from_json(record.data)
        return State(topic, record.log_time, message, record.data)
    kind: type[Note] | None = NOTES.get(topic)
    if kind is None:
        return None
    note = kind.model_validate_json(record.data)
    assert isinstance(note, GapNote | PresenceNote | EndNote)
    return note

"""The records of an MCAP file, and what a recorder writes down beside what it was sent.

The `mcap` package's own reader takes short reads for whole ones, steps over records whose kind
it does not know and leaves attachments unchecked; a torn file needs more distrust than that.
"""

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO
from typing import Annotated, BinaryIO, Final, Literal, TypeVar

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, DataEnd, Footer, Message, Schema
from mcap.writer import MCAP0_MAGIC
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat

from frictus.keys import STREAMS
from frictus_service.errors import TornError

HDF5_MAGIC: Final = b"\x89HDF\r\n\x1a\n"
PROFILE: Final = "frictus"
GAPS: Final = "recording/gaps"
PRESENCE: Final = "recording/presence"
END: Final = "recording/end"
STREAM_NAMES: Final = {
    number: topic.suffix.removeprefix("stream/") for number, topic in STREAMS.items()
}


class Note(BaseModel):
    """What all notes share."""

    model_config = ConfigDict(extra="ignore", frozen=True)

    def to_json(self) -> bytes:
        """Return the note as JSON bytes."""
        return self.model_dump_json(by_alias=True).encode()


class RecordingInfo(Note):
    """The attachment `recording.json`: what this recording is."""

    schema_: Annotated[Literal["recording/1"], Field(alias="schema")] = "recording/1"
    name: str
    site: str
    rig: str
    participant: str | None = None
    notes: str = ""
    started_utc_ns: int
    software: str
    """Name and version of what wrote it."""
    host: str = ""
    converter_steps: dict[str, FiniteFloat] = {}
    """By stream; in these steps counts are stored."""


class GapNote(Note):
    """Something that is missing, written where it would have stood."""

    utc_ns: int
    """When the recorder saw it."""
    stream: str
    """`force`, `accel`, `voltage`, `truth`, or the topic of a state."""
    run: int = 0
    """Of the block that follows the gap."""
    first_missing_sequence: int = 0
    missing_blocks: int
    """Or messages, of a state."""
    missing_samples: int = 0
    reason: Literal["lost", "overflow", "restart", "overrun", "unreadable"]
    detail: str = ""


class PresenceNote(Note):
    """The rig was there, appeared or vanished."""

    utc_ns: int
    present: bool


class StreamTotal(Note):
    """What was written of a stream."""

    blocks: int = 0
    samples: int = 0
    lost_blocks: int = 0


class EndNote(Note):
    """The last message of a recording that was ended rather than torn."""

    utc_ns: int
    reason: str
    streams: dict[str, StreamTotal]
    seconds: float | None = None
    """How long it was recorded, whatever was done to the clock; None: nobody said."""


NOTES: Final[dict[str, type[Note]]] = {
    GAPS: GapNote,
    PRESENCE: PresenceNote,
    END: EndNote,
}


HEAD: Final = struct.Struct("<BQ")
Inner = Schema | Channel | Message
T = TypeVar("T", DataEnd, Footer)
_RAISED: Final = (McapError, struct.error, ValueError, OverflowError)
"""What the `mcap` package raises on a record that is none."""


@dataclass(frozen=True, slots=True)
class RecordGroup:
    """A record of the file, or all records of a chunk.

    Attributes
    ----------
    end : int
        First byte after it.
    attachment : Attachment or None
        None: another record.
    inner : tuple of Schema, Channel or Message
        What the chunk holds.
    last : bool
        The file is finished, and its checksums agree.
    """

    end: int
    attachment: Attachment | None = None
    inner: tuple[Inner, ...] = ()
    last: bool = False


class RecordScanner:
    """Walks through a file from the beginning.

    Parameters
    ----------
    file : binary file
        At its first byte.
    size : int
        Its bytes.
    """

    def __init__(self, file: BinaryIO, size: int) -> None:
        self._file = file
        self._size = size
        self._offset = 0
        self._crc = 0

    def pieces(self) -> Iterator[RecordGroup]:
        """Yield what the file holds.

        Raises
        ------
        TornError
            At the first record that is not whole; all that was yielded before it is right.
        """
        magic = self._take(len(MCAP0_MAGIC))
        if magic == HDF5_MAGIC:
            raise TornError(0, "HDF5, no recording: frictus study show --check reads a study")
        if magic != MCAP0_MAGIC:
            raise TornError(
                0,
                "not an MCAP file: its first bytes are others (frictus study import makes a "
                "study of another program's recording)",
            )
        first = True
        while True:
            start, crc = self._offset, self._crc
            if start == self._size:
                raise TornError(start, "it was not ended, or is still being written")
            opcode, body = self._record()
            if first != (opcode == Opcode.HEADER):
                raise TornError(start, "a header belongs at the beginning, and only there")
            first = False
            if opcode == Opcode.DATA_END:
                yield self._finish(start, body, crc)
                return
            yield self._piece(start, opcode, body)

    def _take(self, count: int) -> bytes:
        missing = count - (self._size - self._offset)
        if missing > 0:  # known before so much memory is asked for
            raise TornError(self._offset, f"the file ends {missing} bytes early")
        content = self._file.read(count)
        if len(content) < count:
            raise TornError(self._offset, "the file was shortened while it was read")
        self._crc = zlib.crc32(content, self._crc)
        self._offset += count
        return content

    def _record(self) -> tuple[int, bytes]:
        start = self._offset
        try:
            opcode, length = HEAD.unpack(self._take(HEAD.size))
            return opcode, self._take(length)
        except TornError as error:
            raise TornError(start, error.reason) from None

    def _piece(self, start: int, opcode: int, body: bytes) -> RecordGroup:
        if opcode == Opcode.CHUNK:
            return RecordGroup(self._offset, inner=_records_of(start, body))
        if opcode == Opcode.ATTACHMENT:
            return RecordGroup(self._offset, attachment=_attachment(start, body))
        if opcode in (Opcode.HEADER, Opcode.MESSAGE_INDEX, Opcode.METADATA):
            return RecordGroup(self._offset)
        raise TornError(start, f"no record of kind {opcode} belongs here")

    def _finish(self, start: int, body: bytes, crc: int) -> RecordGroup:
        """Check what only a finished file has: the checksums of the whole, and the index."""
        end = _parsed(start, DataEnd, body)
        if end.data_section_crc != crc:
            raise TornError(start, "the checksum of all data before it does not agree")
        data_end = self._offset
        self._crc = 0
        while True:
            at, before = self._offset, self._crc
            opcode, body = self._record()
            if opcode == Opcode.FOOTER:
                break
        footer = _parsed(at, Footer, body)
        covered = HEAD.pack(Opcode.FOOTER, len(body)) + body[:16]
        if footer.summary_crc != zlib.crc32(covered, before):
            raise TornError(data_end, "the checksum of the index does not agree")
        if self._take(len(MCAP0_MAGIC)) != MCAP0_MAGIC or self._offset < self._size:
            raise TornError(data_end, "something else follows where the file should end")
        return RecordGroup(data_end, last=True)


def _parsed(start: int, kind: type[T], body: bytes) -> T:
    try:
        record: T = kind.read(ReadDataStream(BytesIO(body)))
    except _RAISED as error:
        raise TornError(start, f"{kind.__name__} cannot be read") from error
    return record


def _attachment(start: int, body: bytes) -> Attachment:
    if len(body) < 4 or zlib.crc32(body[:-4]) != struct.unpack("<I", body[-4:])[0]:
        raise TornError(start, "an attachment's checksum does not agree")
    try:
        attachment: Attachment = Attachment.read(ReadDataStream(BytesIO(body)))
    except _RAISED as error:
        raise TornError(start, "an attachment cannot be read") from error
    return attachment


def _records_of(start: int, body: bytes) -> tuple[Inner, ...]:
    """Return the records of a chunk whose checksum agrees."""
    try:
        chunk = Chunk.read(ReadDataStream(BytesIO(body)))
    except _RAISED as error:
        raise TornError(start, "a chunk's head cannot be read") from error
    if chunk.compression:
        raise TornError(start, f"chunks compressed by {chunk.compression!r} are not written")
    sound = (
        len(chunk.data) == chunk.uncompressed_size
        and zlib.crc32(chunk.data) == chunk.uncompressed_crc
    )
    if not sound:
        raise TornError(start, "a chunk's checksum does not agree")
    # From here on the content is what was written, though maybe not by a recorder.
    try:
        return tuple(_inner(start, chunk.data))
    except TornError:
        raise
    except _RAISED as error:
        raise TornError(start, "a record of a chunk cannot be read") from error


def _inner(start: int, content: bytes) -> Iterator[Inner]:
    at = 0
    while at < len(content):
        opcode, length = HEAD.unpack_from(content, at)
        at += HEAD.size
        stream = ReadDataStream(BytesIO(content[at : at + length]))
        at += length
        if opcode == Opcode.MESSAGE:
            yield Message.read(stream, length)
        elif opcode == Opcode.CHANNEL:
            yield Channel.read(stream)
        elif opcode == Opcode.SCHEMA:
            yield Schema.read(stream)
        else:
            raise TornError(start, f"a chunk holds a record of kind {opcode}")

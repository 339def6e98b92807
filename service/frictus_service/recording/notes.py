"""What a recorder writes down beside what it was sent: gaps, presence, the end."""

from typing import Annotated, Final, Literal

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat

from frictus.keys import STREAMS

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


NOTES: Final[dict[str, type[Note]]] = {
    GAPS: GapNote,
    PRESENCE: PresenceNote,
    END: EndNote,
}

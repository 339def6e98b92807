"""Frames of Neonode zForce touch sensors: bytes to messages, requests to bytes.

ASN.1 DER: a type byte, a length, the address of a device, then one command. Source: the zForce
message specification of the Neonode touch sensor module user's guide. Whatever arrives becomes
a message; nothing raises.
"""

from dataclasses import dataclass
from enum import IntEnum
from typing import Final

REQUEST: Final = 0xEE
RESPONSE: Final = 0xEF
NOTIFICATION: Final = 0xF0
FRAME_TYPES: Final = (REQUEST, RESPONSE, NOTIFICATION)

ADDRESS_TAG: Final = b"\x40\x02"
SENSOR: Final = b"\x02\x00"

TOUCHES_TAG: Final = 0xA0
TOUCH_TAG: Final = 0x42
TIMESTAMP_TAG: Final = 0x58
BOOT_COMPLETE_TAG: Final = 0x63
ENABLE_TAG: Final = 0x65
OPERATION_MODE_TAG: Final = 0x67
TOUCH_BYTES: Final = (8, 9)
"""Without and with the byte that firmware before 2.0 sends last."""
TICKS_BYTES: Final = (1, 2, 3)
LONGEST_FRAME: Final = 3 + 255


class TouchEvent(IntEnum):
    """What a finger did."""

    DOWN = 0
    MOVE = 1
    UP = 2


@dataclass(frozen=True, slots=True)
class Touch:
    """One finger in a report; `x`, `y` in the counts of the sensor, 0.1 mm as delivered."""

    finger: int
    event: TouchEvent
    x: int
    y: int


@dataclass(frozen=True, slots=True)
class Touches:
    """A touch notification; `ticks` are 16 bits of a 32768 Hz counter, None if not sent."""

    touches: tuple[Touch, ...]
    ticks: int | None


@dataclass(frozen=True, slots=True)
class BootComplete:
    """The sensor has started; it must be set up and enabled again."""


@dataclass(frozen=True, slots=True)
class ZForceReply:
    """The answer to a request: the tag of its command, and what it holds."""

    tag: int
    content: bytes


@dataclass(frozen=True, slots=True)
class Unknown:
    """A well-formed frame with something that is not known here."""

    data: bytes
    what: str


@dataclass(frozen=True, slots=True)
class Malformed:
    """Bytes that are no frame, or one cut short."""

    data: bytes
    why: str


Message = Touches | BootComplete | ZForceReply | Unknown | Malformed


def request(command: bytes) -> bytes:
    """Return a request to the sensor.

    Parameters
    ----------
    command : bytes
        One command in DER, at most 123 bytes.
    """
    body = ADDRESS_TAG + SENSOR + command
    return bytes([REQUEST, len(body)]) + body


ENABLE: Final = request(bytes([ENABLE_TAG, 3, 0x81, 1, 0]))
DISABLE: Final = request(bytes([ENABLE_TAG, 2, 0x80, 0]))
DETECTION_MODE: Final = request(
    bytes([OPERATION_MODE_TAG, 15, 0x80, 1, 0xFF])
    + b"".join(bytes([tag, 1, 0]) for tag in (0x81, 0x82, 0x83, 0x84))
)
"""Touches come as frames. Over USB the sensor starts as a touch screen of the system."""


class FrameReader:
    """Cuts a stream of bytes into messages, and finds its way back after damage.

    Zeros between frames are padding. Anything else that is no frame is told as `Malformed`.
    """

    def __init__(self) -> None:
        self._bytes = bytearray()

    @property
    def pending(self) -> bool:
        """Whether a frame has begun and not ended."""
        return bool(self._bytes)

    def feed(self, data: bytes) -> tuple[Message, ...]:
        """Return the messages that are complete with these bytes.

        Parameters
        ----------
        data : bytes
            In pieces of any size.
        """
        self._bytes += data
        return self._run(last=False)

    def flush(self) -> tuple[Message, ...]:
        """Give up the frame that has begun; return what is found in its bytes."""
        return self._run(last=True)

    def _run(self, last: bool) -> tuple[Message, ...]:
        messages: list[Message] = []
        bad, why = bytearray(), ""
        while self._bytes:
            try:
                taken, message = _frame(bytes(self._bytes[:LONGEST_FRAME]))
            except _NeedMoreError as error:
                if not last:
                    break
                taken, message = 1, Malformed(b"", str(error))
            if isinstance(message, Malformed):
                if bad or self._bytes[0]:
                    why = why or message.why
                    bad += self._bytes[:taken]
            else:
                _tell_bad(messages, bad, why)
                bad, why = bytearray(), ""
                messages.append(message)
            del self._bytes[:taken]
        _tell_bad(messages, bad, why)
        return tuple(messages)


def _tell_bad(messages: list[Message], bad: bytearray, why: str) -> None:
    if bad:
        messages.append(Malformed(bytes(bad).rstrip(b"\0"), why))


class _NeedMoreError(Exception):
    """The frame goes on beyond the bytes that are there."""


class _DamagedError(Exception):
    """The bytes contradict each other."""


def _frame(data: bytes) -> tuple[int, Message]:
    """Return the bytes of the first frame, and its message; of damage, one byte.

    Only one, because a damaged length may have swallowed sound frames.
    """
    if data[0] not in FRAME_TYPES:
        return 1, Malformed(data[:1], "no frame begins here")
    try:
        start, end = _extent(data, 0)
        if end - start < 4:
            raise _DamagedError("a frame is too short for an address")
        if not ADDRESS_TAG.startswith(data[start : start + 2]):
            raise _DamagedError("a frame does not begin with an address")
        if end > len(data):
            raise _NeedMoreError("a frame was cut short")
        return end, _message(data[:end], start + 4)
    except _DamagedError as error:
        return 1, Malformed(data[:1], str(error))


def _extent(data: bytes, at: int) -> tuple[int, int]:
    """Return where the content of an element begins and ends."""
    if at + 1 >= len(data):
        raise _NeedMoreError("a frame was cut short")
    length = data[at + 1]
    if length < 0x80:
        return at + 2, at + 2 + length
    if length != 0x81:
        raise _DamagedError("a length is beyond 255")
    if at + 2 >= len(data):
        raise _NeedMoreError("a frame was cut short")
    return at + 3, at + 3 + data[at + 2]


def _elements(data: bytes) -> list[tuple[int, bytes]]:
    """Return tag and content of each element; together they must fill the bytes."""
    found, at = [], 0
    while at < len(data):
        try:
            start, end = _extent(data, at)
        except _NeedMoreError as error:
            raise _DamagedError("an element goes beyond its frame") from error
        if end > len(data):
            raise _DamagedError("an element goes beyond its frame")
        if data[at] in FRAME_TYPES:
            raise _DamagedError("a frame begins within a frame")
        found.append((data[at], data[start:end]))
        at = end
    return found


def _message(frame: bytes, body_at: int) -> Message:
    elements = _elements(frame[body_at:])
    if not elements:
        return Unknown(frame, "a frame without a command")
    tag, content = elements[0]
    if frame[0] == RESPONSE:
        return ZForceReply(tag, content)
    if frame[0] == NOTIFICATION and tag == BOOT_COMPLETE_TAG:
        return BootComplete()
    if frame[0] == NOTIFICATION and tag == TOUCHES_TAG:
        return _touches(frame, _elements(content) + elements[1:])
    return Unknown(frame, f"type {frame[0]:02X} with command {tag:02X}")


def _touches(frame: bytes, elements: list[tuple[int, bytes]]) -> Message:
    touches: list[Touch] = []
    ticks = None
    for tag, content in elements:
        if tag == TIMESTAMP_TAG and len(content) in TICKS_BYTES:
            ticks = int.from_bytes(content, "big") & 0xFFFF
        elif tag != TOUCH_TAG:
            return Unknown(frame, f"element {tag:02X} among touches")
        elif len(content) not in TOUCH_BYTES:
            return Unknown(frame, f"a touch of {len(content)} bytes; 8 and 9 are known")
        elif content[1] not in TouchEvent.__members__.values():
            return Unknown(frame, f"touch event {content[1]}; 0, 1 and 2 are known")
        else:
            touches.append(
                Touch(
                    finger=content[0],
                    event=TouchEvent(content[1]),
                    x=int.from_bytes(content[2:4], "big"),
                    y=int.from_bytes(content[4:6], "big"),
                )
            )
    return Touches(tuple(touches), ticks)

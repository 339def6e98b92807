"""Frames of the touch sensor, from byte vectors of its documentation and from damage."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.hardware.sensors.frames import BOOT, touch_frame

from frictus_hardware.sensors.zforce import (
    DETECTION_MODE,
    DISABLE,
    ENABLE,
    BootComplete,
    FrameReader,
    Malformed,
    Message,
    Touch,
    Touches,
    TouchEvent,
    Unknown,
    ZForceReply,
)

TOUCH_WITH_JJ = bytes.fromhex(
    "F0 15 40 02 02 00 A0 0F 42 09 05 01 01 2C 02 A0 1E 14 64 58 02 80 10"
)
TOUCH_WITHOUT_JJ = bytes.fromhex(
    "F0 14 40 02 02 00 A0 0E 42 08 05 01 01 2C 02 A0 1E 14 58 02 80 10"
)
TOUCH_WITHOUT_TIME = bytes.fromhex("F0 11 40 02 02 00 A0 0B 42 09 05 00 01 2C 02 A0 1E 14 64")
MOVED = Touches((Touch(5, TouchEvent.MOVE, 300, 672),), 0x8010)


def read(data: bytes) -> tuple[Message, ...]:
    return FrameReader().feed(data)


def test_requests_are_the_bytes_of_the_documentation() -> None:
    assert bytes.fromhex("EE 09 40 02 02 00 65 03 81 01 00") == ENABLE
    assert bytes.fromhex("EE 08 40 02 02 00 65 02 80 00") == DISABLE
    assert DETECTION_MODE == bytes.fromhex(
        "EE 15 40 02 02 00 67 0F 80 01 FF 81 01 00 82 01 00 83 01 00 84 01 00"
    )


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (TOUCH_WITH_JJ, MOVED),
        (TOUCH_WITHOUT_JJ, MOVED),
        (TOUCH_WITHOUT_TIME, Touches((Touch(5, TouchEvent.DOWN, 300, 672),), None)),
        (BOOT, BootComplete()),
        (bytes.fromhex("EF 09 40 02 02 00 65 03 81 01 00"), ZForceReply(0x65, b"\x81\x01\x00")),
        (bytes.fromhex("EF 08 40 02 02 00 65 02 80 00"), ZForceReply(0x65, b"\x80\x00")),
    ],
)
def test_byte_vectors(data: bytes, message: Message) -> None:
    assert read(data) == (message,)
    assert read(data + bytes(64 - len(data))) == (message,)


fingers = st.lists(
    st.tuples(
        st.integers(0, 255),
        st.sampled_from([0, 1, 2]),
        st.integers(0, 0xFFFF),
        st.integers(0, 0xFFFF),
    ),
    min_size=1,
    max_size=16,
)


@settings(max_examples=30)
@given(fingers, st.none() | st.integers(0, 0xFFFF), st.sampled_from([8, 9]))
def test_any_number_of_fingers_in_either_firmware(
    some: list[tuple[int, int, int, int]], ticks: int | None, record: int
) -> None:
    touches = tuple(Touch(finger, TouchEvent(event), x, y) for finger, event, x, y in some)
    assert read(touch_frame(some, ticks, record)) == (Touches(touches, ticks),)


@given(st.lists(st.integers(1, 30), max_size=12), st.integers(0, 9))
def test_how_the_bytes_are_cut_does_not_matter(cuts: list[int], padding: int) -> None:
    stream = bytes(padding).join([BOOT, TOUCH_WITH_JJ, TOUCH_WITHOUT_JJ, BOOT])
    reader, at = FrameReader(), 0
    messages: list[Message] = []
    for cut in [*cuts, len(stream)]:
        messages += reader.feed(stream[at : at + cut])
        at += cut
    assert messages == [BootComplete(), MOVED, MOVED, BootComplete()]
    assert not reader.pending


@pytest.mark.parametrize(
    ("data", "what"),
    [
        (bytes.fromhex("F0 07 40 02 02 00 63 01 00").replace(b"\x63", b"\x6b"), "command 6B"),
        (bytes.fromhex("F0 04 40 02 02 00"), "without a command"),
        (ENABLE, "type EE"),
        (touch_frame([(1, 3, 10, 10)], 1, 9), "event 3"),
        (touch_frame([(1, 0, 10, 10)], 1, 10), "of 10 bytes"),
        (touch_frame([(1, 0, 10, 10)], 1, 9).replace(b"\x42", b"\x43"), "element 43"),
        (bytes.fromhex("F0 08 40 02 02 00 A0 02 58 00"), "element 58"),
    ],
)
def test_what_is_sound_but_unknown_is_told_and_passed(data: bytes, what: str) -> None:
    unknown, sound = read(data + TOUCH_WITH_JJ)
    assert isinstance(unknown, Unknown)
    assert unknown.data == data
    assert what in unknown.what
    assert sound == MOVED


@pytest.mark.parametrize(
    ("data", "why"),
    [
        (b"\x01\x02\x03", "no frame begins"),
        (b"\xf0\x82\x01\x00", "beyond 255"),
        (b"\xf0\x02\x40\x02", "too short"),
        (b"\xf0\x09\x41\x02\x02\x00", "does not begin with an address"),
        (bytes.fromhex("F0 08 40 02 02 00 63 09 80 01"), "beyond its frame"),
        (bytes.fromhex("F0 05 40 02 02 00 63"), "beyond its frame"),
        (TOUCH_WITH_JJ.replace(b"\x42\x09", b"\x42\x50"), "beyond its frame"),
    ],
)
def test_damage_is_told_and_the_next_frame_is_found(data: bytes, why: str) -> None:
    malformed, sound = read(data + TOUCH_WITH_JJ)
    assert isinstance(malformed, Malformed)
    assert malformed.data == data.rstrip(b"\0")
    assert why in malformed.why
    assert sound == MOVED


def test_a_frame_cut_short_is_kept_until_given_up() -> None:
    for length in range(1, len(TOUCH_WITH_JJ)):
        reader = FrameReader()
        assert reader.feed(TOUCH_WITH_JJ[:length]) == ()
        assert reader.pending
        (malformed,) = reader.flush()
        assert isinstance(malformed, Malformed)
        assert malformed.why == "a frame was cut short"
        assert reader.feed(TOUCH_WITH_JJ) == (MOVED,)


def test_frames_that_a_damaged_length_swallowed_come_back() -> None:
    swallowing = b"\xf0\x7f" + TOUCH_WITH_JJ[2:]
    reader = FrameReader()
    assert reader.feed(swallowing + TOUCH_WITH_JJ) == ()
    assert reader.flush()[1:] == (MOVED,)
    messages = reader.feed(swallowing + 6 * TOUCH_WITH_JJ)
    assert [message for message in messages if message == MOVED] == 6 * [MOVED]


@given(st.binary(max_size=400), st.lists(st.integers(0, 50), max_size=10))
def test_no_bytes_whatever_raise_or_block_a_later_frame(noise: bytes, cuts: list[int]) -> None:
    reader, at = FrameReader(), 0
    for cut in [*cuts, len(noise)]:
        reader.feed(noise[at : at + cut])
        at += cut
    reader.flush()
    assert not reader.pending
    assert reader.feed(TOUCH_WITH_JJ) == (MOVED,)


@pytest.mark.parametrize("at", range(len(TOUCH_WITH_JJ)))
def test_one_damaged_byte_never_hides_the_frames_around_it(at: int) -> None:
    for value in range(256):
        damaged = bytearray(TOUCH_WITH_JJ)
        damaged[at] = value
        reader = FrameReader()
        messages = reader.feed(BOOT + bytes(damaged) + BOOT) + reader.flush()
        assert messages[0] == messages[-1] == BootComplete(), hex(value)

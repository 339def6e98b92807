"""Frames as the touch sensor sends them."""

from typing import Final

from frictus_hardware.sensors.zforce import DETECTION_MODE, ENABLE

DOWN: Final = 0
MOVE: Final = 1
UP: Final = 2

BOOT: Final = bytes.fromhex("F0 11 40 02 00 00 63 0B 80 01 00 81 02 03 00 82 02 00 00")
MODE_SET: Final = b"\xef" + DETECTION_MODE[1:]
ENABLED: Final = b"\xef" + ENABLE[1:]


def frame(kind: int, body: bytes) -> bytes:
    """An element with its length, in the long form where it must be."""
    long = bytes([0x81]) if len(body) > 127 else b""
    return bytes([kind]) + long + bytes([len(body)]) + body


def touch_frame(
    fingers: list[tuple[int, int, int, int]], ticks: int | None = None, record: int = 9
) -> bytes:
    """A notification of (finger, event, x, y); `record` bytes for each."""
    inner = b"".join(
        bytes([0x42, record, finger, event])
        + x.to_bytes(2, "big")
        + y.to_bytes(2, "big")
        + bytes(record - 6)
        for finger, event, x, y in fingers
    )
    if ticks is not None:
        inner += b"\x58\x02" + ticks.to_bytes(2, "big")
    return frame(0xF0, b"\x40\x02\x02\x00" + frame(0xA0, inner))


def touch(event: int, x: int, finger: int = 1, ticks: int | None = None) -> bytes:
    """A notification of one finger, 200 counts up."""
    return touch_frame([(finger, event, x, 200)], ticks)

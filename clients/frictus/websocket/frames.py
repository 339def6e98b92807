"""The binary frames of the live connection: columns of samples, states of the finger.

`docs/websocket.md` specifies them byte by byte.
"""

import math
import struct
from dataclasses import dataclass
from enum import IntEnum, IntFlag
from typing import Final, Self

import numpy as np
from numpy.typing import NDArray

from frictus.block import FLOAT32, MAX_CHANNELS
from frictus.errors import FrameError
from frictus.keys import STREAMS

VERSION: Final = 1
HEADER: Final = struct.Struct("<HHHHIIQQdIIQ")
HEADER_BYTES: Final = HEADER.size
FINGER_STREAM: Final = 100
"""Of the finger's states; `frictus.keys.STREAMS` are samples at a constant rate."""
FINGER_ROWS: Final = (
    "samples_since_first",
    "x_mm",
    "y_mm",
    "vx_mm_s",
    "vy_mm_s",
    "normal_force_n",
    "age_ms",
    "flags",
)
"""What the rows of such a frame are."""


class Kind(IntEnum):
    """What a column holds."""

    RAW = 0
    """One sample per channel."""
    EXTREMES = 1
    """Minimum and maximum, per channel, of `samples_per_column` samples."""
    FINGER = 2
    """One state of the finger; its rows are `FINGER_ROWS`."""


class FingerFlag(IntFlag):
    """Bits of the row `flags`."""

    IN_CONTACT = 1
    STALE = 1 << 1
    EXTRAPOLATED = 1 << 2


@dataclass(frozen=True, slots=True)
class Frame:
    """Columns of one stream that follow one another without a gap.

    Attributes
    ----------
    stream : int
        Which stream, a key of `frictus.keys.STREAMS`.
    flags : int
        Low 16 bits of the flags of all blocks in it, `frictus.block.Flag`.
    run : int
        Of the rig; sample counts begin again with it.
    first_sample : int
        Device index of the first sample.
    lost_samples : int
        Missing between the frame before of this stream and this one, in the same run.
    sample_rate_hz : float
        Nominal rate of the device clock.
    samples_per_column : int
        Samples that each column stands for, at least 1; 1 if raw.
    kind : Kind
        What `data` holds.
    utc_ns : int
        UTC of the first sample, by the rig's clock.
    data : ndarray of float32
        Extremes: (n_channels, 2, n_columns), minima first; else (n_channels, n_columns).
    """

    stream: int
    flags: int
    run: int
    first_sample: int
    lost_samples: int
    sample_rate_hz: float
    samples_per_column: int
    kind: Kind
    utc_ns: int
    data: NDArray[np.float32]

    @property
    def columns(self) -> int:
        """Number of columns."""
        return int(self.data.shape[-1])

    @property
    def next_sample(self) -> int:
        """Device index of the sample behind the last one."""
        return self.first_sample + self.columns * self.samples_per_column

    def pack(self) -> bytes:
        """Return the bytes.

        Raises
        ------
        FrameError
            If a field of the header does not fit its place.
        """
        try:
            header = HEADER.pack(
                VERSION,
                self.stream,
                len(self.data),
                self.flags & 0xFFFF,
                self.run,
                self.columns,
                self.first_sample,
                self.lost_samples,
                self.sample_rate_hz,
                self.samples_per_column,
                self.kind,
                self.utc_ns,
            )
        except struct.error as error:
            raise FrameError(f"a field of the header is out of range: {error}") from error
        return header + np.ascontiguousarray(self.data, dtype=FLOAT32).tobytes()

    @classmethod
    def unpack(cls, frame: bytes) -> Self:
        """Read a frame.

        Parameters
        ----------
        frame : bytes
            As it came.

        Raises
        ------
        FrameError
            If it is not one of this version.
        """
        if len(frame) < HEADER_BYTES:
            raise FrameError(f"{len(frame)} bytes: the header alone takes {HEADER_BYTES}")
        (
            version,
            stream,
            channels,
            flags,
            run,
            columns,
            first_sample,
            lost_samples,
            sample_rate_hz,
            samples_per_column,
            kind,
            utc_ns,
        ) = HEADER.unpack_from(frame)
        if version != VERSION:
            raise FrameError(f"frame version {version}: this reader knows {VERSION}")
        if kind not in Kind.__members__.values():
            raise FrameError(f"kind {kind}: 0 (raw), 1 (extremes), 2 (finger) are known")
        if not 1 <= channels <= MAX_CHANNELS:
            raise FrameError(f"{channels} channels: 1 to {MAX_CHANNELS} accepted")
        shape = (channels, 2, columns) if kind == Kind.EXTREMES else (channels, columns)
        expected = HEADER_BYTES + 4 * math.prod(shape)
        if len(frame) != expected:
            raise FrameError(f"{len(frame)} bytes: data of shape {shape} take {expected}")
        data = np.frombuffer(frame, dtype=FLOAT32, offset=HEADER_BYTES).reshape(shape)
        return cls(
            stream,
            flags,
            run,
            first_sample,
            lost_samples,
            sample_rate_hz,
            samples_per_column,
            Kind(kind),
            utc_ns,
            data,
        )


def is_known(frame: bytes) -> bool:
    """Return whether a frame may be of this version: later ones have further kinds.

    Parameters
    ----------
    frame : bytes
        As it came; a frame that is torn is left to `Frame.unpack`.
    """
    if len(frame) < HEADER_BYTES:
        return True
    stream, kind = HEADER.unpack_from(frame)[1], HEADER.unpack_from(frame)[10]
    return kind == Kind.FINGER or (kind < Kind.FINGER and stream in STREAMS)

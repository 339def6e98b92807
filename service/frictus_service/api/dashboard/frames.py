"""The binary frame: samples of one stream for a page. Little-endian; `docs/live.md` has it."""

import math
import struct
from dataclasses import dataclass
from enum import IntEnum
from typing import Final, Self

import numpy as np
from numpy.typing import NDArray

from frictus.block import FLOAT32, MAX_CHANNELS
from frictus_service.errors import ServiceError

VERSION: Final = 1
HEADER: Final = struct.Struct("<HHHHIIQQdIIQ")
HEADER_BYTES: Final = HEADER.size


class LiveFrameError(ServiceError, ValueError):
    """Bytes are not a frame of the live connection; the text says which field and why."""


class Kind(IntEnum):
    """What a column holds."""

    RAW = 0
    """One sample per channel."""
    EXTREMES = 1
    """Minimum and maximum, per channel, of `samples_per_column` samples."""


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
        Raw: (n_channels, n_columns); extremes: (n_channels, 2, n_columns), minima first.
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
        LiveFrameError
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
            raise LiveFrameError(f"a field of the header is out of range: {error}") from error
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
        LiveFrameError
            If it is not one of this version.
        """
        if len(frame) < HEADER_BYTES:
            raise LiveFrameError(f"{len(frame)} bytes: the header alone takes {HEADER_BYTES}")
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
            raise LiveFrameError(f"frame version {version}: this reader knows {VERSION}")
        if kind not in Kind.__members__.values():
            raise LiveFrameError(f"kind {kind}: 0 (raw) and 1 (extremes) are known")
        if not 1 <= channels <= MAX_CHANNELS:
            raise LiveFrameError(f"{channels} channels: 1 to {MAX_CHANNELS} accepted")
        shape = (channels, columns) if kind == Kind.RAW else (channels, 2, columns)
        expected = HEADER_BYTES + 4 * math.prod(shape)
        if len(frame) != expected:
            raise LiveFrameError(f"{len(frame)} bytes: data of shape {shape} take {expected}")
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

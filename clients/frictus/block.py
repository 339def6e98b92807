"""The stream block: 64 bytes of header, then channel-major float32, all little-endian.

`docs/protocol.md` specifies it byte by byte, with test vectors.
"""

import struct
from dataclasses import dataclass
from enum import IntFlag
from typing import Final

import numpy as np
from numpy.typing import NDArray

from frictus.errors import FrameError
from frictus.keys import CHANNELS

MAGIC: Final = b"FRIC"
VERSION: Final = 1
HEADER: Final = struct.Struct("<4sHHHHIQQqQdII")
HEADER_BYTES: Final = HEADER.size
FLOAT32: Final = np.dtype("<f4")
MAX_CHANNELS: Final = 64
MAX_SAMPLES: Final = 65_535
MAX_FIRST_SAMPLE: Final = 2**62
"""Of a stream, so that counts of samples fit in 64 bits with a sign."""


class Flag(IntFlag):
    """What a block says of itself. A new flag takes a new bit; old ones never move."""

    ARMED = 1
    CLIPPED = 1 << 1
    SCALED = 1 << 2
    EXTRAPOLATED = 1 << 3
    OVERRUN = 1 << 4
    UNDERRUN = 1 << 5
    SIMULATED = 1 << 6
    STALE_SENSOR = 1 << 7
    PLACEHOLDER_MODEL = 1 << 8
    SUBSTITUTE_SENSOR = 1 << 9
    """Position comes from a declared stand-in, such as the pointer."""
    SATURATED = 1 << 10
    """An acceleration or a further channel was at the end of its range."""


class FingerSensor(IntFlag):
    """What the rendered motion is estimated from; channel `sensors` of the stream `render`."""

    TOUCH = 1
    ACCELERATION = 1 << 1
    """Of the nail."""
    FORCE = 1 << 2
    """Contact is where the force says so, else where the touch sensor does."""


@dataclass(frozen=True, slots=True)
class Block:
    """Samples of one stream.

    Attributes
    ----------
    stream : int
        Which stream, a key of `frictus.keys.STREAMS`.
    run : int
        Changes when the rig starts anew; sequence and sample counts begin again with it.
    sequence : int
        Counts the blocks of this stream from 0; a jump is a gap.
    first_sample : int
        Device index of the first sample.
    utc_ns, uncertainty_ns : int
        UTC of the first sample, and how far it may be off (95 %).
    sample_rate_hz : float
        Nominal rate of the device clock.
    flags : Flag
        What a reader must know of these samples.
    data : ndarray of float32, shape (n_channels, n_samples)
        The samples, in the unit of the stream.
    """

    stream: int
    run: int
    sequence: int
    first_sample: int
    utc_ns: int
    uncertainty_ns: int
    sample_rate_hz: float
    flags: Flag
    data: NDArray[np.float32]

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the rows of `data`, with their units; empty for the stream `aux`."""
        return CHANNELS.get(self.stream, ())

    @property
    def time_s(self) -> NDArray[np.float64]:
        """Seconds of the device's clock since its sample 0, shape (n_samples,)."""
        samples = self.first_sample + np.arange(self.data.shape[1])
        time_s: NDArray[np.float64] = samples / self.sample_rate_hz
        return time_s

    def pack(self) -> bytes:
        """Return the frame.

        Raises
        ------
        FrameError
            If the data are not (1 to 64 channels, 0 to 65535 samples), or a field of the
            header does not fit its place.
        """
        data = np.ascontiguousarray(self.data, dtype=FLOAT32)
        if data.ndim != 2 or not 1 <= len(data) <= MAX_CHANNELS:
            raise FrameError(f"data of shape {data.shape}: 1 to 64 channels by samples")
        channels, samples = data.shape
        if samples > MAX_SAMPLES:
            raise FrameError(f"{samples} samples: at most {MAX_SAMPLES} fit in a block")
        if not 0.0 < self.sample_rate_hz < 1e9:  # refuses NaN too
            raise FrameError(f"sample rate {self.sample_rate_hz} Hz: positive and finite only")
        try:
            header = HEADER.pack(
                MAGIC,
                VERSION,
                self.stream,
                channels,
                samples,
                self.run,
                self.sequence,
                self.first_sample,
                self.utc_ns,
                self.uncertainty_ns,
                self.sample_rate_hz,
                self.flags,
                0,
            )
        except struct.error as error:
            raise FrameError(f"a header field does not fit: {error}") from error
        return b"".join((header, data.data))

    @classmethod
    def unpack(cls, frame: bytes) -> "Block":
        """Read a frame.

        Parameters
        ----------
        frame : bytes
            Header and data, nothing more.

        Raises
        ------
        FrameError
            If the frame is torn, of another version, or not a block at all.
        """
        if len(frame) < HEADER_BYTES:
            raise FrameError(f"{len(frame)} bytes: a block has a header of {HEADER_BYTES}")
        (
            magic,
            version,
            stream,
            channels,
            samples,
            run,
            sequence,
            first_sample,
            utc_ns,
            uncertainty_ns,
            sample_rate_hz,
            flags,
            _reserved,
        ) = HEADER.unpack_from(frame)
        if magic != MAGIC:
            raise FrameError(f"magic {magic!r}: a block begins with {MAGIC!r}")
        if version != VERSION:
            raise FrameError(f"block version {version}: this reader knows {VERSION}; update it")
        if not 1 <= channels <= MAX_CHANNELS:
            raise FrameError(f"{channels} channels: 1 to {MAX_CHANNELS} accepted")
        if not 0.0 < sample_rate_hz < 1e9:  # refuses NaN too
            raise FrameError(f"sample rate {sample_rate_hz} Hz: must be positive and finite")
        expected = HEADER_BYTES + 4 * channels * samples
        if len(frame) != expected:
            raise FrameError(
                f"{len(frame)} bytes: {channels} channels of {samples} samples take {expected}"
            )
        data = np.frombuffer(frame, dtype="<f4", offset=HEADER_BYTES).reshape(channels, samples)
        return cls(
            stream,
            run,
            sequence,
            first_sample,
            utc_ns,
            uncertainty_ns,
            sample_rate_hz,
            Flag(flags),
            data,
        )

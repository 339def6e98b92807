"""Blocks of 5 ms become messages of samples of up to 100 ms, which have a header of 72 bytes.

`docs/recording.md` specifies it byte by byte.
"""

import struct
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from frictus.block import MAX_CHANNELS, MAX_FIRST_SAMPLE, Block, Flag
from frictus.block import MAX_SAMPLES as MAX_BLOCK_SAMPLES
from frictus_service.errors import RecordingError

VERSION: Final = 1
INT16, FLOAT32 = 1, 2
HEADER: Final = struct.Struct("<HHHHIIQQIIqQdd")
MAX_SAMPLES: Final = 1 << 24
MAX_COUNT: Final = 32_767
DTYPES: Final[dict[int, np.dtype[Any]]] = {INT16: np.dtype("<i2"), FLOAT32: np.dtype("<f4")}


@dataclass(frozen=True, slots=True)
class Samples:
    """Consecutive samples of one stream; nothing is missing between the first and the last.

    Attributes
    ----------
    stream : int
        A key of `frictus.keys.STREAMS`.
    run : int
        Of the rig; sample counts begin again with it.
    first_sequence, blocks : int
        Which blocks of the stream these are.
    first_sample : int
        Device index of the first sample.
    utc_ns, uncertainty_ns : int
        Of the first sample.
    sample_rate_hz : float
        Samples per second of the device's clock.
    flags : Flag
        Hold for every sample.
    data : ndarray of float32, shape (n_channels, n_samples)
        In the unit of the stream.
    """

    stream: int
    run: int
    first_sequence: int
    blocks: int
    first_sample: int
    utc_ns: int
    uncertainty_ns: int
    sample_rate_hz: float
    flags: Flag
    data: NDArray[np.float32]

    @property
    def end_sample(self) -> int:
        """Device index one past the last sample."""
        return self.first_sample + int(self.data.shape[1])

    @property
    def duration_s(self) -> float:
        """Length by the device's clock."""
        return (self.end_sample - self.first_sample) / self.sample_rate_hz

    def block(self) -> Block:
        """Return the samples as one block of their stream."""
        return Block(
            self.stream,
            self.run,
            self.first_sequence,
            self.first_sample,
            self.utc_ns,
            self.uncertainty_ns,
            self.sample_rate_hz,
            self.flags,
            self.data,
        )

    def pack(self, step: float | None) -> bytes:
        """Return the message.

        Parameters
        ----------
        step : float or None
            Of the converter, in the stream's unit. Counts are stored where they give back every
            sample exactly, float32 otherwise.
        """
        counts = None if step is None else counts_of(self.data, step)
        stored = self.data if counts is None else counts
        channels, samples = self.data.shape
        header = HEADER.pack(
            VERSION,
            self.stream,
            channels,
            FLOAT32 if counts is None else INT16,
            self.run,
            samples,
            self.first_sequence,
            self.first_sample,
            self.blocks,
            self.flags,
            self.utc_ns,
            self.uncertainty_ns,
            self.sample_rate_hz,
            1.0 if counts is None or step is None else step,
        )
        return header + stored.tobytes()

    @classmethod
    def unpack(cls, message: bytes) -> "Samples":
        """Read a message.

        Raises
        ------
        RecordingError
            If it is not one, or of a version that this reader does not know.
        """
        if len(message) < HEADER.size:
            raise RecordingError(
                f"{len(message)} bytes: the header of samples has {HEADER.size}"
            )
        (
            version,
            stream,
            channels,
            form,
            run,
            samples,
            first_sequence,
            first_sample,
            blocks,
            flags,
            utc_ns,
            uncertainty_ns,
            sample_rate_hz,
            step,
        ) = HEADER.unpack_from(message)
        if version != VERSION:
            raise RecordingError(f"samples of version {version}: this reader knows {VERSION}")
        if form not in DTYPES or not 1 <= channels <= MAX_CHANNELS or samples > MAX_SAMPLES:
            raise RecordingError(f"form {form} with {channels} channels of {samples} samples")
        if not (0.0 < sample_rate_hz < 1e9 and 0.0 < step < 1e9):  # refuses NaN too
            raise RecordingError(f"{sample_rate_hz} Hz in steps of {step}")
        if first_sample > MAX_FIRST_SAMPLE:
            raise RecordingError(f"first sample {first_sample}: no rig counts so")
        dtype = DTYPES[form]
        expected = HEADER.size + dtype.itemsize * channels * samples
        if len(message) != expected:
            raise RecordingError(f"{len(message)} bytes of samples; the header says {expected}")
        stored = np.frombuffer(message, dtype, offset=HEADER.size).reshape(channels, samples)
        data = values_of(stored, step) if form == INT16 else stored
        return cls(
            stream,
            run,
            first_sequence,
            blocks,
            first_sample,
            utc_ns,
            uncertainty_ns,
            sample_rate_hz,
            Flag(flags),
            data,
        )


def values_of(counts: NDArray[np.int16], step: float) -> NDArray[np.float32]:
    """Return what a converter's counts stand for, in the stream's unit."""
    return (counts * np.float64(step)).astype(np.float32)


def counts_of(data: NDArray[np.float32], step: float) -> NDArray[np.int16] | None:
    """Return the counts behind samples; None where counts do not give back every one of them.

    Parameters
    ----------
    data : ndarray of float32
        Shape (n_channels, n_samples).
    step : float
        Value of one count, above 0.
    """
    counts = np.rint(data / np.float64(step))
    if not np.all(np.abs(counts) <= MAX_COUNT):  # NaN compares false
        return None
    whole = counts.astype("<i2")
    return whole if np.array_equal(values_of(whole, step), data) else None


MESSAGE_S: Final = 0.1
"""Longest message, unless one block is longer; none has more than `MAX_BLOCK_SAMPLES`."""
UTC_NS: Final = 1_000_000
"""How far a block's UTC may be off the one before it plus its length: more is a step."""


class Coalescer:
    """Collects the blocks of one stream.

    Attributes
    ----------
    held_samples : int
        Samples waiting for company.
    """

    def __init__(self) -> None:
        self._held: list[Block] = []
        self.held_samples = 0

    def add(self, block: Block) -> list[Samples]:
        """Take a block and return the messages that are finished by it."""
        finished = []
        samples = block.data.shape[1]
        most = min(MESSAGE_S * block.sample_rate_hz, MAX_BLOCK_SAMPLES)
        if self._held and not (self._continues(block) and self.held_samples + samples <= most):
            finished += self.flush()
        self._held.append(block)
        self.held_samples += samples
        if self.held_samples + samples > most:
            finished += self.flush()  # another one like it would not fit
        return finished

    def flush(self) -> list[Samples]:
        """Return what is held, as one message or none."""
        held, self._held, self.held_samples = self._held, [], 0
        if not held:
            return []
        first = held[0]
        return [
            Samples(
                first.stream,
                first.run,
                first.sequence,
                len(held),
                first.first_sample,
                first.utc_ns,
                first.uncertainty_ns,
                first.sample_rate_hz,
                first.flags,
                np.concatenate([block.data for block in held], axis=1),
            )
        ]

    def _continues(self, block: Block) -> bool:
        last = self._held[-1]
        due_ns = last.utc_ns + 1e9 * last.data.shape[1] / last.sample_rate_hz
        return (
            block.run == last.run
            and block.sequence == last.sequence + 1
            and block.first_sample == last.first_sample + last.data.shape[1]
            and block.flags == last.flags
            and block.sample_rate_hz == last.sample_rate_hz
            and block.data.shape[0] == last.data.shape[0]
            and abs(block.utc_ns - due_ns) <= UTC_NS
        )

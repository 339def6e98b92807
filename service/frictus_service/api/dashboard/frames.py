"""One stream for one viewer: blocks in, decimated, binary frames out; `docs/websocket.md`."""

import math
import struct
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from enum import IntEnum
from typing import Final, Self

import numpy as np
from numpy.typing import NDArray

from frictus.block import FLOAT32, MAX_CHANNELS, Block
from frictus_service.api.dashboard.messages import MAX_PER_COLUMN, Watch
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
    FINGER = 2
    """One state of the finger; see `finger_frames`."""


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
            raise LiveFrameError(f"kind {kind}: 0 (raw), 1 (extremes), 2 (finger) are known")
        if not 1 <= channels <= MAX_CHANNELS:
            raise LiveFrameError(f"{channels} channels: 1 to {MAX_CHANNELS} accepted")
        shape = (channels, 2, columns) if kind == Kind.EXTREMES else (channels, columns)
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


def samples_per_column(sample_rate_hz: float, window_s: float, columns: int) -> int:
    """Return how many samples a column stands for, so that `columns` span `window_s`.

    Parameters
    ----------
    sample_rate_hz : float
        Above 0.
    window_s : float
        Above 0.
    columns : int
        At least 1; never more are needed, but at rates above 200 kHz.
    """
    return min(max(1, math.ceil(sample_rate_hz * window_s / columns)), MAX_PER_COLUMN)


class Decimator:
    """Reduces a stream of samples to extremes, whatever pieces it comes in.

    Parameters
    ----------
    samples_per_column : int
        At least 1.
    """

    def __init__(self, samples_per_column: int) -> None:
        if samples_per_column < 1:
            raise ValueError(f"{samples_per_column} samples per column: at least 1")
        self.samples_per_column = samples_per_column
        self._begun: NDArray[np.float32] | None = None
        """Extremes of a column that is not complete: its samples may be millions."""
        self.pending = 0

    def push(self, data: NDArray[np.float32]) -> NDArray[np.float32]:
        """Take samples, and return the columns that they complete.

        Parameters
        ----------
        data : ndarray of float32, shape (n_channels, n_samples)
            What follows the samples before. NaN makes its column NaN.

        Returns
        -------
        ndarray of float32, shape (n_channels, 2, n_columns)
            Minima, then maxima; perhaps without columns.
        """
        width, parts = self.samples_per_column, []
        if self.pending:
            taken = min(width - self.pending, data.shape[1])
            self._add(data[:, :taken])
            data = data[:, taken:]
            if self.pending == width and self._begun is not None:
                parts.append(self._begun)
                self._begun, self.pending = None, 0
        columns = data.shape[1] // width
        parts.append(_extremes(data[:, : columns * width].reshape(len(data), columns, width)))
        self._add(data[:, columns * width :])
        return np.concatenate(parts, axis=2)

    def _add(self, data: NDArray[np.float32]) -> None:
        """Add samples to the column that is not complete."""
        if data.shape[1] == 0:
            return
        found = _extremes(data[:, np.newaxis, :])
        if self._begun is not None:
            found = _extremes(np.concatenate((self._begun, found), axis=1).transpose(0, 2, 1))
        self._begun = found
        self.pending += data.shape[1]


def _extremes(samples: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return minima and maxima over the last axis, shape (n_channels, 2, n_columns)."""
    return np.stack((samples.min(axis=2), samples.max(axis=2)), axis=1)


class Trace:
    """Makes frames of what a viewer has seen of a stream; counts what it has not.

    Parameters
    ----------
    watch : Watch
        How the viewer wants it.
    """

    def __init__(self, watch: Watch) -> None:
        self._watch = watch
        self._last: Block | None = None
        self._decimator = Decimator(1)
        self._lost = 0

    def push(self, blocks: Iterable[Block]) -> list[Frame]:
        """Return the frames that blocks complete: one for each stretch without a gap.

        Parameters
        ----------
        blocks : iterable of Block
            In order. One that overlaps those before is left out.
        """
        return [frame for part in self._stretches(blocks) if (frame := self._frame(part))]

    def _stretches(self, blocks: Iterable[Block]) -> Iterator[list[Block]]:
        stretch: list[Block] = []
        for block in blocks:
            last, self._last = self._last, block
            if last is None or block.run != last.run or len(block.data) != len(last.data):
                missing = None
            else:
                missing = block.first_sample - last.first_sample - last.data.shape[1]
                if missing < 0:
                    self._last = last
                    continue
            if missing != 0 and stretch:
                yield stretch
                stretch = []
            if missing is None:
                self._begin(block)
            elif missing:
                self._lost += missing + self._decimator.pending
                self._decimator = Decimator(self._decimator.samples_per_column)
            stretch.append(block)
        if stretch:
            yield stretch

    def _begin(self, block: Block) -> None:
        self._lost = 0
        watch = self._watch
        per_column = watch.samples_per_column or samples_per_column(
            block.sample_rate_hz, watch.window_s, watch.columns
        )
        self._decimator = Decimator(1 if watch.raw else per_column)

    def _frame(self, stretch: list[Block]) -> Frame | None:
        first = stretch[0]
        pending = self._decimator.pending
        data = np.concatenate([block.data for block in stretch], axis=1)
        if not self._watch.raw:
            data = self._decimator.push(data)
        if data.shape[-1] == 0:
            return None
        flags = 0
        for block in stretch:
            flags |= block.flags
        lost, self._lost = self._lost, 0
        return Frame(
            first.stream,
            flags,
            first.run,
            first.first_sample - pending,
            lost,
            first.sample_rate_hz,
            self._decimator.samples_per_column,
            Kind.RAW if self._watch.raw else Kind.EXTREMES,
            first.utc_ns - round(1e9 * pending / first.sample_rate_hz),
            data,
        )

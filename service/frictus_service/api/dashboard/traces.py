"""What one viewer watches, as binary frames; `docs/websocket.md`.

Of a stream its blocks, decimated, and of the finger every state.
"""

import math
from collections.abc import Iterable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from frictus.block import Block
from frictus.messages import FingerState
from frictus.websocket.frames import FINGER_STREAM, FingerFlag, Frame, Kind
from frictus.websocket.messages import MAX_PER_COLUMN, Watch


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


def _missing(last: Block, block: Block) -> int | None:
    """Return how many samples are between two blocks; None where one does not follow."""
    if block.run != last.run or len(block.data) != len(last.data):
        return None
    missing = block.first_sample - last.first_sample - last.data.shape[1]
    return missing if missing >= 0 else None


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
            In order. One that is behind those before begins anew, as one of another run does.
        """
        return [frame for part in self._stretches(blocks) if (frame := self._frame(part))]

    def _stretches(self, blocks: Iterable[Block]) -> Iterator[list[Block]]:
        stretch: list[Block] = []
        for block in blocks:
            last, self._last = self._last, block
            missing = None if last is None else _missing(last, block)
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


class FingerTrace:
    """Makes frames of the states that a viewer has seen; counts those it has not.

    JSON would cost ten times the bytes and lose digits of nanoseconds.
    """

    def __init__(self) -> None:
        self._last: tuple[int, int] | None = None

    def push(
        self, states: Sequence[FingerState], run: int, sample_rate_hz: float
    ) -> list[Frame]:
        """Return one frame of all states; none without a state.

        Parameters
        ----------
        states : sequence of FingerState
            In order.
        run : int
            Of the rig.
        sample_rate_hz : float
            Nominal rate of its device clock.
        """
        if not states:
            return []
        first, last = states[0], states[-1]
        followed = self._last is not None and self._last[0] == run
        expected = self._last[1] + 1 if self._last is not None and followed else first.sequence
        seen, self._last = len(states), (run, last.sequence)
        rows = np.array([_row(state, first.sample) for state in states], dtype=np.float32).T
        return [
            Frame(
                stream=FINGER_STREAM,
                flags=0,
                run=run,
                first_sample=first.sample,
                lost_samples=max(0, last.sequence + 1 - expected - seen),
                sample_rate_hz=sample_rate_hz,
                samples_per_column=1,
                kind=Kind.FINGER,
                utc_ns=first.utc_ns,
                data=rows,
            )
        ]


def _row(state: FingerState, first_sample: int) -> tuple[float, ...]:
    flags = (
        FingerFlag.IN_CONTACT * state.in_contact
        | FingerFlag.STALE * state.stale
        | FingerFlag.EXTRAPOLATED * state.extrapolated
    )
    return (
        state.sample - first_sample,
        state.x_mm,
        state.y_mm,
        state.vx_mm_s,
        state.vy_mm_s,
        state.normal_force_n,
        state.age_ms,
        flags,
    )

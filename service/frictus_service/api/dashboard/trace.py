"""One stream for one viewer: blocks in, frames out."""

from collections.abc import Iterable, Iterator

import numpy as np

from frictus.block import Block
from frictus_service.api.dashboard.decimate import Decimator, samples_per_column
from frictus_service.api.dashboard.frames import Frame, Kind
from frictus_service.api.dashboard.messages import Watch


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
        per_column = samples_per_column(block.sample_rate_hz, watch.window_s, watch.columns)
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

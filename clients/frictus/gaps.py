"""Gaps in a stream of blocks, found from what the blocks say of themselves."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

from frictus.block import Block
from frictus.errors import FrameError
from frictus.keys import STREAMS, Topic
from frictus.mailbox import Arrival
from frictus.reception import Declare, Feed


@dataclass(frozen=True, slots=True)
class Gap:
    """Something is missing here; it stands in the stream where the samples would have.

    Attributes
    ----------
    missing_blocks : int
        How many blocks never came; after a restart, those of the new run.
    first_missing_sequence : int
        Sequence number of the first of them.
    samples : int
        How many samples are missing for it.
    reason : str
        `lost` on the way; `overflow`: this reader was too slow for its queue; `restart`: the
        rig began a new run, sample counts begin again; `overrun`: the rig's device lost samples
        before they became a block; `unreadable`: something arrived that is not a block of the
        protocol (the loss itself follows as `lost`).
    detail : str
        More on it, for people.
    """

    missing_blocks: int
    first_missing_sequence: int
    samples: int
    reason: Literal["lost", "overflow", "restart", "overrun", "unreadable"]
    detail: str = ""


class GapDetector:
    """Follows sequence numbers, runs and sample counts of one stream.

    Attributes
    ----------
    received : int
        Blocks seen.
    lost : int
        Blocks that never came, whatever the reason.
    repeated : int
        Blocks that came again; they are left out.
    """

    def __init__(self) -> None:
        self.received = 0
        self.lost = 0
        self.repeated = 0
        self._last: Block | None = None

    def follow(self, block: Block, dropped_here: int = 0) -> tuple[Gap | None, bool]:
        """Take the next block.

        Parameters
        ----------
        block : Block
            As it arrived.
        dropped_here : int
            How many arrivals our own queue dropped just before it.

        Returns
        -------
        gap : Gap or None
            What is missing before the block.
        fresh : bool
            False for a block that was already seen.
        """
        last = self._last
        if last is not None and block.run == last.run and block.sequence <= last.sequence:
            self.repeated += 1
            return None, False
        self._last = block
        self.received += 1
        gap = self._before(block, last, dropped_here)
        self.lost += gap.missing_blocks if gap else 0
        return gap, True

    @staticmethod
    def _before(block: Block, last: Block | None, dropped_here: int) -> Gap | None:
        if last is None:
            if not dropped_here:
                return None
            samples = dropped_here * block.data.shape[1]
            first = max(0, block.sequence - dropped_here)
            return Gap(dropped_here, first, samples, "overflow")
        if block.run != last.run:
            samples = block.first_sample if block.sequence else 0
            detail = f"run {last.run} ended after block {last.sequence}; run {block.run} began"
            return Gap(block.sequence, 0, samples, "restart", detail)
        expected = last.sequence + 1
        missing = block.sequence - expected
        samples = max(0, block.first_sample - last.first_sample - last.data.shape[1])
        if missing:
            reason: Literal["lost", "overflow"] = "overflow" if dropped_here else "lost"
            detail = f"{min(dropped_here, missing)} dropped by this reader's queue"
            return Gap(missing, expected, samples, reason, detail if dropped_here else "")
        return Gap(0, expected, samples, "overrun") if samples else None


class BlockFeed(Feed[Block | Gap]):
    """The blocks of one stream in order, with a `Gap` wherever something is missing.

    ``for item in feed`` gives `Block | Gap`; see `Feed` for iteration, timeout and closing.

    Parameters
    ----------
    declare : callable
        Declares the subscriber for a given callback.
    topic : Topic
        The stream.
    capacity : int
        Blocks held for a slow reader; beyond, the oldest go and show as a `Gap`.
    timeout_s : float or None
        Longest silence before `SilenceError`; None waits for ever.
    """

    def __init__(
        self, declare: Declare, topic: Topic, capacity: int, timeout_s: float | None = None
    ) -> None:
        self._topic = topic
        self._detector = GapDetector()
        self._next_index = 0
        super().__init__(declare, self._read, capacity, timeout_s)

    @property
    def received(self) -> int:
        """Blocks handed over so far."""
        return self._detector.received

    @property
    def lost(self) -> int:
        """Blocks that never came, or that this reader's queue could not hold."""
        return self._detector.lost

    @property
    def repeated(self) -> int:
        """Blocks that came again and were left out."""
        return self._detector.repeated

    def _read(self, arrival: Arrival) -> Iterator[Block | Gap]:
        dropped_here = arrival.index - self._next_index
        self._next_index = arrival.index + 1
        try:
            block = Block.unpack(arrival.payload)
            if STREAMS.get(block.stream) is not self._topic:
                raise FrameError(f"stream id {block.stream} does not belong under this key")
        except FrameError as error:
            self.unreadable += 1
            yield Gap(0, 0, 0, "unreadable", str(error))
            return
        gap, fresh = self._detector.follow(block, dropped_here)
        if gap is not None:
            yield gap
        if fresh:
            yield block

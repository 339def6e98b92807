"""Gaps in a stream of blocks, found from what the blocks say of themselves."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final, Literal

from frictus.block import MAX_FIRST_SAMPLE, Block
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
        rig began a new run, or the counts of its run went back; `overrun`: the rig's device
        lost samples before they became a block; `unreadable`: something arrived that is not a
        block of the protocol (the loss itself follows as `lost`).
    detail : str
        More on it, for people.
    """

    missing_blocks: int
    first_missing_sequence: int
    samples: int
    reason: Literal["lost", "overflow", "restart", "overrun", "unreadable"]
    detail: str = ""


NEAR: Final = 64
"""Blocks by which a stream may be ahead of its last block, or behind, and is still believed at
once. At 5 ms, 0.3 s."""


class GapDetector:
    """Follows sequence numbers, runs and sample counts of one stream.

    Anybody who may publish can say one block with any numbers. So a block that begins elsewhere
    (another run, far ahead, far behind) is held until the next one follows on it; where the
    stream goes on as before instead, it is a stray and left out. However far off, it costs
    nothing but itself.

    Attributes
    ----------
    received : int
        Blocks handed on.
    lost : int
        Blocks that never came, whatever the reason.
    repeated : int
        Blocks that came again; they are left out.
    strays : int
        Blocks on which no other followed; they are left out.
    """

    def __init__(self) -> None:
        self.received = 0
        self.lost = 0
        self.repeated = 0
        self.strays = 0
        self._last: Block | None = None
        self._held: tuple[Block, int] | None = None

    def follow(self, block: Block, dropped_here: int = 0) -> list[Block | Gap]:
        """Take the next block; return what is known of the stream by it, in order.

        Parameters
        ----------
        block : Block
            As it arrived.
        dropped_here : int
            How many arrivals our own queue dropped just before it.

        Returns
        -------
        list of Block or Gap
            Blocks, each after the gap before it; nothing for one that came again, or is held.
        """
        last, held = self._last, self._held
        if last is None or _follows(block, last, NEAR + dropped_here):
            self._drop_held()
            return self._take(block, dropped_here)
        if held is not None and _follows(block, held[0]):
            self._held = None
            return self._take(*held) + self._take(block, dropped_here)
        if _repeats(block, last):
            self.repeated += 1
            return []
        self._drop_held()
        self._held = block, dropped_here
        return []

    def _drop_held(self) -> None:
        self.strays += self._held is not None
        self._held = None

    def _take(self, block: Block, dropped_here: int) -> list[Block | Gap]:
        gap = self._before(block, self._last, dropped_here)
        self._last = block
        self.received += 1
        self.lost += gap.missing_blocks if gap else 0
        return [block] if gap is None else [gap, block]

    @staticmethod
    def _before(block: Block, last: Block | None, dropped_here: int) -> Gap | None:
        if last is None:
            if not dropped_here:
                return None
            samples = dropped_here * block.data.shape[1]
            first = max(0, block.sequence - dropped_here)
            return Gap(dropped_here, first, samples, "overflow")
        if block.run == last.run and not _follows(block, last):
            return Gap(0, block.sequence, 0, "restart", f"run {last.run} went back")
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

    @property
    def strays(self) -> int:
        """Blocks that belong nowhere in the stream and were left out."""
        return self._detector.strays

    def _read(self, arrival: Arrival) -> Iterator[Block | Gap]:
        dropped_here = arrival.index - self._next_index
        self._next_index = arrival.index + 1
        try:
            block = Block.unpack(arrival.payload)
            if STREAMS.get(block.stream) is not self._topic:
                raise FrameError(f"stream id {block.stream} does not belong under this key")
            if block.first_sample > MAX_FIRST_SAMPLE:
                raise FrameError(
                    f"first sample {block.first_sample}: at most {MAX_FIRST_SAMPLE}"
                )
        except FrameError as error:
            self.unreadable += 1
            yield Gap(0, 0, 0, "unreadable", str(error))
            return
        yield from self._detector.follow(block, dropped_here)


def _follows(block: Block, before: Block, within: int | None = None) -> bool:
    """Return whether a block comes later in the same run, if need be within so many blocks."""
    ahead = block.sequence - before.sequence
    skipped = block.first_sample - before.first_sample - before.data.shape[1]
    if block.run != before.run or ahead <= 0 or skipped < 0:
        return False
    longest = max(1, before.data.shape[1], block.data.shape[1])
    return within is None or (ahead <= within and skipped <= within * longest)


def _repeats(block: Block, last: Block) -> bool:
    """Return whether a block is one of the last few again."""
    near = abs(block.sequence - last.sequence) <= NEAR
    return block.run == last.run and near and not _follows(block, last)

"""Several streams of a rig as one, sample by sample."""

from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from frictus.block import Block, Flag
from frictus.errors import ArgumentError
from frictus.gaps import Gap

PATIENCE: Final = 256
"""Blocks of which none matches before all streams are taken anew from their next ones."""
STRANGERS: Final = 4
"""So often taken anew, and never of one run: those of one rig are within a block or two."""


@dataclass(frozen=True, slots=True)
class AlignedSamples:
    """The same samples of several streams.

    Attributes
    ----------
    run : int
        Changes when the rig starts anew; sample counts begin again with it.
    first_sample : int
        Device index of the first sample.
    utc_ns : int
        UTC of the first sample.
    sample_rate_hz : float
        Nominal rate of the device clock.
    missing_samples : int
        Left out before these, because a stream lacks them; 0 where a run begins.
    flags : Flag
        What any of the streams says of these samples.
    data : mapping of str to ndarray of float32, shape (n_channels, n_samples)
        By the name of the stream; rows as `frictus.keys.CHANNELS` names them.
    """

    run: int
    first_sample: int
    utc_ns: int
    sample_rate_hz: float
    missing_samples: int
    flags: Flag
    data: Mapping[str, NDArray[np.float32]]

    @property
    def time_s(self) -> NDArray[np.float64]:
        """Seconds of the device's clock since its sample 0, shape (n_samples,)."""
        n_samples = next(iter(self.data.values())).shape[1]
        time_s: NDArray[np.float64] = (
            self.first_sample + np.arange(n_samples)
        ) / self.sample_rate_hz
        return time_s


class _EndedError(Exception):
    """A stream has no more blocks."""


class _Head:
    """The block of one stream that is not used up; the next is read when it is needed."""

    def __init__(self, blocks: Iterator[Block | Gap]) -> None:
        self._blocks = blocks
        self._held: Block | None = None
        self._used = 0  # samples of it

    @property
    def block(self) -> Block:
        while self._held is None:
            item = next(self._blocks, None)
            if item is None:
                raise _EndedError
            if isinstance(item, Block) and item.data.shape[1]:
                self._held = item
        return self._held

    @property
    def first(self) -> int:
        return self.block.first_sample + self._used

    @property
    def end(self) -> int:
        return self.block.first_sample + int(self.block.data.shape[1])

    def skip_to(self, sample: int) -> None:
        """Use up what is before a sample, within the block."""
        if sample >= self.end:
            self._held = None
            self._used = 0
        else:
            self._used = max(sample - self.block.first_sample, 0)

    def cut(self, first: int, end: int) -> NDArray[np.float32]:
        begin = self.block.first_sample
        return self.block.data[:, first - begin : end - begin]


def align(**streams: Iterable[Block | Gap]) -> Iterator[AlignedSamples]:
    """Yield the samples that all streams have, in order; what one lacks is left out, counted.

    ``for part in frictus.align(force=rig.blocks("force"), render=rig.blocks("render"))``

    Parameters
    ----------
    **streams : iterable of Block or Gap
        One or more of one rig, under the names that their data shall have. Samples are matched
        by the device's count, whenever a stream sends them.

    Raises
    ------
    ArgumentError
        If there is none, or they are of two rigs, whose counts have nothing in common.
    SilenceError, LinkError
        What the feeds raise.
    """
    if not streams:
        raise ArgumentError("nothing to align: name one stream or more")
    heads = {name: _Head(iter(blocks)) for name, blocks in streams.items()}
    run, expected, unmatched, strangers = -1, 0, 0, 0
    try:
        while True:
            behind = _behind(heads.values(), run)
            unmatched += 1
            if unmatched > PATIENCE:  # one of them is where no rig ever gets
                behind, unmatched = list(heads.values()), 0
                strangers += len({head.block.run for head in behind}) > 1
                if strangers >= STRANGERS and run == -1:
                    raise ArgumentError(
                        f"{' and '.join(heads)} have no run in common: streams of one rig are "
                        "aligned; join those of two by `Block.utc_ns`"
                    )
            for head in behind:
                head.skip_to(head.end)
            if behind:
                continue
            first = max(head.first for head in heads.values())
            end = min(head.end for head in heads.values())
            if first < end:
                part = _aligned(heads, first, end)
                missing = first - expected if part.run == run else 0
                yield replace(part, missing_samples=max(missing, 0))
                run, expected, unmatched = part.run, end, 0
            for head in heads.values():
                head.skip_to(min(max(first, end), head.end))
    except _EndedError:
        return


def _behind(heads: Collection[_Head], run: int) -> list[_Head]:
    """Return the heads in a run that is over, for others are in the next.

    Parameters
    ----------
    heads : collection of _Head
        At least one.
    run : int
        Whose samples came last. Numbers of runs tell no order.
    """
    runs = {head.block.run for head in heads}
    if len(runs) == 1:
        return []
    newest = max(heads, key=lambda head: head.block.utc_ns).block.run
    over = {run} if run in runs else runs - {newest}
    return [head for head in heads if head.block.run in over]


def _aligned(heads: Mapping[str, _Head], first: int, end: int) -> AlignedSamples:
    blocks = [head.block for head in heads.values()]
    flags = Flag(0)
    for block in blocks:
        flags |= block.flags
    one = blocks[0]
    later_ns = round(1e9 * (first - one.first_sample) / one.sample_rate_hz)
    return AlignedSamples(
        one.run,
        first,
        one.utc_ns + later_ns,
        one.sample_rate_hz,
        0,
        flags,
        {name: head.cut(first, end) for name, head in heads.items()},
    )

"""Channels reduced to sums over blocks of 32 samples: all that a fit of tones needs of them.

Times one, times a ramp, times cosine and sine of each tone. The normal equations of any segment
of whole blocks follow from these sums, so that a segment costs its blocks, not its samples.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np
from numba import njit

from frictus_hardware.arrays import FloatArray, IntArray

BLOCK: Final = 32
RAMP: Final = np.arange(float(BLOCK)) - (BLOCK - 1) / 2.0


@dataclass(frozen=True, slots=True)
class BlockSums:
    """What is kept of the channels of a trial; each channel has one or more columns.

    Attributes
    ----------
    columns : tuple of int
        How many columns each channel has.
    sums : ndarray, shape (n_columns, n_blocks, 2 + 2 n_tones)
        Of the samples times one, ramp, cosines, sines, all about the middle of their block.
        Missing samples count as zero.
    missing : tuple of ndarray of int
        Per channel, the samples that are NaN in any of its columns.
    """

    columns: tuple[int, ...]
    sums: FloatArray
    missing: tuple[IntArray, ...]

    @property
    def n_blocks(self) -> int:
        """Whole blocks in the trial."""
        return int(self.sums.shape[1])


def sum_blocks(channels: Sequence[FloatArray], per_sample: tuple[float, ...]) -> BlockSums:
    """Reduce channels; what does not fill a block at the end is left out.

    Parameters
    ----------
    channels : sequence of ndarray, shape (n_samples, n_columns)
        Missing samples NaN.
    per_sample : tuple of float
        Angular frequency of each tone, radians per sample.
    """
    table = _table(per_sample)
    columns = tuple(channel.shape[1] for channel in channels)
    blocks = channels[0].shape[0] // BLOCK
    sums = np.empty((sum(columns), blocks, table.shape[0]))
    missing = []
    first = 0
    for channel, width in zip(channels, columns, strict=True):
        own = sums[first : first + width]
        missing.append(_reduce(channel, table, own))
        first += width
    return BlockSums(columns, sums, tuple(missing))


@lru_cache(maxsize=64)
def _table(per_sample: tuple[float, ...]) -> FloatArray:
    turned = np.multiply.outer(RAMP, np.array(per_sample))
    return np.vstack([np.ones(BLOCK), RAMP, np.cos(turned).T, np.sin(turned).T])


def _reduce(channel: FloatArray, table: FloatArray, out: FloatArray) -> IntArray:
    """Fill the sums of a channel and return its missing samples."""
    _sum(channel, table, out)
    if np.isfinite(out[:, :, 0]).all():
        return np.empty(0, dtype=np.int64)
    lacking = np.asarray(~np.isfinite(channel).all(axis=1))
    _sum(np.where(lacking[:, np.newaxis], 0.0, channel), table, out)
    missing: IntArray = np.flatnonzero(lacking)
    return missing


@njit(cache=True, nogil=True, fastmath={"reassoc", "contract"})
def _sum(channel, table, out):  # type: ignore[no-untyped-def]
    columns, length = table.shape
    samples = np.empty(length)  # side by side, so that a sum is one of vectors
    for axis in range(out.shape[0]):
        for block in range(out.shape[1]):
            for step in range(length):
                samples[step] = channel[block * length + step, axis]
            for column in range(columns):
                total = 0.0
                for step in range(length):
                    total += samples[step] * table[column, step]
                out[axis, block, column] = total

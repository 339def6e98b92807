"""Whether a converter ran out of its range (flat tops at the extremes), or a channel stands."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numba import njit

from frictus_hardware.arrays import FloatArray

CLIPPED_SHARE: Final = 0.001
"""Of the samples, at one end of the range: so many are accepted."""

CLIPPED_RATIO: Final = 5.0
"""Of the samples at an end to those at the next value. The crest of a sine wave in coarse steps
has 1.4 times as many, clipped ones have many more."""

LEAST_LEVELS: Final = 10.0
"""Range over the distance from an end to the next value: below, the channel rests, and what
stands at an end is a converter's step."""


@dataclass(frozen=True, slots=True)
class Clipped:
    """An end of the range at which samples stand.

    Attributes
    ----------
    column : int
        Number of the channel's column.
    value : float
        In the channel's unit.
    share : float
        Of the samples.
    """

    column: int
    value: float
    share: float


@dataclass(frozen=True, slots=True)
class Quality:
    """Of one channel.

    Attributes
    ----------
    missing_share : float
        Of the samples, in the column that lacks most.
    clipped : tuple of Clipped
        Ends at which samples stand; empty where none do.
    constant : tuple of int
        The columns that hold one and the same value throughout.
    """

    missing_share: float
    clipped: tuple[Clipped, ...]
    constant: tuple[int, ...]


def inspect(samples: FloatArray) -> Quality:
    """Return what is missing, what is clipped and what stands.

    Parameters
    ----------
    samples : ndarray, shape (n_samples, n_columns)
        Missing samples NaN.
    """
    count = samples.shape[0]
    found: list[Clipped] = []
    constant: list[int] = []
    most = 0.0
    for column in range(samples.shape[1]):
        missing, ends = _ends(samples[:, column])
        most = max(most, missing / count)
        if missing == count:
            continue
        levels = np.ptp(ends[:, 0])
        if levels == 0.0:
            constant.append(column)
            continue
        for value, there, following, after in ends:
            rests = not levels >= LEAST_LEVELS * abs(value - following)
            if not rests and there > max(CLIPPED_SHARE * count, CLIPPED_RATIO * after):
                found.append(Clipped(column, float(value), float(there / count)))
    return Quality(most, tuple(found), tuple(constant))


@njit(cache=True, nogil=True)
def _ends(samples):  # type: ignore[no-untyped-def]
    """Return how many samples are missing; of both ends and the values next to them, counts."""
    missing = 0
    ends = np.zeros((2, 4))
    for end in range(2):
        sign = 1.0 - 2.0 * end
        first, second = -np.inf, -np.inf
        of_first, of_second = 0, 0
        for n in range(samples.size):
            value = sign * samples[n]
            if value < second:
                continue
            if value > first:
                second, of_second = first, of_first
                first, of_first = value, 1
            elif value == first:
                of_first += 1
            elif value > second:
                second, of_second = value, 1
            elif value == second:
                of_second += 1
            elif end == 0:
                missing += 1
        ends[end, 0], ends[end, 1] = sign * first, of_first
        ends[end, 2], ends[end, 3] = sign * second, of_second
    return missing, ends

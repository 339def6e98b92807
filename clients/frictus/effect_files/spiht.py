"""Blocks of wavelet coefficients as MPEG haptics codes them (ISO/IEC 23090-31).

A block begins with the highest bit plane (4 bits) and its largest coefficient (8 bits); then
come the coefficients from plane to plane, set partitioning in hierarchical trees: A. Said and
W. A. Pearlman, IEEE Trans. Circuits Syst. Video Technol. 6 (1996), p. 243. Coefficient 2n and
2n + 1 are the children of n. Every binary decision is arithmetically coded, by how often each
of seven kinds of them was 0 in the block so far.
"""

from collections.abc import Callable
from typing import Final

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

_HEADER, _SIGN, _ALONE, _CHILDREN, _CHILD, _OFFSPRING, _REFINED = range(7)
"""The kinds of decisions."""
_FULL: Final = 1024
"""Range of the arithmetic code."""
_ROOTS: Final = 8
"""Coefficients of the two coarsest bands; those of the second have children."""


class TooManyDecisionsError(Exception):
    """A block takes more decisions than were granted."""


def decode_block(bits: bytes, count: int, most: int) -> tuple[FloatArray, int]:
    """Decode one block.

    Parameters
    ----------
    bits : bytes
        A bit each, 0 or 1; behind their end zeros are read, as encoders leave those out.
    count : int
        Coefficients, a power of two, at least 16.
    most : int
        Decisions granted: they bound the time, a short stream may code very many.

    Returns
    -------
    coefficients : ndarray, shape (count,)
        From the coarsest band to the finest.
    decisions : int
        How many were taken.

    Raises
    ------
    TooManyDecisionsError
        Within one bit plane of `most`.
    """
    decide, taken = _decoder(bits)
    top = sum(decide(_HEADER) << n for n in range(4))
    coarse = decide(_HEADER)
    steps = sum(decide(_HEADER) << n for n in range(7))
    largest = 1.0 + steps / 8.0 if coarse else steps / 128.0
    value = [0] * count
    alone, significant = list(range(_ROOTS)), list[int]()
    # Of a set either the children are next to be looked at, or all that descend from those.
    sets = [(root, _CHILDREN) for root in range(_ROOTS // 2, _ROOTS)]
    for plane in range(top, -1, -1):
        step, known = 1 << plane, len(significant)
        alone = [n for n in alone if not _found(n, _ALONE, step, decide, value, significant)]
        left: list[tuple[int, int]] = []
        for root, kind in sets:  # grows while it is walked
            if not decide(kind):
                left.append((root, kind))
            elif kind == _CHILDREN:
                for child in (2 * root, 2 * root + 1):
                    if not _found(child, _CHILD, step, decide, value, significant):
                        alone.append(child)
                if 4 * root + 3 < count:
                    sets.append((root, _OFFSPRING))
            else:
                sets += [(2 * root, _CHILDREN), (2 * root + 1, _CHILDREN)]
        sets = left
        for n in significant[:known]:
            if decide(_REFINED):
                value[n] += step if value[n] > 0 else -step
        if taken() > most:
            raise TooManyDecisionsError
    return np.array(value, dtype=float) * (largest / (1 << top)), taken()


def _found(
    n: int,
    kind: int,
    step: int,
    decide: Callable[[int], int],
    value: list[int],
    significant: list[int],
) -> bool:
    """Return whether a coefficient reaches the plane; then its sign is read."""
    if not decide(kind):
        return False
    value[n] = step if decide(_SIGN) else -step
    significant.append(n)
    return True


def _decoder(bits: bytes) -> tuple[Callable[[int], int], Callable[[], int]]:
    """Return what reads the next decision of a kind, and what tells how many were read."""
    zeros, total = [8] * 7, [16] * 7
    low, high, at = 0, _FULL, 10
    code = sum(bit << (9 - n) for n, bit in enumerate(bits[:10]))

    def decide(kind: int) -> int:
        nonlocal low, high, code, at
        seen, all_seen = zeros[kind], total[kind]
        share = (2 * _FULL * seen + all_seen) // (2 * all_seen)  # rounded
        split = min(max((high - low) * share // _FULL, 1), high - low - 1)
        total[kind] = all_seen + 1
        if code - low < split:
            high = low + split
            zeros[kind] = seen + 1
            decision = 0
        else:
            low += split
            decision = 1
        while True:
            if high <= 512:
                drop = 0
            elif low >= 512:
                drop = 512
            elif low >= 256 and high <= 768:
                drop = 256
            else:
                return decision
            low, high = 2 * (low - drop), 2 * (high - drop)
            code = 2 * (code - drop) + (bits[at] if at < len(bits) else 0)
            at += 1

    return decide, lambda: sum(total) - 7 * 16

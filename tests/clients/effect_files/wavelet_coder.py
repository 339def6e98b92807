"""Codes signals into wavelet blocks, so that tests know what a decoder must return."""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
DIGITS = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/"

_HALF_LOW = [0.852698679009404, 0.377402855612654, -0.110624404418423, -0.02384946501938,
             0.037828455506995]  # fmt: skip
_HALF_HIGH = [-0.788485616405665, 0.418092273222212, 0.040689417609559, -0.064538882628938]
LOW, HIGH = (np.array(half[:0:-1] + half) for half in (_HALF_LOW, _HALF_HIGH))
"""Analysis filters of the CDF 9/7 transform, as they are published: 9 and 7 taps."""


def analysis(signal: FloatArray) -> FloatArray:
    """Return the wavelet coefficients of a block, by convolution; the finest band last."""
    bands: list[FloatArray] = []
    while signal.size > 4:
        mirrored = np.pad(signal, 4, mode="reflect")
        bands.insert(0, np.convolve(mirrored[1:-1], HIGH, "valid")[1::2])
        signal = np.convolve(mirrored, LOW, "valid")[::2]
    return np.concatenate([signal, *bands])


class _Coder:
    """The arithmetic code: what is left of a range tells the decisions."""

    def __init__(self) -> None:
        self.bits: list[int] = []
        self._low, self._high, self._held = 0, 1_024, 0
        self._zeros, self._total = [8] * 7, [16] * 7

    def put(self, kind: int, decision: int | bool) -> None:
        """Code a decision of a kind."""
        width = self._high - self._low
        share = int(1_024 * self._zeros[kind] / self._total[kind] + 0.5)
        split = self._low + min(max(width * share // 1_024, 1), width - 1)
        self._total[kind] += 1
        if decision:
            self._low = split
        else:
            self._high = split
            self._zeros[kind] += 1
        while True:
            if self._high <= 512:
                self._put_bit(0)
                drop = 0
            elif self._low >= 512:
                self._put_bit(1)
                drop = 512
            elif self._low >= 256 and self._high <= 768:
                self._held += 1
                drop = 256
            else:
                return
            self._low, self._high = 2 * (self._low - drop), 2 * (self._high - drop)

    def end(self) -> list[int]:
        """Return the bits; zeros follow them."""
        self._held += 1
        self._put_bit(int(self._low >= 256))
        return self.bits

    def _put_bit(self, bit: int) -> None:
        self.bits += [bit, *[1 - bit] * self._held]
        self._held = 0


def block_bits(values: list[int], top: int, steps: int, coarse: bool = False) -> list[int]:
    """Return the bits of a block of whole coefficients.

    Parameters
    ----------
    values : list of int
        Magnitudes below 2 ** (top + 1).
    top : int
        Highest bit plane, 0 to 15.
    steps : int
        0 to 127; 2 ** top stands for `steps` / 128, or 1 + `steps` / 8 if `coarse`.
    """
    count, coder = len(values), _Coder()
    for n in range(4):
        coder.put(0, top >> n & 1)
    coder.put(0, coarse)
    for n in range(7):
        coder.put(0, steps >> n & 1)
    below = [0] * count  # the largest that descends from each
    for n in range(count // 2 - 1, 0, -1):
        pair = (2 * n, 2 * n + 1)
        below[n] = max(max(abs(values[k]), below[k]) for k in pair)
    alone, significant = list(range(8)), list[int]()
    sets = [(n, False) for n in range(4, 8)]

    def look(n: int, kind: int, plane: int) -> bool:
        found = abs(values[n]) >> plane > 0
        coder.put(kind, found)
        if found:
            coder.put(1, values[n] > 0)
            significant.append(n)
        return found

    for plane in range(top, -1, -1):
        known = len(significant)
        alone = [n for n in alone if not look(n, 2, plane)]
        waiting, sets = sets, []
        while waiting:
            n, is_deep = waiting.pop(0)
            largest = max(below[2 * n], below[2 * n + 1]) if is_deep else below[n]
            coder.put(5 if is_deep else 3, largest >> plane > 0)
            if not largest >> plane:
                sets.append((n, is_deep))
            elif is_deep:
                waiting += [(2 * n, False), (2 * n + 1, False)]
            else:
                alone += [k for k in (2 * n, 2 * n + 1) if not look(k, 4, plane)]
                if 4 * n + 3 < count:
                    waiting.append((n, True))
        for n in significant[:known]:
            coder.put(6, abs(values[n]) >> plane & 1)
    return coder.end()


def text_of(bits: list[int]) -> str:
    """Return bits as a `wavelet_stream`."""
    padded = bits + [0] * (-len(bits) % 6)
    groups = (padded[n : n + 6] for n in range(0, len(padded), 6))
    return "".join(DIGITS[int("".join(map(str, group)), 2)] for group in groups)


def stream(signal: FloatArray, top: int = 15) -> str:
    """Return a block of a signal, as finely as `top` bit planes hold it."""
    coefficients = analysis(signal)
    steps = int(np.clip(np.ceil(8.0 * (np.max(np.abs(coefficients)) - 1.0)), 0, 127))
    values = np.rint(coefficients / (1.0 + steps / 8.0) * 2.0**top)
    return text_of(block_bits([int(value) for value in values], top, steps, coarse=True))

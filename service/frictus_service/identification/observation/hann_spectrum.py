"""The spectrum by which samples are judged: one Hann window at a length that is quick."""

from functools import lru_cache
from typing import Final

import numpy as np
from scipy import fft

from frictus_hardware.arrays import FloatArray

LONGEST: Final = 32_768
"""Samples; more would tell nothing that is asked."""


def hann_spectrum(samples: FloatArray) -> tuple[FloatArray, int]:
    """Return the amplitudes of the first samples, their mean removed, and how many they are.

    A length with a large prime factor, such as 29984 = 32 x 937, takes eight times as long as
    one a few per cent shorter, which is taken instead.

    Parameters
    ----------
    samples : ndarray, shape (n_samples, ...)
        At least one; NaN counts as 0.

    Returns
    -------
    amplitudes : ndarray, shape (length // 2 + 1, ...)
        Of a sinusoid at the frequency of each line, in the unit of the samples.
    length : int
        Lines are the sample rate over it apart.
    """
    length = fft.prev_fast_len(min(samples.shape[0], LONGEST), real=True)
    piece = np.array(samples[:length].T, order="C")  # a copy, each column in one piece
    np.nan_to_num(piece, copy=False)
    piece -= piece.mean(axis=-1, keepdims=True)
    window = _window(length)
    piece *= window
    amplitudes: FloatArray = np.abs(fft.rfft(piece)).T * (2.0 / window.sum())
    return amplitudes, length


@lru_cache(maxsize=8)
def _window(samples: int) -> FloatArray:
    window: FloatArray = np.hanning(samples)
    return window

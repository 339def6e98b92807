"""Where the finger was and how fast at every sample, by polynomials through touch reports.

Straight lines through as many reports are off by 2 % where a stroke is fastest, and a cutoff
that depends on the speed is then off by as much.
"""

from collections.abc import Iterator
from typing import Final

import numpy as np
from numpy.polynomial import Polynomial, chebyshev

from frictus_hardware.arrays import FloatArray, IntArray
from frictus_service.identification.observation.sweeps import GAP_S

PART_S: Final = 0.1
"""Taken at once."""
AROUND_S: Final = 0.1
"""Reports so long before and after a part say how the finger moved there."""
DEGREE: Final = 5
"""Of the polynomial over 0.3 s: a stroke that begins and ends at rest is one."""
LEAST_REPORTS: Final = 6
ROUGH_MM: Final = 1.0
"""A report farther from the polynomial makes its path none that a finger goes."""
BENT_MM: Final = 0.08
"""Root mean square of the distances, above which a finger turned too sharply for a polynomial:
its speed is then off by 1 to 5 mm/s. Steps of 0.1 mm make 0.04 in both directions together."""
ROUGHER: Final = 2.0
"""Likewise of a sensor that is rougher: times as much as its reports scatter by themselves."""


def path_of(
    position_mm: FloatArray, position_t_s: FloatArray, n_samples: int, sample_rate_hz: float
) -> FloatArray:
    """Return position and speed at every sample of a trial.

    Parameters
    ----------
    position_mm : ndarray, shape (k, 2)
        As reported; NaN where a report is missing.
    position_t_s : ndarray, shape (k,)
        Since the first sample; rising.
    n_samples : int
        Of the trial.
    sample_rate_hz : float
        Samples per second.

    Returns
    -------
    ndarray, shape (3, n_samples)
        As of `path_among`.
    """
    there = np.isfinite(position_t_s) & np.isfinite(position_mm).all(axis=1)
    place, at_s = position_mm[there], position_t_s[there]
    rows = np.zeros((3, n_samples))
    length = round(PART_S * sample_rate_hz)
    for first in range(0, n_samples, length):
        time_s = np.arange(first, min(first + length, n_samples)) / sample_rate_hz
        near = slice(*np.searchsorted(at_s, (time_s[0] - AROUND_S, time_s[-1] + AROUND_S)))
        rows[:, first : first + length] = path_among(place[near], at_s[near], time_s)
    return rows


def path_among(
    position_mm: FloatArray, position_t_s: FloatArray, time_s: FloatArray
) -> FloatArray:
    """Return position and speed among touch reports, by a polynomial through those around.

    Parameters
    ----------
    position_mm : ndarray, shape (k, 2)
        As reported within some tenths of a second.
    position_t_s : ndarray, shape (k,)
        Rising.
    time_s : ndarray, shape (n_samples,)
        Rising.

    Returns
    -------
    ndarray, shape (3, n_samples)
        x and y in mm, speed in mm/s. Zeros where too few reports are around, or where they lie
        on no smooth path.
    """
    rows = np.zeros((3, time_s.size))
    breaks = np.flatnonzero(np.diff(position_t_s) > GAP_S) + 1
    for own in np.split(np.arange(position_t_s.size), breaks):
        if own.size < LEAST_REPORTS:
            continue
        for at_s in _instants(position_t_s[own]):
            if _follow(rows, position_mm[own], at_s, time_s):
                break
    return rows


def _instants(stamp_s: FloatArray) -> Iterator[FloatArray]:
    """Yield when reports may have been made, the likeliest first, (k,) each.

    As they are stamped. Where that makes no smooth path: evenly, as most sensors report, since
    stamps of their arrival scatter by milliseconds, of which 1 is 0.1 mm at 100 mm/s; all that
    were made, or without those that the stamps leave room for.
    """
    yield stamp_s
    number = np.arange(stamp_s.size)
    yield _evenly(stamp_s, number)
    interval_s = np.diff(stamp_s)
    usual_s = np.median(interval_s)
    if usual_s > 0.0:
        number[1:] = np.cumsum(np.maximum(np.rint(interval_s / usual_s), 1.0))
        if number[-1] >= number.size:
            yield _evenly(stamp_s, number)


def _evenly(stamp_s: FloatArray, number: IntArray) -> FloatArray:
    even_s: FloatArray = Polynomial.fit(number, stamp_s, 1)(number)
    return even_s


def _follow(
    rows: FloatArray, position_mm: FloatArray, position_t_s: FloatArray, time_s: FloatArray
) -> bool:
    """Write into rows where reports of a smooth path went, and return whether they are one."""
    begin, end = position_t_s[0], position_t_s[-1]
    if not end > begin:  # of one instant: no rig says so, but anybody may
        return False
    middle, half = 0.5 * (begin + end), 0.5 * (end - begin)
    degree = min(DEGREE, position_t_s.size - 3)
    basis = chebyshev.chebvander((position_t_s - middle) / half, degree)
    path, *_ = np.linalg.lstsq(basis, position_mm, rcond=None)
    if not _lies_about(basis @ path, position_mm, position_t_s.size - degree - 1):
        return False
    inside = (time_s >= begin) & (time_s <= end)
    at = (time_s[inside] - middle) / half
    velocity = chebyshev.chebval(at, chebyshev.chebder(path)) / half
    rows[:2, inside] = chebyshev.chebval(at, path)
    rows[2, inside] = np.hypot(*velocity)
    return True


def _lies_about(path_mm: FloatArray, position_mm: FloatArray, free: int) -> bool:
    """Return whether reports lie about a path, (k, 2) each, as they scatter by themselves."""
    off_mm = path_mm - position_mm
    if not np.abs(off_mm).max() <= ROUGH_MM:  # NaN too
        return False
    bent_mm = np.sqrt(np.square(off_mm).sum() / free)
    # Fourth differences of smooth motion are none, and of noise the root of 70 times as large.
    rough = np.median(np.abs(np.diff(position_mm, 4, axis=0)), axis=0)
    scatter_mm = np.hypot(*(rough / 0.6745 / np.sqrt(70.0)))
    return bool(bent_mm <= max(BENT_MM, ROUGHER * scatter_mm))

"""How fast a finger went in a sweep: the likeliest smooth path through its touch reports.

What a third of a sweep has in common with another of the same trial is no chance of contacts,
so that speeds which wander by two per cent tell how a response follows the speed. Errors of
the speed make it follow less: polynomials through steps of 0.1 mm took an eighth of the slope
of a cutoff at 20 mm/s and a fiftieth at 75 mm/s, and the slope looked as if it bent. What a
likeliest path is off by does not go with what it says.

A cubic smoothing spline as its cosines: of a path whose speed is a random walk the powers fall
with the fourth power of the frequency; how rough it is follows from the reports themselves
(Wahba 1990, Spline Models for Observational Data, chapters 1 and 4).
"""

from collections.abc import Sequence
from typing import Final

import numpy as np

from frictus_hardware.arrays import FloatArray
from frictus_service.identification.observation.sweeps import Sweep
from frictus_service.identification.observation.touch_path import ROUGH_MM

FASTEST_HZ: Final = 10.0
"""Of what a hand does to its speed within a sweep."""
FALLING: Final = 2.0
"""Amplitudes fall with that power of the frequency."""
ROUGHNESS: Final = np.geomspace(1e-2, 1e8, 41)
"""Power of the path over that of the reports' noise, as they are tried."""
LEAST_REPORTS: Final = 18
LEAST_MM: Final = 1e-3
"""Noise of a report at least: a coordinate may stand still."""
EVERY_S: Final = 2e-3


def with_likeliest_speed(
    path: FloatArray,
    position_mm: FloatArray,
    position_t_s: FloatArray,
    sample_rate_hz: float,
    sweeps: Sequence[Sweep],
) -> FloatArray:
    """Return the speed at every sample, within sweeps the likeliest.

    Parameters
    ----------
    path : ndarray, shape (3, n_samples)
        Of `path_of`: x and y in mm, speed in mm/s, zeros where it is not known.
    position_mm : ndarray, shape (k, 2)
        As reported; NaN where a report is missing.
    position_t_s : ndarray, shape (k,)
        Since the first sample; rising.
    sample_rate_hz : float
        Samples per second.
    sweeps : sequence of Sweep
        Steady movements.

    Returns
    -------
    ndarray, shape (n_samples,)
        In mm/s; zeros stay.
    """
    speed: FloatArray = path[2].copy()
    at_s = np.arange(speed.size) / sample_rate_hz
    with np.errstate(invalid="ignore"):
        nearest = np.nan_to_num(np.rint(position_t_s * sample_rate_hz), nan=-1.0)
    inside = (nearest >= 0) & (nearest < speed.size)
    place = np.where(inside, nearest, 0).astype(np.int64)
    off_mm = np.abs(position_mm - path[:2, place].T).max(axis=1)
    kept = inside & (speed[place] > 0.0) & (off_mm <= ROUGH_MM)  # NaN: not kept
    for sweep in sweeps:
        own = kept & (position_t_s >= sweep.begin_s) & (position_t_s <= sweep.end_s)
        if np.count_nonzero(own) < LEAST_REPORTS:
            continue
        time_s = position_t_s[own]
        cut = (at_s >= sweep.begin_s) & (at_s <= sweep.end_s) & (speed > 0.0)
        grid_s = np.arange(time_s[0], time_s[-1] + EVERY_S, EVERY_S)
        velocity = _velocity(position_mm[own], time_s, grid_s)
        speed[cut] = np.interp(at_s[cut], grid_s, np.hypot(*velocity.T))
    return speed


def _velocity(place_mm: FloatArray, time_s: FloatArray, at_s: FloatArray) -> FloatArray:
    """Return the velocity of the likeliest path through reports, mm/s, (n, 2).

    Parameters
    ----------
    place_mm : ndarray, shape (k, 2)
    time_s : ndarray, shape (k,)
        Rising.
    at_s : ndarray, shape (n,)
    """
    seconds = time_s[-1] - time_s[0]
    number = np.arange(1.0, 1.0 + np.ceil(2.0 * FASTEST_HZ * seconds))
    since, at = ((each - time_s[0]) / seconds for each in (time_s, at_s))
    size = number**-FALLING
    waves = size * np.cos(np.pi * np.outer(since, number))
    line = np.column_stack([np.ones(since.size), since])
    beside = np.linalg.qr(line, mode="complete")[0][:, 2:].T
    free = beside @ waves
    power, turn = np.linalg.eigh(free.T @ free)
    power = np.maximum(power, 0.0)
    slopes = -np.pi * number * size * np.sin(np.pi * np.outer(at, number))
    found = []
    for reports in place_mm.T:
        along = turn.T @ (free.T @ (beside @ reports))
        rough = _roughness(np.square(beside @ reports).sum(), reports.size, along, power)
        weight = turn @ (rough * along / (1.0 + rough * power))
        straight, *_ = np.linalg.lstsq(line, reports - waves @ weight, rcond=None)
        found.append((straight[1] + slopes @ weight) / seconds)
    return np.column_stack(found)


def _roughness(whole: float, count: int, along: FloatArray, power: FloatArray) -> float:
    """Return the likeliest power of a path's waves over that of the noise of its reports.

    Parameters
    ----------
    whole : float
        Sum of squares of the reports beside a straight line.
    count : int
        How many reports.
    along, power : ndarray, shape (n_waves,)
        Of the reports along orthogonal waves, and the squares of these.
    """
    tried = ROUGHNESS[:, np.newaxis]
    grown = 1.0 + tried * power
    left = whole - (tried * np.square(along) / grown).sum(axis=1) + count * LEAST_MM**2
    likelihood = -count * np.log(left) - np.log(grown).sum(axis=1)
    return float(ROUGHNESS[np.argmax(likelihood)])

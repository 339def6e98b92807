"""Samples on a regular grid: from irregular clocks, of lower rates, of another length."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from frictus_hardware.arrays import FloatArray
from frictus_service.data_import.formats.columns import MAX_VALUES
from frictus_service.errors import FieldError

POSITION_RATE_HZ: Final = 200.0
"""Positions are averaged down to about this rate: touch sensors report at 60 to 200 Hz."""
RATE_TOLERANCE: Final = 0.01
COUNTER: Final = 2.0**32
FRICTION_CUTOFF_S: Final = 0.05
"""The sign of the tangential force is that of its mean over so long before and after."""


@dataclass(frozen=True, slots=True)
class Sampled:
    """A channel in its kept unit, on a regular grid.

    Attributes
    ----------
    values : ndarray, shape (n,) or (n, 3)
        Missing samples NaN.
    rate_hz : float
        Samples per second.
    missing : int
        Samples that the times show to be missing.
    """

    values: FloatArray
    rate_hz: float
    missing: int = 0


def signed_counts(values: FloatArray) -> FloatArray | None:
    """Return counts of an encoder with their sign; None where they have it, or are no counts.

    An unsigned counter of 32 bits, as that of NI-DAQ, that is turned back beyond 0 goes on at
    its greatest number.

    Parameters
    ----------
    values : ndarray, shape (n,)
        Missing ones NaN.
    """
    there = values[np.isfinite(values)]
    if not there.size or not 0.0 <= there.min() or not COUNTER / 2.0 <= there.max() < COUNTER:
        return None
    if np.any(there % 1.0):
        return None
    return np.where(values >= COUNTER / 2.0, values - COUNTER, values)


def on_grid(time_s: FloatArray, values: FloatArray, said_hz: float | None = None) -> Sampled:
    """Return values on the grid of their times, NaN where samples are missing.

    Parameters
    ----------
    time_s, values : ndarray, shape (n,)
        Rows without a time are left out; their samples are missing.
    said_hz : float or None
        What the rate must be.

    Raises
    ------
    FieldError
        If the times do not rise regularly, gaps aside.
    """
    timed = np.flatnonzero(np.isfinite(time_s))
    time_s, values = time_s[timed], values[timed]
    steps = np.diff(time_s)
    # Of two middle ones, one: their mean may be no step at all.
    step_s = float(np.quantile(steps, 0.5, method="lower")) if steps.size else np.nan
    if not step_s > 0.0:
        raise FieldError(
            "time",
            "does not rise from row to row, or is rounded to coarser steps than the samples; "
            "leave it away (time=) and give rate_hz",
        )
    # The median of rounded steps is rounded too.
    even = np.abs(steps - step_s) < 0.5 * step_s
    rate_hz = float(1.0 / steps[even].mean())
    if said_hz is not None and abs(rate_hz / said_hz - 1.0) > RATE_TOLERANCE:
        raise FieldError(
            "time", f"steps at {rate_hz:g} Hz, but rate_hz is {said_hz:g}; correct its unit"
        )
    place = np.rint((time_s - time_s[0]) * rate_hz)
    rises = np.diff(place) >= 1.0
    if not np.all(rises):
        at = int(np.argmin(rises)) + 1
        if time_s[at] == time_s[at - 1]:
            raise FieldError(
                "time",
                f"is {time_s[at]:.9g} s in row {timed[at]} and in the next: it is rounded to "
                "coarser steps than the samples; where none is missing leave it away (time=) "
                f"and give rate_hz, which is {rate_hz:.6g} by the rows before",
            )
        raise FieldError(
            "time",
            f"is not regular at row {timed[at]}: {time_s[at - 1]:.9g} s, then "
            f"{time_s[at]:.9g} s at {rate_hz:.6g} Hz; accepted: regular samples, gaps allowed; "
            "resample them",
        )
    count = int(place[-1]) + 1
    if count == values.size:
        return Sampled(values, rate_hz)
    if count > min(2 * values.size + 16, MAX_VALUES):
        raise FieldError("time", "more than half of the samples are missing; cut the file")
    whole = np.full(count, np.nan)
    whole[place.astype(np.int64)] = values
    return Sampled(whole, rate_hz, count - values.size)


def held(sampled: Sampled, rate_hz: float, count: int) -> FloatArray:
    """Return a channel at a higher rate, each value held until the next.

    Parameters
    ----------
    sampled : Sampled
        At its own rate.
    rate_hz : float
        Of the result.
    count : int
        Samples of the result.
    """
    # A product next to a whole number is that number.
    at = np.floor(np.arange(count) * (sampled.rate_hz / rate_hz) + 1e-6).astype(np.int64)
    values: FloatArray = sampled.values[np.minimum(at, len(sampled.values) - 1)]
    return values


def of_length(values: FloatArray, count: int) -> FloatArray:
    """Return values cut, or filled with NaN, to a length.

    Parameters
    ----------
    values : ndarray, shape (n,)
    count : int
        Samples of the result.
    """
    if len(values) >= count:
        return values[:count]
    return np.concatenate([values, np.full(count - len(values), np.nan)])


def direction_of(tangential_n: FloatArray, rate_hz: float) -> FloatArray:
    """Return the sign of the tangential force, its fast part left out.

    Parameters
    ----------
    tangential_n : ndarray, shape (n,)
    rate_hz : float
        Of the samples.
    """
    width = max(round(FRICTION_CUTOFF_S * rate_hz), 1)
    total = np.concatenate([[0.0], np.cumsum(np.nan_to_num(tangential_n))])
    at = np.arange(tangential_n.size)
    low, high = np.maximum(at - width, 0), np.minimum(at + width + 1, at.size)
    signs: FloatArray = np.sign(total[high] - total[low])
    return signs


def averaged(position_mm: FloatArray, time_s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return means over as many reports as bring their rate down.

    Parameters
    ----------
    position_mm : ndarray, shape (k, 2)
    time_s : ndarray, shape (k,)
    """
    span_s = float(time_s[-1] - time_s[0]) if time_s.size > 1 else 0.0
    factor = int((time_s.size - 1) / span_s / POSITION_RATE_HZ) if span_s > 0.0 else 1
    if not 2 <= factor <= time_s.size:  # slow enough, or too short for one mean
        return position_mm, time_s
    whole = time_s.size // factor * factor
    cut = position_mm[:whole].reshape(-1, factor, 2).mean(axis=1)
    return cut, time_s[:whole].reshape(-1, factor).mean(axis=1)

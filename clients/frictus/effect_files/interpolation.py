"""Curves through keyframes, as MPEG haptics names them."""

from collections.abc import Callable
from typing import Final

import numpy as np

from frictus.effect_files.timeline import FloatArray

Curve = Callable[[FloatArray, FloatArray, FloatArray], FloatArray]


def _linear(at_s: FloatArray, time_s: FloatArray, value: FloatArray) -> FloatArray:
    return np.interp(at_s, time_s, value)


def _cubic(at_s: FloatArray, time_s: FloatArray, value: FloatArray) -> FloatArray:
    """Return the smooth step from point to point: flat at every one of them."""
    return _hermite(at_s, time_s, value, np.zeros(value.size))


def _akima(at_s: FloatArray, time_s: FloatArray, value: FloatArray) -> FloatArray:
    """Return Akima's curve: slopes from the four nearest chords (J. ACM 17, 1970, p. 589)."""
    if value.size < 3:
        return _linear(at_s, time_s, value)
    chord = np.diff(value) / np.diff(time_s)
    # Two more chords at each end, by his quadratic extrapolation.
    before = [3.0 * chord[0] - 2.0 * chord[1], 2.0 * chord[0] - chord[1]]
    after = [2.0 * chord[-1] - chord[-2], 3.0 * chord[-1] - 2.0 * chord[-2]]
    m = np.concatenate([before, chord, after])
    change = np.abs(np.diff(m))
    left, right = change[2:], change[:-2]
    total = left + right
    flat = total <= 1e-9 * max(float(np.max(total)), 1e-300)
    slope = (left * m[1:-2] + right * m[2:-1]) / np.where(flat, 1.0, total)
    return _hermite(at_s, time_s, value, np.where(flat, (m[1:-2] + m[2:-1]) / 2.0, slope))


def _hermite(
    at_s: FloatArray, time_s: FloatArray, value: FloatArray, slope: FloatArray
) -> FloatArray:
    """Return the cubics with given slopes at the points; held outside of them."""
    if value.size == 1:
        return np.full(at_s.size, value[0])
    number = np.clip(np.searchsorted(time_s, at_s, side="right") - 1, 0, value.size - 2)
    step_s = np.diff(time_s)[number]
    u = np.clip((at_s - time_s[number]) / step_s, 0.0, 1.0)
    rise = u * u * (3.0 - 2.0 * u)
    bend = slope[number] * (1.0 - u) - slope[number + 1] * u
    begin, end = value[number], value[number + 1]
    return np.asarray(begin + (end - begin) * rise + step_s * u * (1.0 - u) * bend)


CURVES: Final[dict[str, Curve]] = {
    "Linear": _linear,
    "Cubic": _cubic,
    "Akima": _akima,
    "Unknown": _cubic,  # as the reference decoder takes it
}

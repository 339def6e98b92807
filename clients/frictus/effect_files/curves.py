"""The curves of MPEG haptics: what lies between the keyframes of an effect.

ISO/IEC 23090-31 names them; they are drawn as its reference decoder draws them. Points rise in
time, and are at least 1 µs apart.
"""

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


def _bezier(at_s: FloatArray, time_s: FloatArray, value: FloatArray) -> FloatArray:
    """Return parabolas from every second point to the next; the one between pulls at them."""
    if value.size < 3:
        return _linear(at_s, time_s, value)
    number = 2 * np.clip(
        np.searchsorted(time_s[::2], at_s, side="right") - 1, 0, (value.size - 3) // 2
    )
    # Time is a parabola of the parameter u, too: 2 rise u + (fall - rise) u^2.
    rise_s, fall_s = np.diff(time_s)[number], np.diff(time_s)[number + 1]
    since_s = np.clip(at_s - time_s[number], 0.0, rise_s + fall_s)
    u = since_s / (rise_s + np.sqrt(rise_s**2 + (fall_s - rise_s) * since_s))
    begin, pull, end = value[number], value[number + 1], value[number + 2]
    return np.asarray((1.0 - u) ** 2 * begin + 2.0 * u * (1.0 - u) * pull + u**2 * end)


def _bspline(at_s: FloatArray, time_s: FloatArray, value: FloatArray) -> FloatArray:
    """Return the quadratic B-spline of even knots from the first point to the last.

    Its parabolas meet half way between the inner points (de Boor, A Practical Guide to
    Splines, 1978, chapter X).
    """
    if value.size < 3:
        return _linear(at_s, time_s, value)
    return _bezier(at_s, _with_junctions(time_s), _with_junctions(value))


def _with_junctions(points: FloatArray) -> FloatArray:
    joined = np.empty(2 * points.size - 3)
    joined[0], joined[1::2], joined[-1] = points[0], points[1:-1], points[-1]
    joined[2:-1:2] = (points[1:-2] + points[2:-1]) / 2.0
    return joined


CURVES: Final[dict[str, Curve]] = {
    "Linear": _linear,
    "Cubic": _cubic,
    "Akima": _akima,
    "Bezier": _bezier,
    "Bspline": _bspline,
    "Unknown": _cubic,
}
"""By their names in a file."""

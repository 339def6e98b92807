"""What layers ask of the drive: the least and the greatest, at every place and speed."""

from collections.abc import Callable

import numpy as np
from numba import njit

from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.friction import FrictionLaw, cutoff_hz
from frictus_service.synthesis import kernel
from frictus_service.synthesis.layers import Layer
from frictus_service.synthesis.tables import BAND_EDGE_HZ, FADE_HZ, ROWS_PER_OCTAVE

SPEEDS_MM_S = np.concatenate([[0.0], 2.0 ** (np.arange(100) / 12.0)])
"""Speeds at which the gain is made to fit, both ways: 0, and 1 to 300 mm/s."""


def reach_of(
    layers: list[Layer],
    arrays: kernel.SceneArrays,
    law: FrictionLaw,
    sample_rate_hz: float,
    check: Callable[[], None] = lambda: None,
) -> tuple[float, float]:
    """Return least and greatest drive that the layers ask for, where they overlap together."""
    reach = np.zeros((len(layers), 2))
    for row, layer in enumerate(layers):
        check()
        reach[row] = _layer_reach(layer, arrays, row, law, sample_rate_hz)
    reach *= arrays.real[:, kernel.GAIN, None] / law.gain_n
    low = high = 0.0
    for row in range(len(layers)):
        together = [
            other for other in range(len(layers)) if _overlap(layers[row], layers[other])
        ]
        low = min(low, float(reach[together, 0].sum()))
        high = max(high, float(reach[together, 1].sum()))
    return low, high


def _overlap(a: Layer, b: Layer) -> bool:
    ax0, ax1, ay0, ay1 = a.rectangle
    bx0, bx1, by0, by1 = b.rectangle
    return ax0 < bx1 and bx0 < ax1 and ay0 < by1 and by0 < ay1


def _layer_reach(
    layer: Layer,
    arrays: kernel.SceneArrays,
    row: int,
    law: FrictionLaw,
    sample_rate_hz: float,
) -> tuple[float, float]:
    """Return least and greatest of ``(y[n+1] - a y[n]) / (1 - a)`` over places and speeds."""
    # While all of a texture is in the band it asks for the more the faster the finger is.
    telling = SPEEDS_MM_S * (layer.top if layer.kind != kernel.TEMPORAL else 0.0)
    speeds = SPEEDS_MM_S[(telling > 0.9 * BAND_EDGE_HZ) | (SPEEDS_MM_S == 0.0)]
    speeds = np.append(speeds, SPEEDS_MM_S[-1])
    cutoff = cutoff_hz(law, speeds)
    if layer.kind != kernel.MAP:
        # Along its direction a texture passes as slowly as it may, however fast the finger is.
        cutoff = np.minimum(cutoff, cutoff[-1])
    decay = np.exp(-2.0 * np.pi * cutoff / sample_rate_hz)
    moved_mm = speeds / sample_rate_hz
    if layer.kind == kernel.MAP:
        low, high, size = _map_reach(layer, speeds, moved_mm, decay)
    else:
        assert layer.table is not None
        low, high, size = np.zeros((3, speeds.size))
        if layer.kind == kernel.SPATIAL:
            step = moved_mm * arrays.real[row, kernel.PER_STEP]
            rate = speeds
        else:
            per_sample = layer.table.n_points / layer.table.length / sample_rate_hz
            step = np.full(speeds.size, per_sample)
            rate = np.zeros(speeds.size)
        offset = arrays.real[row, kernel.LEVEL_OFFSET]
        seamless = layer.table.seamless
        _table_reach(
            arrays.points,
            arrays.whole[row],
            step,
            rate,
            offset,
            decay,
            seamless,
            low,
            high,
            size,
        )
    if layer.fades:
        # The edge is crossed at the speeds left out above too; the fastest asks for most.
        step = moved_mm * arrays.real[row, kernel.PER_FADE]
        low, high = -_at_edge(-low, size, step, decay), _at_edge(high, size, step, decay)
    return float(low.min()), float(high.max())


def _at_edge(
    high: FloatArray, size: FloatArray, step: FloatArray, decay: FloatArray
) -> FloatArray:
    """Return the greatest drive in the fade too; `size` is the largest friction, each speed.

    With the weight w the drive is ``w[n+1] m[n] + a (w[n+1] - w[n]) y[n] / (1 - a)``.
    """
    here = np.linspace(0.0, 1.0, 101)[:, None]
    inward, outward = _smooth(here + step), _smooth(here - step)
    slew = decay / (1.0 - decay) * size
    weight = _smooth(here)
    entering = inward * high + (inward - weight) * slew
    leaving = outward * high + (weight - outward) * slew
    greatest: FloatArray = np.maximum(entering, leaving).max(axis=0)
    return greatest


def _smooth(share: FloatArray) -> FloatArray:
    inside = np.clip(share, 0.0, 1.0)
    smooth: FloatArray = inside * inside * (3.0 - 2.0 * inside)
    return smooth


@njit(cache=True, nogil=True)
def _table_reach(points, whole, steps, rates, offset, decays, seamless, low, high, size):  # type: ignore[no-untyped-def]
    """Read a table at its points and half-way between: where the finger is, and one step on.

    The finger moves by the same step from every place, so the four points around it weigh the
    same everywhere: what is looked up is looked up once for each speed.
    """
    line = np.empty(3 * (whole[kernel.POINTS] + 4))
    for s in range(steps.size):
        row, share = kernel._level(rates[s], offset, whole[kernel.ROWS])
        octave, n, first = kernel._octave(whole, row)
        first += 1  # behind the padding
        step = steps[s] / (1 << octave) % n  # round a short row more than once
        margin = int(step) + 4
        for i in range(n):
            line[margin + i] = points[first + i]
        if share > 0.0:
            for i in range(n):
                less = points[first + n + 3 + i]
                line[margin + i] += share * (less - line[margin + i])
        for i in range(margin):
            line[margin - 1 - i] = line[margin + (n - 1 - i) % n]
            line[margin + n + i] = line[margin + i % n]
        skipped = 0 if seamless else int(step) + 3
        used = line[skipped : n + 2 * margin - skipped]
        for half in (0.0, 0.5):
            least, most, largest = _line_reach(used, margin, half, step, decays[s])
            low[s] = min(low[s], least / (1.0 - decays[s]))
            high[s] = max(high[s], most / (1.0 - decays[s]))
            size[s] = max(size[s], largest)


CHUNK = 256


@njit(cache=True, nogil=True)
def _line_reach(line, margin, half, step, decay):  # type: ignore[no-untyped-def]
    """Return the extremes of ``y[n+1] - a y[n]``, one step either way, and of ``y[n]``.

    `line` has so many points more at either end as `margin` says. The extremes are kept for
    each place within a chunk: that, unlike one running extreme, the compiler makes vectors of.
    """
    least, most, largest = np.zeros((3, CHUNK))
    h0, h1, h2, h3 = kernel._cubic(half)
    ahead, behind = int(np.floor(half + step)), int(np.floor(half - step))
    a0, a1, a2, a3 = kernel._cubic(half + step - ahead)
    b0, b1, b2, b3 = kernel._cubic(half - step - behind)
    end = line.size - margin
    for start in range(margin, end, CHUNK):
        count = min(CHUNK, end - start)
        here = line[start - 1 : start + count + 2]
        there = line[start + ahead - 1 : start + ahead + count + 2]
        back = line[start + behind - 1 : start + behind + count + 2]
        for i in range(count):
            y = h0 * here[i] + h1 * here[i + 1] + h2 * here[i + 2] + h3 * here[i + 3]
            up = a0 * there[i] + a1 * there[i + 1] + a2 * there[i + 2] + a3 * there[i + 3]
            down = b0 * back[i] + b1 * back[i + 1] + b2 * back[i + 2] + b3 * back[i + 3]
            most[i] = max(most[i], max(up, down) - decay * y)
            least[i] = min(least[i], min(up, down) - decay * y)
            largest[i] = max(largest[i], abs(y))
    return least.min(), most.max(), largest.max()


def _map_reach(
    layer: Layer, speeds: FloatArray, moved_mm: FloatArray, decays: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Bound a map by value and steepest slope in any direction; the two need not coincide."""
    x0, x1, y0, y1 = layer.rectangle
    low, high, size = np.zeros((3, speeds.size))
    for s, (speed, moved, decay) in enumerate(zip(speeds, moved_mm, decays, strict=True)):
        octaves = np.log2(max(speed, 1e-3) * layer.top / FADE_HZ)
        level = int(np.clip(ROWS_PER_OCTAVE * octaves, 0, len(layer.levels) - 1))
        image = layer.levels[level].astype(float)
        rows, columns = image.shape[0] - 3, image.shape[1] - 3
        slope_y = _steepest(image, 0)[1:-2, 1:-2] * rows / (y1 - y0)
        slope_x = _steepest(image, 1)[1:-2, 1:-2] * columns / (x1 - x0)
        image = image[1:-2, 1:-2]
        step = moved * np.hypot(slope_x, slope_y) / (1.0 - decay)
        low[s] = min(0.0, float((image - step).min()))
        high[s] = max(0.0, float((image + step).max()))
        size[s] = float(np.abs(image).max())
    return low, high, size


def _steepest(image: FloatArray, axis: int) -> FloatArray:
    """Return the largest slope of the cubic through the pixels, at each and half-way around."""
    before, after, second = (np.roll(image, shift, axis) for shift in (1, -1, -2))
    halfway = np.abs(1.375 * (after - image) - 0.125 * (second - before))
    steepest: FloatArray = np.maximum(0.5 * np.abs(after - before), halfway)
    return np.maximum(steepest, np.roll(halfway, 1, axis))

"""The compiled inner loop: from a block of finger motion to a block of drive fraction.

Everything here is a pure function on arrays; it allocates nothing and cannot raise.
`benchmarks/kernel.c` is the same algorithm in C, for comparison.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from frictus_hardware.arrays import FloatArray

SPATIAL, TEMPORAL, MAP = 0, 1, 2

# Columns of SceneArrays.real and SceneArrays.whole.
X0, X1, Y0, Y1, PER_FADE, GAIN, COS, SIN, ORIGIN, PER_STEP, LEVEL_OFFSET = range(11)
KIND, FIRST, POINTS, ROWS, HALVINGS = range(5)


class SceneArrays(NamedTuple):
    """A compiled scene as the kernel reads it; one row for each layer.

    A layer is one table within one region: a texture with spatial and temporal components
    makes two.
    """

    real: FloatArray
    """Shape (n_layers, 11), the columns named above."""
    whole: NDArray[np.int64]
    """Shape (n_layers, 5): kind, first point in `points` (or first level in `levels`), points
    in the first row, rows, and how often the points are halved, every 12 rows."""
    points: FloatArray
    """The rows of all tables, one after the other, as `tables.Table` holds them."""
    levels: NDArray[np.int64]
    """Shape (n_levels, 3): first pixel, width and height of each level of each map."""
    pixels: NDArray[np.float32]
    """The levels of all maps, row-major, padded like table rows."""
    bias_n: float
    """Friction added everywhere, so that the drive stays within range."""


class BlockMotion(NamedTuple):
    """How the finger is rendered during a block: velocity linear in time, position to match.

    Positions in mm, velocities in mm/s; `_0` holds at the first sample, `_1` at the one after
    the last. The speed is the finger's own, free of what corrects the rendered position.
    """

    x_mm: float
    y_mm: float
    vx_0: float
    vy_0: float
    vx_1: float
    vy_1: float
    speed_0: float
    speed_1: float


@njit(cache=True, nogil=True)
def target_friction(scene, motion, first_sample, sample_rate_hz, out):  # type: ignore[no-untyped-def]
    """Write the scene's friction at samples first .. first + out.size - 1, bias included, N."""
    n_samples = out.size
    step = 1.0 / sample_rate_hz
    ax = (motion.vx_1 - motion.vx_0) / (n_samples * step)
    ay = (motion.vy_1 - motion.vy_0) / (n_samples * step)
    out[:] = scene.bias_n
    for layer in range(scene.real.shape[0]):
        real = scene.real[layer]
        whole = scene.whole[layer]
        kind = whole[KIND]
        for n in range(n_samples):
            t = n * step
            x = motion.x_mm + (motion.vx_0 + 0.5 * ax * t) * t
            y = motion.y_mm + (motion.vy_0 + 0.5 * ay * t) * t
            weight = _weight(real, x, y)
            if weight == 0.0:
                continue
            vx = motion.vx_0 + ax * t
            vy = motion.vy_0 + ay * t
            if kind == SPATIAL:
                u = (x * real[COS] + y * real[SIN] - real[ORIGIN]) * real[PER_STEP]
                rate = abs(vx * real[COS] + vy * real[SIN])
                value = _between_rows(scene.points, whole, u, rate, real[LEVEL_OFFSET])
            elif kind == TEMPORAL:
                u = (first_sample + n) * step * real[PER_STEP]
                value = _row(scene.points, whole, u)
            else:
                value = _map(scene, real, whole, x, y, np.hypot(vx, vy))
            out[n] += weight * value


@njit(cache=True, nogil=True, inline="always")
def _smooth(distance):  # type: ignore[no-untyped-def]
    d = min(max(distance, 0.0), 1.0)
    return d * d * (3.0 - 2.0 * d)


@njit(cache=True, nogil=True, inline="always")
def _weight(real, x, y):  # type: ignore[no-untyped-def]
    """Return gain times the fade from the region's edges, 0 outside."""
    if not (real[X0] < x < real[X1] and real[Y0] < y < real[Y1]):
        return 0.0
    nearest = min(min(x - real[X0], real[X1] - x), min(y - real[Y0], real[Y1] - y))
    edge = nearest * real[PER_FADE]
    return real[GAIN] if edge >= 1.0 else real[GAIN] * _smooth(edge)


@njit(cache=True, nogil=True, inline="always")
def _level(rate, offset, n_rows):  # type: ignore[no-untyped-def]
    """Return row and fraction for a speed: 12 rows per octave above the table's own."""
    if not rate >= 1e-3:  # NaN too: a row is indexed by it
        return 0, 0.0
    level = 12.0 * np.log2(rate) + offset
    if level <= 0.0:
        return 0, 0.0
    if level >= n_rows - 1:
        return n_rows - 1, 0.0
    row = int(level)
    return row, level - row


@njit(cache=True, nogil=True, inline="always")
def _cubic(f):  # type: ignore[no-untyped-def]
    """Catmull-Rom weights of the four points around a fraction."""
    return (
        f * (-0.5 + f * (1.0 - 0.5 * f)),
        1.0 + f * f * (-2.5 + 1.5 * f),
        f * (0.5 + f * (2.0 - 1.5 * f)),
        f * f * (-0.5 + 0.5 * f),
    )


@njit(cache=True, nogil=True, inline="always")
def _octave(whole, row):  # type: ignore[no-untyped-def]
    """Return octave, points in a row of it, and where the row begins in `points`."""
    octave = min(row // 12, whole[HALVINGS])
    n = whole[POINTS] >> octave
    # Each octave before holds 13 rows, and twice the points of the next.
    before = 13 * (2 * (whole[POINTS] - n) + 3 * octave)
    return octave, n, whole[FIRST] + before + (row - 12 * octave) * (n + 3)


@njit(cache=True, nogil=True, inline="always")
def _between_rows(points, whole, u, rate, offset):  # type: ignore[no-untyped-def]
    """Read a table at `u` points of its first row."""
    row, share = _level(rate, offset, whole[ROWS])
    octave, n, first = _octave(whole, row)
    u /= 1 << octave
    u -= n * np.floor(u / n)
    at = max(min(int(u), n - 1), 0)  # u / n rounds; far away by more than a row
    w0, w1, w2, w3 = _cubic(u - at)
    i = first + at
    value = w0 * points[i] + w1 * points[i + 1] + w2 * points[i + 2] + w3 * points[i + 3]
    if share > 0.0:
        i += n + 3
        less = w0 * points[i] + w1 * points[i + 1] + w2 * points[i + 2] + w3 * points[i + 3]
        value += share * (less - value)
    return value


@njit(cache=True, nogil=True, inline="always")
def _row(points, whole, cycles):  # type: ignore[no-untyped-def]
    """Read a row at a phase in cycles of its length."""
    n = whole[POINTS]
    u = (cycles - np.floor(cycles)) * n
    at = max(min(int(u), n - 1), 0)
    w0, w1, w2, w3 = _cubic(u - at)
    i = whole[FIRST] + at
    return w0 * points[i] + w1 * points[i + 1] + w2 * points[i + 2] + w3 * points[i + 3]


@njit(cache=True, nogil=True)
def _map(scene, real, whole, x, y, speed):  # type: ignore[no-untyped-def]
    """Read a map between the two of its levels that belong to the speed."""
    row, share = _level(speed, real[LEVEL_OFFSET], whole[ROWS])
    across = (x - real[X0]) / (real[X1] - real[X0])
    along = (y - real[Y0]) / (real[Y1] - real[Y0])
    value = _bicubic(scene.pixels, scene.levels[whole[FIRST] + row], across, along)
    if share > 0.0:
        less = _bicubic(scene.pixels, scene.levels[whole[FIRST] + row + 1], across, along)
        value += share * (less - value)
    return value


@njit(cache=True, nogil=True)
def _bicubic(pixels, level, across, along):  # type: ignore[no-untyped-def]
    width, height = level[1], level[2]
    u = across * width
    v = along * height
    i = min(max(int(u), 0), width - 1)
    j = min(max(int(v), 0), height - 1)
    a0, a1, a2, a3 = _cubic(u - i)
    weights = _cubic(v - j)
    value = 0.0
    for r in range(4):
        at = level[0] + (j + r) * (width + 3) + i
        line = a0 * pixels[at] + a1 * pixels[at + 1] + a2 * pixels[at + 2] + a3 * pixels[at + 3]
        value += weights[r] * line
    return value


@njit(cache=True, nogil=True)
def mix(old, new, share, share_step):  # type: ignore[no-untyped-def]
    """Cross-fade `new` into `old` in place; return the share of `new` after the block."""
    for n in range(old.size):
        old[n] += _smooth(share) * (new[n] - old[n])
        share = min(share + share_step, 1.0)
    return share


@njit(cache=True, nogil=True)
def invert(law, motion, sample_rate_hz, friction_n, next_n, out):  # type: ignore[no-untyped-def]
    """Write the drive that makes friction follow the target; return clipped, extrapolated.

    The exact inverse of the held first-order response at varying speed:
    ``m[n] = (y[n+1] - a y[n]) / ((1 - a) g)``, ``a = exp(-w0(v[n]) T)``, on the target after
    all fades and mixing.

    Parameters
    ----------
    law : tuple
        gain_n, cutoff_0_hz, slope_hz_per_mm_s, slowest, fastest mm/s.
    motion : BlockMotion
        Of the finger during the block.
    sample_rate_hz : float
        Samples per second of the device's clock.
    friction_n : ndarray, shape (n_samples,)
        Target y at each sample, N.
    next_n : float
        Target at the sample after the last.
    out : ndarray, shape (n_samples,)
        Drive fraction in [0, 1].
    """
    gain_n, cutoff_0, slope, slowest, fastest = law
    n_samples = out.size
    clipped = 0
    extrapolated = 0
    for n in range(n_samples):
        speed = motion.speed_0 + n / n_samples * (motion.speed_1 - motion.speed_0)
        if not slowest <= speed <= fastest:
            extrapolated += 1
            speed = min(max(speed, slowest), fastest)
        decay = np.exp(-2.0 * np.pi * (cutoff_0 + slope * speed) / sample_rate_hz)
        following = friction_n[n + 1] if n + 1 < n_samples else next_n
        drive = (following - decay * friction_n[n]) / ((1.0 - decay) * gain_n)
        if not 0.0 <= drive <= 1.0:
            clipped += 1
            drive = 1.0 if drive > 1.0 else 0.0  # NaN becomes 0
        out[n] = drive
    return clipped, extrapolated


@njit(cache=True, nogil=True)
def excite(table, hz, amplitude, phase_rad, first, sample_rate_hz, out):  # type: ignore[no-untyped-def]
    """Write the drive of an excitation, in [0, 1]; phases count from the first sample ever."""
    for n in range(out.size):
        drive = table[(first + n) % table.size]
        for k in range(hz.size):
            cycles = (first + n) * hz[k] % sample_rate_hz / sample_rate_hz
            drive += amplitude[k] * np.cos(2.0 * np.pi * cycles + phase_rad[k])
        out[n] = min(max(drive, 0.0), 1.0)


@njit(cache=True, nogil=True)
def mix_drive(old, new, share, share_step):  # type: ignore[no-untyped-def]
    """Cross-fade drives as `mix` does targets, in [0, 1] whatever the rounding."""
    share = mix(old, new, share, share_step)
    for n in range(old.size):
        old[n] = min(max(old[n], 0.0), 1.0)
    return share


@njit(cache=True, nogil=True)
def envelope(level, goal, step, drive):  # type: ignore[no-untyped-def]
    """Scale the drive in place by a ramp from `level` to `goal`; return the level after."""
    for n in range(drive.size):
        if level < goal:
            level = min(level + step, goal)
        elif level > goal:
            level = max(level - step, goal)
        drive[n] *= _smooth(level)
    return level


@njit(cache=True, nogil=True)
def modulate(drive, first, peak_v, carrier_hz, sample_rate_hz, out):  # type: ignore[no-untyped-def]
    """Write ``V_pk sqrt(m) cos(2 pi f_c n / fs)``; n counts from the first sample ever."""
    for n in range(drive.size):
        cycles = (first + n) * carrier_hz % sample_rate_hz / sample_rate_hz
        out[n] = peak_v * np.sqrt(drive[n]) * np.cos(2.0 * np.pi * cycles)

"""The compiled fit of a skin to force and acceleration, and the averages without its vibration.

Every term passes the same state variable filter, of which the trapezoidal rule makes the same
of all. Acceleration and force may be up to `LARGEST_DELAY_S` apart: what precedes is delayed.
"""

from typing import Final

import numpy as np
from numba import njit

FILTER_RAD_S: Final = 2.0 * np.pi * 50.0
DAMPING: Final = 1.4 * FILTER_RAD_S
"""Of the state variable filters: a damping ratio of 0.7."""
TERMS: Final = 4
"""Mass, damping, stiffness, and the delay of the acceleration after the force."""
LEFT, TARGET, TERM, RAW = 0, 1, 2, 2 + TERMS
"""Columns of the averages: without the skin; what is fitted; the terms; as measured."""
SUMS: Final = RAW + 1
LARGEST_DELAY_S: Final = 0.0015
LINE: Final = 512
"""Samples that the delay lines hold: more than 1.5 ms at 200 kHz."""
BEGIN: Final = np.array([0.5, 0.5, 0.5, 2.0])
"""Standard deviation of each coefficient at first, over the usual one."""
DRIFT: Final = 0.01
"""By which it may change within a second, of the same."""
LEAST_SHARE: Final = 0.02
"""No skin has less of mass, damping or stiffness, of the usual one."""
LEAST_N: Final = 1e-4
"""Standard deviation of the fit's residual that is always assumed."""
FORGET_S: Final = 0.05
"""Within which noise is judged."""
NOISE, RESIDUAL, SHAKING, RAW_NOISE = range(4)
"""Columns of the variances: of the averages; of the fit; of its target; of the raw averages."""


@njit(cache=True, nogil=True)
def average(  # type: ignore[no-untyped-def]
    force_n, accel, step, skin, delay, counted, lines, window, filters, sums
):
    """Add a block to the averages under way.

    Parameters
    ----------
    force_n, accel : ndarray, shape (n_samples, 3)
        Of the finger on the screen, N, and of the nail, m/s².
    step : float
        From sample to sample, s.
    skin : ndarray, shape (TERMS,)
        Coefficients; the last is not used.
    delay : float
        Samples by which the acceleration is later than the force.
    counted : int
        Samples so far.
    lines : ndarray, shape (2 axes, 2, LINE)
        Delay lines of force and acceleration. Changed.
    window : ndarray, shape (n_blocks, n_samples)
        Row 0 holds the weights of a block that ends the average.
    filters : ndarray, shape (2 axes, 3, 3)
        Skin, and filters of acceleration and force: level, rate and its slope. Changed.
    sums : ndarray, shape (n_blocks, 2 axes, SUMS)
        The averages under way, row 0 the one that ends with this block. Changed.
    """
    n_blocks = window.shape[0]
    for row in range(n_blocks):
        for axis in range(2):
            for k in range(SUMS):
                sums[row, axis, k] = sums[row + 1, axis, k] if row + 1 < n_blocks else 0.0
    corner = FILTER_RAD_S**2
    for axis in range(2):
        x, dx, ddx = filters[axis, 0, 0], filters[axis, 0, 1], filters[axis, 0, 2]
        slow, dslow, ddslow = filters[axis, 1, 0], filters[axis, 1, 1], filters[axis, 1, 2]
        force, dforce, ddforce = filters[axis, 2, 0], filters[axis, 2, 1], filters[axis, 2, 2]
        for n in range(force_n.shape[0]):
            at = counted + n
            lines[axis, 0, at % LINE] = -force_n[n, axis]
            lines[axis, 1, at % LINE] = accel[n, axis]
            on_skin = _delayed(lines[axis, 0], at, max(delay, 0.0))
            moved = _delayed(lines[axis, 1], at, max(-delay, 0.0))
            before = ddforce
            x, dx, ddx = _step(skin[0] * on_skin, skin[1], skin[2], step, x, dx, ddx)
            slow, dslow, ddslow = _step(moved, DAMPING, corner, step, slow, dslow, ddslow)
            force, dforce, ddforce = _step(
                on_skin, DAMPING, corner, step, force, dforce, ddforce
            )
            for row in range(n_blocks):
                weight = window[row, n]
                sums[row, axis, LEFT] += weight * (moved - ddx)
                sums[row, axis, TARGET] += weight * ddforce
                sums[row, axis, TERM] += weight * ddslow
                sums[row, axis, TERM + 1] += weight * dslow
                sums[row, axis, TERM + 2] += weight * slow
                sums[row, axis, TERM + 3] += weight * (ddforce - before) / step
                sums[row, axis, RAW] += weight * moved
        filters[axis, 0, 0], filters[axis, 0, 1], filters[axis, 0, 2] = x, dx, ddx
        filters[axis, 1, 0], filters[axis, 1, 1], filters[axis, 1, 2] = slow, dslow, ddslow
        filters[axis, 2, 0], filters[axis, 2, 1], filters[axis, 2, 2] = force, dforce, ddforce


@njit(cache=True, nogil=True, inline="always")
def _delayed(line, at, delay):  # type: ignore[no-untyped-def]
    """Return what entered a line some samples ago, straight between two of them."""
    delay = min(max(delay, 0.0), LINE - 2.0)  # it is indexed by it
    whole = int(delay)
    part = delay - whole
    return (1.0 - part) * line[(at - whole) % LINE] + part * line[(at - whole - 1) % LINE]


@njit(cache=True, nogil=True, inline="always")
def _step(push, damping, stiffness, step, level, rate, slope):  # type: ignore[no-untyped-def]
    """Return ``y'' = push - damping y' - stiffness y`` one step later (trapezoidal rule)."""
    half = 0.5 * step
    rate += half * slope
    level += step * rate - half * half * slope
    slope = (push - damping * rate - stiffness * level) / (
        1.0 + half * damping + half * half * stiffness
    )
    return level + half * half * slope, rate + half * slope, slope


@njit(cache=True, nogil=True)
def fit(usual, block_s, sums, past, share, cov, variances):  # type: ignore[no-untyped-def]
    """Continue the recursive least squares with the averages that end here.

    Parameters
    ----------
    usual : ndarray, shape (TERMS,)
        Coefficients of a usual skin.
    block_s : float
        Duration of a block.
    sums : ndarray, shape (n_blocks, 2 axes, SUMS)
        From `average`.
    past : ndarray, shape (2, 2 axes, SUMS)
        The averages of the last two blocks. Changed.
    share, cov : ndarray, shape (TERMS,) and (TERMS, TERMS)
        The coefficients over the usual ones, and their covariance. Changed.
    variances : ndarray, shape (2 axes, 4)
        m²/s⁴, exponentially weighted. Changed.

    Returns
    -------
    bool
        Whether every number is finite.
    """
    cross, gain, bend = np.empty(TERMS), np.empty(TERMS), np.empty(SUMS)
    forget = min(block_s / FORGET_S, 1.0)
    finite = True
    for row in range(TERMS):
        cov[row, row] = min(cov[row, row] + DRIFT**2 * block_s, BEGIN[row] ** 2)
    for axis in range(2):
        for k in range(SUMS):
            bend[k] = sums[0, axis, k] - 2.0 * past[0, axis, k] + past[1, axis, k]
            past[1, axis, k] = past[0, axis, k]
            past[0, axis, k] = sums[0, axis, k]
        miss = bend[TARGET]
        for row in range(TERMS):
            miss -= share[row] * usual[row] * bend[TERM + row]
        spread = variances[axis, RESIDUAL] + LEAST_N**2
        for row in range(TERMS):
            cross[row] = 0.0
            for column in range(TERMS):
                cross[row] += cov[row, column] * usual[column] * bend[TERM + column]
        for row in range(TERMS):
            spread += cross[row] * usual[row] * bend[TERM + row]
        for row in range(TERMS):
            gain[row] = cross[row] / spread
            share[row] += gain[row] * miss
            if row < TERMS - 1:
                share[row] = max(share[row], LEAST_SHARE)
        for row in range(TERMS):
            for column in range(TERMS):
                cov[row, column] -= gain[row] * cross[column]
        # The second difference of white noise has six times its variance.
        variances[axis, NOISE] += forget * (bend[LEFT] ** 2 / 6.0 - variances[axis, NOISE])
        variances[axis, RESIDUAL] += forget * (miss**2 - variances[axis, RESIDUAL])
        variances[axis, SHAKING] += forget * (bend[TERM] ** 2 - variances[axis, SHAKING])
        raw = bend[RAW] ** 2 / 6.0
        variances[axis, RAW_NOISE] += forget * (raw - variances[axis, RAW_NOISE])
        for k in range(4):
            finite = finite and np.isfinite(variances[axis, k])
        finite = finite and np.isfinite(sums[0, axis, LEFT]) and np.isfinite(sums[0, axis, RAW])
    for row in range(TERMS):
        for column in range(row):
            even = 0.5 * (cov[row, column] + cov[column, row])
            cov[row, column] = cov[column, row] = even
        finite = finite and np.isfinite(share[row]) and cov[row, row] > 0.0
    return finite

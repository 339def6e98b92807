"""What virtual fingers compute sample by sample, compiled."""

from typing import Final

import numpy as np
from numba import njit

from frictus_hardware.arguments import LEAST_N

LIFT_RAMP_S: Final = 0.02
EXACT: Final = 32
"""Every so many samples sinusoids are computed, not turned: rounding does not add up."""
EPSILON: Final = float(np.finfo(np.float64).eps)


@njit(cache=True, nogil=True)
def add_sinusoids(time_s, table, value, rate):  # type: ignore[no-untyped-def]
    """Write a sum of sinusoids and its derivative, shape (n_samples,).

    While the times are evenly spaced, as those of a block are, each sinusoid is turned on from
    one to the next, which takes far less than computing it, as is done at every `EXACT`-th.
    """
    n_samples, n_terms = time_s.size, table.shape[1]
    step_s = (time_s[-1] - time_s[0]) / (n_samples - 1) if n_samples > 1 else 0.0
    sine, cosine, pace, turn_sine, turn_cosine = np.empty((5, n_terms))
    for k in range(n_terms):
        pace[k] = 2.0 * np.pi * table[0, k]
        turn_sine[k] = np.sin(pace[k] * step_s)
        turn_cosine[k] = np.cos(pace[k] * step_s)
    since = EXACT
    for n in range(n_samples):
        since += 1
        # To within what the times themselves are rounded by.
        apart_s = time_s[n] - time_s[max(n - since, 0)] - since * step_s
        if since >= EXACT or abs(apart_s) > 4.0 * EPSILON * abs(time_s[n]):
            since = 0
            for k in range(n_terms):
                phase = 2.0 * np.pi * (time_s[n] * table[0, k]) + table[1, k]
                sine[k] = np.sin(phase) * table[2, k]
                cosine[k] = np.cos(phase) * table[2, k]
        else:
            for k in range(n_terms):
                was = sine[k]
                sine[k] = was * turn_cosine[k] + cosine[k] * turn_sine[k]
                cosine[k] = cosine[k] * turn_cosine[k] - was * turn_sine[k]
        total, slope = 0.0, 0.0
        for k in range(n_terms):
            total += sine[k]
            slope += cosine[k] * pace[k]
        value[n], rate[n] = total, slope


@njit(cache=True, nogil=True)
def explore(  # type: ignore[no-untyped-def]
    time_s,
    begin_s,
    move_s,
    from_mm,
    to_mm,
    lift,
    turn_mm_s2,
    loop_s,
    tremor_x,
    tremor_y,
    drift,
    force,
    middle_mm,
    target_n,
    position_mm,
    velocity_mm_s,
    normal_force_n,
    in_contact,
):
    """Write the finger: strokes and tremor along x, drift and tremor along y, normal force."""
    sums = np.empty((4, 2, time_s.size))
    add_sinusoids(time_s, tremor_x, sums[0, 0], sums[0, 1])
    add_sinusoids(time_s, tremor_y, sums[1, 0], sums[1, 1])
    add_sinusoids(time_s, drift, sums[2, 0], sums[2, 1])
    add_sinusoids(time_s, force, sums[3, 0], sums[3, 1])
    for n in range(time_s.size):
        looped = time_s[n] % loop_s
        index = np.searchsorted(begin_s, looped, side="right") - 1
        since = looped - begin_s[index]
        move = move_s[index]
        share = min(since / move, 1.0)
        length = to_mm[index] - from_mm[index]
        begin = turn_mm_s2[index, 0] * move**2 / 2.0
        end = turn_mm_s2[index, 1] * move**2 / 2.0
        # The quintic with these positions and accelerations at its ends, at rest there.
        cubic = 10.0 * length - 3.0 * begin + end
        quartic = -15.0 * length + 3.0 * begin - 2.0 * end
        quintic = 6.0 * length - begin + end
        along = share**2 * (begin + share * (cubic + share * (quartic + share * quintic)))
        rate = share * (
            2.0 * begin
            + share * (3.0 * cubic + share * (4.0 * quartic + share * 5.0 * quintic))
        )
        held = 1.0
        if lift[index]:  # off the screen between two ramps
            last = index + 1 == begin_s.size
            left = (loop_s if last else begin_s[index + 1]) - looped
            off = min(since - move, left) / LIFT_RAMP_S
            held = 1.0 - min(max(off, 0.0), 1.0)
        position_mm[n, 0] = from_mm[index] + along + sums[0, 0, n]
        position_mm[n, 1] = middle_mm + sums[2, 0, n] + sums[1, 0, n]
        velocity_mm_s[n, 0] = rate / move + sums[0, 1, n]
        velocity_mm_s[n, 1] = sums[2, 1, n] + sums[1, 1, n]
        normal_force_n[n] = held * max(target_n + sums[3, 0, n], LEAST_N)
        in_contact[n] = held > 0.0


@njit(cache=True, nogil=True)
def sense_nail(  # type: ignore[no-untyped-def]
    first_sample,
    rate_hz,
    position_mm,
    velocity_mm_s,
    before_mm_s,
    width_mm,
    stroke_tilt_deg,
    gravity_m_s2,
    lean_x,
    lean_y,
    accel_m_s2,
):
    """Add to the skin's acceleration that of the finger as a whole, and gravity as it leans.

    Parameters
    ----------
    first_sample : int
        Of the block, since the first one.
    rate_hz : float
        Samples per second.
    position_mm, velocity_mm_s : ndarray, shape (n_samples, 2)
        Of the finger.
    before_mm_s : ndarray, shape (2,)
        Velocity one sample before the block.
    width_mm : float
        Of the screen.
    stroke_tilt_deg : float
        By which the nail leans over from one edge to the other.
    gravity_m_s2 : float
        Of the place.
    lean_x, lean_y : ndarray, shape (3, n_terms)
        Tables of `add_sinusoids`: degrees that it leans besides.
    accel_m_s2 : ndarray, shape (n_samples, 3)
        Changed.
    """
    n_samples = velocity_mm_s.shape[0]
    time_s = (first_sample + np.arange(n_samples)) / rate_hz
    sums = np.empty((2, 2, n_samples))
    add_sinusoids(time_s, lean_x, sums[0, 0], sums[0, 1])
    add_sinusoids(time_s, lean_y, sums[1, 0], sums[1, 1])
    before_x, before_y = before_mm_s[0], before_mm_s[1]
    for n in range(n_samples):
        along = position_mm[n, 0] / width_mm - 0.5
        x = np.deg2rad(stroke_tilt_deg * along + sums[0, 0, n])
        y = np.deg2rad(sums[1, 0, n])
        vx, vy = velocity_mm_s[n, 0], velocity_mm_s[n, 1]
        accel_m_s2[n, 0] += gravity_m_s2 * np.sin(x) + 1e-3 * rate_hz * (vx - before_x)
        accel_m_s2[n, 1] += gravity_m_s2 * np.sin(y) + 1e-3 * rate_hz * (vy - before_y)
        accel_m_s2[n, 2] -= gravity_m_s2 * np.cos(x) * np.cos(y)
        before_x, before_y = vx, vy

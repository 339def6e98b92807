"""What virtual fingers compute sample by sample, compiled."""

import numpy as np
from numba import njit

from frictus_hardware.simulated.human import LIFT_RAMP_S
from frictus_hardware.simulated.press import LEAST_N


@njit(cache=True, nogil=True)
def sinusoids(time_s, table):  # type: ignore[no-untyped-def]
    """Return a sum of sinusoids and its derivative at one time."""
    value, rate = 0.0, 0.0
    for k in range(table.shape[1]):
        phase = 2.0 * np.pi * (time_s * table[0, k]) + table[1, k]
        value += np.sin(phase) * table[2, k]
        rate += np.cos(phase) * (2.0 * np.pi * table[0, k] * table[2, k])
    return value, rate


@njit(cache=True, nogil=True)
def add_sinusoids(time_s, table, value, rate):  # type: ignore[no-untyped-def]
    """Write a sum of sinusoids and its derivative, shape (n_samples,)."""
    for n in range(time_s.size):
        value[n], rate[n] = sinusoids(time_s[n], table)


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
        trembling_x, trembling_vx = sinusoids(time_s[n], tremor_x)
        trembling_y, trembling_vy = sinusoids(time_s[n], tremor_y)
        drifting, drifting_v = sinusoids(time_s[n], drift)
        pressing, _ = sinusoids(time_s[n], force)
        position_mm[n, 0] = from_mm[index] + along + trembling_x
        position_mm[n, 1] = middle_mm + drifting + trembling_y
        velocity_mm_s[n, 0] = rate / move + trembling_vx
        velocity_mm_s[n, 1] = drifting_v + trembling_vy
        normal_force_n[n] = held * max(target_n + pressing, LEAST_N)
        in_contact[n] = held > 0.0

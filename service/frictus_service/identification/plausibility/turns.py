"""By how much positions follow what turns with the finger: its nail's sensor, or friction."""

import math
from typing import Final

import numpy as np

from frictus_hardware.arrays import FloatArray
from frictus_service.identification.observation.observe import PRESSED_SHARE, FingerTrajectory
from frictus_service.identification.observation.sweeps import TouchMotion

DELAYS_S: Final = np.linspace(-0.1, 0.1, 41)
"""By which positions may follow."""
LEAST_REPORTS: Final = 20
"""That are compared."""
MOST_APART_S: Final = 0.025
"""Reports farther apart do not show when a finger turns: at 30 Hz, 12 ms are chance."""
BLOCK_S: Final = 5e-3
"""Mean forces over so long tell when friction turns."""
TURNS_WITHIN_MM_S: Final = 10.0
"""Speed at which friction has most of its size, in either direction."""
TURNS_WITHIN_MM: Final = 0.3
"""Way after a rest on which friction turns."""
TURNED: Final = 0.5
"""Of its size, which friction reaches in both directions where the finger turns."""
FOLLOWS: Final = 0.9
"""Correlation above which friction is that of the motion."""


def often_reported(motion: TouchMotion) -> bool:
    """Return whether reports are close enough to show when a finger turns."""
    return motion.time_s.size > 1 and bool(np.median(np.diff(motion.time_s)) <= MOST_APART_S)


def delay_of(reference: FloatArray, shifted: FloatArray, alike: float) -> tuple[float, float]:
    """Return the delay at which two channels are most alike, and how alike they are then.

    Parameters
    ----------
    reference : ndarray, shape (n,)
    shifted : ndarray, shape (n_delays, n)
        The other channel at each of `DELAYS_S`.
    alike : float
        Correlation above which the two show one motion.

    Returns
    -------
    delay_s : float
        Of a parabola through the best of `DELAYS_S` and its neighbours; NaN where nothing is.
    likeness : float
        Correlation at the best of them.
    """
    if reference.size < LEAST_REPORTS:
        return np.nan, 0.0
    reference = reference - reference.mean()
    shifted = shifted - shifted.mean(axis=1, keepdims=True)
    size = np.sqrt((reference @ reference) * np.square(shifted).sum(axis=1))
    likeness = np.divide(
        shifted @ reference, size, out=np.zeros(len(shifted)), where=size > 0.0
    )
    best = int(np.argmax(likeness))
    if likeness[best] < alike or best in (0, len(likeness) - 1):
        return np.nan, float(likeness[best])
    before, here, after = likeness[best - 1 : best + 2]
    bend = before - 2.0 * here + after
    offset = 0.5 * (before - after) / bend if bend else np.nan
    return float(DELAYS_S[best] + offset * (DELAYS_S[1] - DELAYS_S[0])), float(here)


def friction_delay_s(force_n: FloatArray, rate_hz: float, course: FingerTrajectory) -> float:
    """Return by how much positions follow friction, which turns as the finger does.

    Friction over load is compared with the sign of the velocity. Where friction that stays at
    rest, until the finger has moved on (Dahl 1968), is more alike, nothing is told: when that
    turns depends on the way that it takes, and on the rests.

    Parameters
    ----------
    force_n : ndarray, shape (3, n_samples)
        Of a trial; NaN where it is unknown.
    rate_hz : float
        Of the samples.
    course : FingerTrajectory
        Of the finger in the trial.

    Returns
    -------
    float
        In s; NaN where the finger does not turn, friction does not follow it, or reports are
        slower than 40 Hz.
    """
    motion = course.motion
    if not often_reported(motion):
        return np.nan
    block = max(round(BLOCK_S * rate_hz), 1)
    count = force_n.shape[1] // block
    mean_n = force_n[:, : count * block].reshape(3, count, block).mean(axis=2)
    time_s = (np.arange(count) + 0.5) * block / rate_hz
    normal_n = mean_n[2]
    known = np.isfinite(mean_n).all(axis=0)
    known &= (time_s >= motion.time_s[0] + DELAYS_S[-1]) & (
        time_s <= motion.time_s[-1] + DELAYS_S[0]
    )
    if not known.any():
        return np.nan
    known &= normal_n > PRESSED_SHARE * np.median(normal_n[known])
    friction = mean_n[0, known] / normal_n[known]
    velocity_mm_s = motion.velocity_mm_s[:, 0]
    lost = np.tanh(velocity_mm_s / TURNS_WITHIN_MM_S)
    if not (lost.min() < -TURNED and lost.max() > TURNED):
        return np.nan
    later_s = time_s[known] + DELAYS_S[:, np.newaxis]
    late_s, lost_alike = delay_of(friction, np.interp(later_s, motion.time_s, lost), FOLLOWS)
    kept = _kept(motion.time_s, velocity_mm_s)
    _, kept_alike = delay_of(friction, np.interp(later_s, motion.time_s, kept), FOLLOWS)
    return late_s if lost_alike > kept_alike else np.nan


def _kept(time_s: FloatArray, velocity_mm_s: FloatArray) -> FloatArray:
    """Return friction that keeps its direction at rest, over its size; shape (n,)."""
    went_mm = velocity_mm_s * np.diff(time_s, prepend=time_s[0])
    kept, direction = [], 0.0
    for step_mm in went_mm.tolist():
        goal = math.copysign(1.0, step_mm)
        direction = goal + (direction - goal) * math.exp(-abs(step_mm) / TURNS_WITHIN_MM)
        kept.append(direction)
    return np.array(kept)

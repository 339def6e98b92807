"""How a person's finger follows speed and force targets: nearly."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.screen import Screen
from frictus_hardware.simulated.motion import FingerMotion, Press, Wander
from frictus_hardware.simulated.strokes import SteadyStrokes
from frictus_laboratory.reproduction.plan import TrialPlan

SPEED_OFFSET, SPEED_WANDER = 0.025, 0.05
FORCE_OFFSET, FORCE_WANDER = 0.025, 0.06
"""Standard deviations as shares of the target: of a trial's mean, and around it."""
SPEED_WANDER_HZ: Final = (0.2, 1.0)
DRIFT_HZ: Final = (0.05, 0.3)
DRIFT_MM: Final = 1.0
REVERSAL_S: Final = 0.05
SLOW_S: Final = 0.005
STROKES: Final = 3
"""A trial holds at least so many, of both directions, even if it is short: the span shrinks."""

TOO_FAST, TOO_HARD = 1.3, 1.4
LIFTED: Final = (0.3, 0.6)
"""Part of the trial during which a lifted finger is off the screen."""


@dataclass(frozen=True, slots=True)
class Reports:
    """What the position sensor says.

    Attributes
    ----------
    position_mm : ndarray, shape (k, 2)
    time_s : ndarray, shape (k,)
    """

    position_mm: FloatArray
    time_s: FloatArray


def move(plan: TrialPlan, time_s: FloatArray, rng: np.random.Generator) -> FingerMotion:
    """Return the finger at given times.

    Time runs a little unevenly for it: the finger of `SteadyStrokes`, with a clock that is off
    and wanders, so that position and velocity belong together.

    Parameters
    ----------
    plan : TrialPlan
        What is asked, and the truth.
    time_s : ndarray, shape (n_samples,)
        0 at the first recorded sample.
    rng : Generator
        Source of everything random.
    """
    screen = Screen()
    speed = plan.info.speed_mm_s * (TOO_FAST if plan.fault == "fast" else 1.0)
    span = min(plan.span_mm, speed * plan.seconds / STROKES)
    finger = SteadyStrokes(speed_mm_s=speed, span_mm=span, reversal_s=REVERSAL_S).start(
        screen.size_mm, rng
    )
    rms_s = SPEED_WANDER / (2.0 * np.pi * float(np.mean(SPEED_WANDER_HZ)))
    wander = Wander.draw(rng, SPEED_WANDER_HZ, rms_s)
    haste = 1.0 + SPEED_OFFSET * float(rng.standard_normal())
    begin_s = rng.uniform(1.0, 1.0 + 2.0 * span / speed)
    moved = finger.at(begin_s + haste * time_s + _slow(wander.value, time_s))
    drift = Wander.draw(rng, DRIFT_HZ, DRIFT_MM)
    position, velocity = moved.position_mm, moved.velocity_mm_s
    velocity *= (haste + _slow(wander.rate, time_s))[:, np.newaxis]
    position[:, 1] += _slow(drift.value, time_s)
    velocity[:, 1] += _slow(drift.rate, time_s)
    return _pressed(plan, FingerMotion(position, velocity, *_press(plan, time_s, rng)), time_s)


def _press(
    plan: TrialPlan, time_s: FloatArray, rng: np.random.Generator
) -> tuple[FloatArray, NDArray[np.bool_]]:
    target = plan.info.force_n * (TOO_HARD if plan.fault == "hard" else 1.0)
    aimed = target * (1.0 + FORCE_OFFSET * float(rng.standard_normal()))
    press = Press(target_n=aimed, wander_n=FORCE_WANDER * aimed).start(rng)
    return _slow(press.at, time_s), np.ones(time_s.size, dtype=np.bool_)


def _slow(varies: Callable[[FloatArray], FloatArray], time_s: FloatArray) -> FloatArray:
    """Return what varies at 2 Hz or less, straight between instants 5 ms apart."""
    coarse = np.arange(time_s[0], time_s[-1] + 2.0 * SLOW_S, SLOW_S)
    values: FloatArray = np.interp(time_s, coarse, varies(coarse))
    return values


def _pressed(plan: TrialPlan, motion: FingerMotion, time_s: FloatArray) -> FingerMotion:
    if plan.fault != "lifted":
        return motion
    off = (time_s > LIFTED[0] * plan.seconds) & (time_s < LIFTED[1] * plan.seconds)
    return replace(
        motion, normal_force_n=np.where(off, 0.0, motion.normal_force_n), in_contact=~off
    )


def report(
    motion: FingerMotion,
    time_s: FloatArray,
    rate_hz: float,
    step_mm: float,
    rng: np.random.Generator,
) -> Reports:
    """Return what a position sensor reports of a finger, from the first recorded sample on.

    Parameters
    ----------
    motion : FingerMotion
        Position, velocity and force at each sample.
    time_s : ndarray, shape (n_samples,)
    rate_hz, step_mm : float
        Of the sensor.
    rng : Generator
        Its scans begin anywhere within their period.
    """
    scans = np.arange(rng.uniform(0.0, 1.0) / rate_hz, time_s[-1], 1.0 / rate_hz)
    rows = np.searchsorted(time_s, scans)
    return Reports(np.rint(motion.position_mm[rows] / step_mm) * step_mm, time_s[rows])

"""The finger: strokes back and forth, and how hard it presses."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

STROKE_MM = 60.0
MIDDLE_MM = 35.0
TURN_S = 0.12
"""A reversal is half a period of a cosine."""
BOW = 0.03
"""By which share a lifelike stroke is faster in its middle, and slower at its ends."""


@dataclass(frozen=True, slots=True)
class Motion:
    """Along x at given times; arrays of shape (n,)."""

    position_mm: FloatArray
    velocity_mm_s: FloatArray
    normal_force_n: FloatArray


def move(
    speed_mm_s: float, force_n: float, time_s: FloatArray, rng: np.random.Generator
) -> Motion:
    """Return a finger that wanders about a speed and a force.

    Parameters
    ----------
    speed_mm_s, force_n : float
    time_s : ndarray, shape (n,)
        Equally spaced.
    rng : numpy.random.Generator
    """
    per_turn = speed_mm_s * TURN_S / np.pi
    cruise_s = (STROKE_MM - 2.0 * per_turn) / speed_mm_s
    half_s = cruise_s + TURN_S
    hasten = 1.0 + 0.02 * _wander(time_s, 0.3, 3.0, rng)
    step_s = time_s[1] - time_s[0]
    clock = np.cumsum(hasten) * step_s + rng.uniform(0.0, 2.0 * half_s)
    into = np.mod(clock, half_s)
    sense = 1.0 - 2.0 * np.mod(np.floor(clock / half_s), 2.0)
    turned = np.clip(into - cruise_s, 0.0, TURN_S)
    cruised = np.minimum(into, cruise_s) - cruise_s / 2.0
    travelled = speed_mm_s * cruised + per_turn * np.sin(np.pi * turned / TURN_S)
    velocity = sense * speed_mm_s * hasten * np.cos(np.pi * turned / TURN_S)
    press = force_n * (1.0 + 0.07 * _wander(time_s, 0.2, 2.0, rng))
    return Motion(MIDDLE_MM + sense * travelled, velocity, press)


def move_lifelike(
    speed_mm_s: float, force_n: float, time_s: FloatArray, rng: np.random.Generator
) -> Motion:
    """Return a finger that brakes and starts by minimum jerk, and rests where it turns.

    Flash and Hogan 1985, The coordination of arm movements, J. Neuroscience 5.

    Parameters
    ----------
    speed_mm_s, force_n : float
        In the mean of a stroke.
    time_s : ndarray, shape (n,)
        Equally spaced.
    rng : numpy.random.Generator
    """
    cruise_s = rng.uniform(40.0, 65.0) / speed_mm_s
    brake_s, pause_s = rng.uniform((0.05, 0.0), (0.12, 0.15))
    half_s = cruise_s + 2.0 * brake_s + pause_s
    hasten = 1.0 + 0.03 * _wander(time_s, 0.3, 3.0, rng)
    step_s = time_s[1] - time_s[0]
    clock = np.cumsum(hasten) * step_s + rng.uniform(0.0, 2.0 * half_s)
    into = np.mod(clock, half_s)
    sense = 1.0 - 2.0 * np.mod(np.floor(clock / half_s), 2.0)
    bowed = 1.0 + BOW * (1.0 - 4.0 * np.abs(np.clip(into / cruise_s, 0.0, 1.0) - 0.5))
    braked = _minimum_jerk((into - cruise_s) / brake_s)
    started = _minimum_jerk((into - cruise_s - brake_s - pause_s) / brake_s)
    velocity = sense * speed_mm_s * hasten * bowed * (1.0 - braked - started)
    travelled = np.cumsum(velocity) * step_s
    middle = 0.5 * (travelled.max() + travelled.min())
    press = force_n * (1.0 + 0.09 * _wander(time_s, 0.2, 2.0, rng))
    return Motion(MIDDLE_MM + travelled - middle, velocity, press)


def _minimum_jerk(share: FloatArray) -> FloatArray:
    """Return how far a movement of minimum jerk is, from 0 to 1."""
    x = np.clip(share, 0.0, 1.0)
    far: FloatArray = x**3 * (10.0 - 15.0 * x + 6.0 * x**2)
    return far


def _wander(
    time_s: FloatArray, lowest_hz: float, highest_hz: float, rng: np.random.Generator
) -> FloatArray:
    """Return three slow sinusoids, of an rms of one together."""
    hz = rng.uniform(lowest_hz, highest_hz, (3, 1))
    phase = rng.uniform(0.0, 2.0 * np.pi, (3, 1))
    summed: FloatArray = np.cos(2.0 * np.pi * hz * time_s + phase).sum(axis=0) / np.sqrt(1.5)
    return summed

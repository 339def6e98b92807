"""Virtual fingers that stroke evenly: at steady speed, or as a sinusoid."""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from pydantic import Field

from frictus_hardware.arguments import Positive, StrictModel
from frictus_hardware.arrays import FloatArray
from frictus_hardware.errors import ConfigError
from frictus_hardware.simulated.motion import FingerMotion, NormalForce, Press


class SteadyStrokes(StrictModel):
    """Back and forth at a constant speed, with short smooth reversals.

    Attributes
    ----------
    speed_mm_s : float
        Between the reversals.
    span_mm : float
        From end to end, along x, in the middle of the screen.
    reversal_s : float
        How long a reversal takes; the velocity runs through half a cosine.
    press : Press
        How hard it presses.
    """

    kind: Literal["steady"] = "steady"
    speed_mm_s: Positive = 60.0
    span_mm: Positive = 60.0
    reversal_s: Positive = 0.06
    press: Press = Press()

    def start(self, screen_mm: tuple[float, float], rng: np.random.Generator) -> "SteadyFinger":
        """Return the finger.

        Raises
        ------
        ConfigError
            If the span does not fit the screen, or the reversals do not fit the span.
        """
        _require_fit(self.span_mm, screen_mm)
        overshoot_mm = self.speed_mm_s * self.reversal_s / math.pi
        if 2.0 * overshoot_mm >= self.span_mm:
            raise ConfigError(
                f"reversals of {self.reversal_s} s at {self.speed_mm_s} mm/s take "
                f"{2.0 * overshoot_mm:.1f} mm, all of the {self.span_mm} mm span: "
                "lower reversal_s or speed_mm_s"
            )
        return SteadyFinger(self, screen_mm, self.press.start(rng))


@dataclass(frozen=True, slots=True)
class SteadyFinger:
    """See `SteadyStrokes`."""

    strokes: SteadyStrokes
    screen_mm: tuple[float, float]
    force: NormalForce

    def at(self, time_s: FloatArray) -> FingerMotion:
        """Return the finger at given times."""
        speed, reversal = self.strokes.speed_mm_s, self.strokes.reversal_s
        overshoot = speed * reversal / math.pi
        straight = self.strokes.span_mm - 2.0 * overshoot
        cruise = straight / speed
        half, phase = np.divmod(np.asarray(time_s), cruise + reversal)
        turning = phase > cruise
        turned = np.pi * (phase - cruise) / reversal
        along = np.where(turning, straight + overshoot * np.sin(turned), speed * phase)
        rate = np.where(turning, speed * np.cos(turned), speed)
        sign = np.where(half % 2 == 0, 1.0, -1.0)
        x = self.screen_mm[0] / 2.0 + sign * (along - straight / 2.0)
        return _along_x(x, sign * rate, self.screen_mm, self.force.at(time_s))


class SinusoidalStrokes(StrictModel):
    """Back and forth as a sinusoid.

    Attributes
    ----------
    peak_speed_mm_s : float
        At the middle of the screen.
    span_mm : float
        From end to end, along x, in the middle of the screen.
    press : Press
        How hard it presses.
    """

    kind: Literal["sinusoidal"] = "sinusoidal"
    peak_speed_mm_s: Positive = 90.0
    span_mm: float = Field(default=50.0, gt=0.0)
    press: Press = Press()

    def start(
        self, screen_mm: tuple[float, float], rng: np.random.Generator
    ) -> "SinusoidalFinger":
        """Return the finger.

        Raises
        ------
        ConfigError
            If the span does not fit the screen.
        """
        _require_fit(self.span_mm, screen_mm)
        return SinusoidalFinger(self, screen_mm, self.press.start(rng))


@dataclass(frozen=True, slots=True)
class SinusoidalFinger:
    """See `SinusoidalStrokes`."""

    strokes: SinusoidalStrokes
    screen_mm: tuple[float, float]
    force: NormalForce

    def at(self, time_s: FloatArray) -> FingerMotion:
        """Return the finger at given times."""
        amplitude = self.strokes.span_mm / 2.0
        turned = self.strokes.peak_speed_mm_s / amplitude * np.asarray(time_s)
        x = self.screen_mm[0] / 2.0 + amplitude * np.sin(turned)
        rate = self.strokes.peak_speed_mm_s * np.cos(turned)
        return _along_x(x, rate, self.screen_mm, self.force.at(time_s))


def _require_fit(span_mm: float, screen_mm: tuple[float, float]) -> None:
    if not span_mm <= screen_mm[0]:
        raise ConfigError(f"a span of {span_mm} mm: the screen is {screen_mm[0]} mm wide")


def _along_x(
    x_mm: FloatArray, vx_mm_s: FloatArray, screen_mm: tuple[float, float], force_n: FloatArray
) -> FingerMotion:
    position = np.column_stack([x_mm, np.full(x_mm.size, screen_mm[1] / 2.0)])
    velocity = np.column_stack([vx_mm_s, np.zeros(x_mm.size)])
    return FingerMotion(position, velocity, force_n, np.ones(x_mm.size, dtype=np.bool_))

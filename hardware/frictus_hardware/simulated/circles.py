"""A virtual finger that circles at a steady speed."""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from pydantic import Field

from frictus_hardware.arguments import NonNegative, Positive, StrictModel
from frictus_hardware.arrays import FloatArray
from frictus_hardware.errors import ConfigError
from frictus_hardware.simulated.motion import FingerMotion, NormalForce, Press, least_jerk


class Circles(StrictModel):
    """Circles about the middle of the screen: some turns, a rest, as many the other way round.

    The speed comes up from rest, and goes down to it, as the position of a movement of least
    jerk does (Flash and Hogan 1985): ``v(u) = V (10 u³ - 15 u⁴ + 6 u⁵)``, u = t / `ramp_s`.
    In between it is constant.

    Attributes
    ----------
    speed_mm_s : float
        Between the ramps.
    radius_mm : float
        Of the circle.
    turns : int
        Whole turns one way round, 1 to 1000, ramps included.
    ramp_s : float
        How long the speed takes to come up, and to go down.
    rest_s : float
        Between two runs, pressing.
    press : Press
        How hard it presses.
    """

    kind: Literal["circle"] = "circle"
    speed_mm_s: Positive = 60.0
    radius_mm: Positive = 12.0
    turns: int = Field(default=5, ge=1, le=1_000)
    ramp_s: Positive = 0.3
    rest_s: NonNegative = 0.3
    press: Press = Press()

    def start(
        self, screen_mm: tuple[float, float], rng: np.random.Generator
    ) -> "CirclingFinger":
        """Return the finger, at rest at the right end of its circle.

        Raises
        ------
        ConfigError
            If the circle does not fit the screen, or the ramps do not fit the turns.
        """
        if not 2.0 * self.radius_mm <= min(screen_mm):
            raise ConfigError(
                f"a circle of radius {self.radius_mm:g} mm: {min(screen_mm) / 2.0:g} mm or "
                f"less fits the screen of {screen_mm[0]:g} x {screen_mm[1]:g} mm"
            )
        ramps_mm, way_mm = self.speed_mm_s * self.ramp_s, self.way_mm
        if not ramps_mm <= way_mm:
            raise ConfigError(
                f"two ramps of {self.ramp_s:g} s at {self.speed_mm_s:g} mm/s take "
                f"{ramps_mm:.1f} mm, more than the {way_mm:.1f} mm of {self.turns} turns: "
                "lower ramp_s or speed_mm_s, or raise turns"
            )
        return CirclingFinger(self, screen_mm, self.press.start(rng))

    @property
    def way_mm(self) -> float:
        """Length of the way one way round."""
        return 2.0 * math.pi * self.radius_mm * self.turns


@dataclass(frozen=True, slots=True)
class CirclingFinger:
    """See `Circles`."""

    circles: Circles
    screen_mm: tuple[float, float]
    force: NormalForce

    def at(self, time_s: FloatArray) -> FingerMotion:
        """Return the finger at given times."""
        time_s = np.asarray(time_s)
        circles = self.circles
        speed, ramp, way = circles.speed_mm_s, circles.ramp_s, circles.way_mm
        run_s = way / speed + ramp
        number, since = np.divmod(time_s, run_s + circles.rest_s)
        # The way back to rest is the way up from it, backwards in time.
        up = np.clip(since / ramp, 0.0, 1.0)
        down = np.clip((run_s - since) / ramp, 0.0, 1.0)
        along = np.where(
            2.0 * since < run_s,
            speed * (ramp * _gone(up) + np.maximum(since - ramp, 0.0)),
            way - speed * (ramp * _gone(down) + np.maximum(run_s - ramp - since, 0.0)),
        )
        sign = np.where(number % 2 == 0, 1.0, -1.0)
        rate = sign * speed * least_jerk(up)[0] * least_jerk(down)[0]
        angle = sign * along / circles.radius_mm
        cosine, sine = np.cos(angle), np.sin(angle)
        middle = np.array(self.screen_mm) / 2.0
        return FingerMotion(
            middle + circles.radius_mm * np.column_stack([cosine, sine]),
            rate[:, np.newaxis] * np.column_stack([-sine, cosine]),
            self.force.at(time_s),
            np.ones(time_s.size, dtype=np.bool_),
        )


def _gone(share: FloatArray) -> FloatArray:
    """Return the integral of a ramp of least jerk over the share of it, 0.5 at its end."""
    gone: FloatArray = share**4 * (2.5 + share * (-3.0 + share))
    return gone

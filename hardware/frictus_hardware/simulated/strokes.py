"""Virtual fingers that move by a rule: even strokes, a sinusoid, circles, taps."""

import math
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from pydantic import Field

from frictus_hardware.arguments import NonNegative, Positive, StrictModel
from frictus_hardware.arrays import FloatArray
from frictus_hardware.errors import ConfigError
from frictus_hardware.simulated.motion import FingerMotion, NormalForce, Press, least_jerk


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


PLACES: Final = 97
"""The places repeat after so many taps, so that memory does not grow."""
EDGE_MM: Final = 2.0
"""Kept free along each edge."""


class Taps(StrictModel):
    """Taps: the finger lands, presses, leaves, and moves above the screen to the next place.

    Force and movement have least jerk between their ends (Flash and Hogan 1985),
    ``s(u) = 10 u³ - 15 u⁴ + 6 u⁵``: the force while the finger lands and leaves, the position
    while it is off the screen. On the screen it rests where it landed.

    Attributes
    ----------
    contact_s : float
        From landing to leaving.
    ramp_s : float
        How long the force takes to come up after landing, and to go down before leaving; at
        most half of `contact_s`.
    lift_s : float
        Off the screen, between two taps.
    reach_mm : float
        The places lie within a square of this side in the middle of the screen; 0: all are one.
    press : Press
        How hard it presses between the ramps.
    """

    kind: Literal["tap"] = "tap"
    contact_s: float = Field(default=0.15, ge=0.01, le=10.0)
    ramp_s: float = Field(default=0.03, ge=0.005, le=1.0)
    lift_s: float = Field(default=0.35, ge=0.05, le=10.0)
    reach_mm: float = Field(default=15.0, ge=0.0, le=1_000.0)
    press: Press = Press()

    def start(
        self, screen_mm: tuple[float, float], rng: np.random.Generator
    ) -> "TappingFinger":
        """Return the finger, at rest just above its first place.

        Raises
        ------
        ConfigError
            If the places do not fit the screen, or the ramps do not fit the contact.
        """
        room_mm = min(screen_mm) - 2.0 * EDGE_MM
        if not self.reach_mm <= room_mm:
            raise ConfigError(
                f"reach_mm = {self.reach_mm:g}: {max(room_mm, 0.0):g} or less fits the screen "
                f"of {screen_mm[0]:g} x {screen_mm[1]:g} mm"
            )
        if not 2.0 * self.ramp_s <= self.contact_s:
            raise ConfigError(
                f"two ramps of {self.ramp_s:g} s take more than the contact of "
                f"{self.contact_s:g} s: lower ramp_s to {self.contact_s / 2.0:g} or raise "
                "contact_s"
            )
        places = np.array(screen_mm) / 2.0 + self.reach_mm * rng.uniform(-0.5, 0.5, (PLACES, 2))
        return TappingFinger(self, places, self.press.start(rng))


@dataclass(frozen=True, slots=True)
class TappingFinger:
    """See `Taps`.

    Attributes
    ----------
    taps : Taps
        How long and how far.
    places_mm : ndarray, shape (n_places, 2)
        Where it taps, one after another, over and over.
    force : NormalForce
        Between the ramps.
    """

    taps: Taps
    places_mm: FloatArray
    force: NormalForce

    def at(self, time_s: FloatArray) -> FingerMotion:
        """Return the finger at given times."""
        time_s = np.asarray(time_s)
        taps, places = self.taps, self.places_mm
        number, since = np.divmod(time_s, taps.contact_s + taps.lift_s)
        here = number.astype(np.int64) % len(places)
        way = places[(here + 1) % len(places)] - places[here]
        share = np.clip((since - taps.contact_s) / taps.lift_s, 0.0, 1.0)
        moved, pace = least_jerk(share)
        pressed, _ = least_jerk(
            np.clip(np.minimum(since, taps.contact_s - since) / taps.ramp_s, 0.0, 1.0)
        )
        normal_n = pressed * self.force.at(time_s)
        return FingerMotion(
            places[here] + moved[:, np.newaxis] * way,
            (pace / taps.lift_s)[:, np.newaxis] * way,
            normal_n,
            normal_n > 0.0,
        )

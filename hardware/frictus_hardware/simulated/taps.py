"""A virtual finger that taps, here and there."""

from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from pydantic import Field

from frictus_hardware.arguments import StrictModel
from frictus_hardware.arrays import FloatArray
from frictus_hardware.errors import ConfigError
from frictus_hardware.simulated.motion import FingerMotion, NormalForce, Press, least_jerk

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

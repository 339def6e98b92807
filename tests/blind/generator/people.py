"""The people of a study: each has a finger of their own."""

from dataclasses import dataclass

import numpy as np
from tests.blind.generator.case import Hidden
from tests.blind.generator.hide import F0_N, OF_PEOPLE, V0_MM_S, hide
from tests.blind.generator.transfer import Rational, skin, with_second_mode
from tests.blind.generator.world import World

GAIN_N = 0.39
CUTOFF_0_HZ = 385.68
SLOPE_HZ_PER_MM_S = 13.811
CUTOFF_HZ = CUTOFF_0_HZ + SLOPE_HZ_PER_MM_S * V0_MM_S


SECOND_MODE = "second_mode"
"""What is hidden in the skin, and not in the world."""
MOST_DAMPED = 0.9
"""Damping ratio of a skin, at most."""


@dataclass(frozen=True, slots=True)
class Spread:
    """How different people and contacts are; shares, or standard deviations of logarithms.

    Attributes
    ----------
    gain, cutoff, slope : float
        Between people.
    gain_exponent : float
        Of speed and of normal force in the gain, each; between people, zero in the mean.
    effect : float
        Of what is hidden in the finger, between people.
    skin, friction : float
        Mass, damping, stiffness, each; coefficient of friction; between people.
    contact, condition : float
        Of the gain from trial to trial; of the cutoff between conditions of speed and force.
    outliers, too_fast : float
        Shares of trials: gain off by a factor of two; finger half as fast again as asked.
    """

    gain: float = 0.35
    cutoff: float = 0.15
    slope: float = 0.25
    gain_exponent: float = 0.04
    effect: float = 0.2
    skin: float = 0.2
    friction: float = 0.2
    contact: float = 0.10
    condition: float = 0.05
    outliers: float = 0.03
    too_fast: float = 0.02


EVERYBODY_ALIKE = Spread(*(0.0,) * 11)


@dataclass(frozen=True, slots=True)
class Person:
    """A finger.

    Attributes
    ----------
    gain_n, cutoff_hz : float
        At 60 mm/s and 0.4 N.
    slope_hz_per_mm_s : float
    speed_exponent, force_exponent : float
        Of the gain, this person's own, beside what is hidden.
    friction_coefficient : float
    skin : Rational
        From force to acceleration.
    world : World
        With what is hidden, in this person's strength.
    """

    name: str
    gain_n: float
    cutoff_hz: float
    slope_hz_per_mm_s: float
    speed_exponent: float
    force_exponent: float
    friction_coefficient: float
    skin: Rational
    world: World


def draw_person(
    name: str,
    hidden: tuple[Hidden, ...],
    spread: Spread,
    has_slope: bool,
    rng: np.random.Generator,
) -> Person:
    """Return a person; means over people are the paper's, and what is hidden as stated.

    Parameters
    ----------
    name : str
    hidden : tuple of Hidden
    spread : Spread
    has_slope : bool
        Whether the cutoff follows speed.
    rng : numpy.random.Generator
    """
    cutoff_hz = CUTOFF_HZ * _around_one(spread.cutoff, rng)
    of_speed, of_force = (spread.gain_exponent * rng.standard_normal(2)).tolist()
    world = World().with_gain(
        lambda m: (m.speed_mm_s / V0_MM_S) ** of_speed * (m.normal_force_n / F0_N) ** of_force
    )
    in_skin = {}
    for each in hidden:
        own = 1.0 + spread.effect * float(np.clip(rng.standard_normal(), -2.5, 2.5))
        if each.name == SECOND_MODE:
            in_skin = each.parameters | {"share": own * each.parameters["share"]}
        else:
            world = hide(world, each, own if each.name in OF_PEOPLE else 1.0)
    relative = 1.0 + spread.slope * float(np.clip(rng.standard_normal(), -2.5, 2.5))
    slope = cutoff_hz / CUTOFF_HZ * SLOPE_HZ_PER_MM_S * relative
    mass_kg, stiffness = (mean * _around_one(spread.skin, rng) for mean in (0.0015, 444.0))
    # The modes of an overdamped skin would be real, and may fall on those of friction.
    most = MOST_DAMPED * 2.0 * float(np.sqrt(mass_kg * stiffness))
    damping = min(1.3 * _around_one(spread.skin, rng), most)
    own_skin = skin(mass_kg, damping, stiffness)
    return Person(
        name=name,
        gain_n=GAIN_N * _around_one(spread.gain, rng),
        cutoff_hz=cutoff_hz,
        slope_hz_per_mm_s=slope if has_slope else 0.0,
        speed_exponent=of_speed,
        force_exponent=of_force,
        friction_coefficient=0.3 * _around_one(spread.friction, rng),
        skin=with_second_mode(own_skin, **in_skin) if in_skin else own_skin,
        world=world,
    )


def _around_one(spread: float, rng: np.random.Generator) -> float:
    """Return a lognormal number of mean one."""
    return float(np.exp(spread * rng.standard_normal() - spread**2 / 2.0))

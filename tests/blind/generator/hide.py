"""Hiding something in a world: the equations of the known causes, other forms, unknown ones."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from tests.blind.generator.case import Hidden
from tests.blind.generator.rolloff import first_order_of_power, power_of_first_order
from tests.blind.generator.transfer import mount, other_mount
from tests.blind.generator.world import (
    Echo,
    Moment,
    Relaxation,
    Section,
    Shelf,
    StickSlip,
    World,
)

FloatArray = NDArray[np.float64]
V0_MM_S: Final = 60.0
F0_N: Final = 0.4
X0_MM: Final = 35.0

OF_PEOPLE: Final = frozenset(
    {
        "speed_dependent_cutoff",
        "force_dependent_cutoff",
        "cutoff_drift",
        "speed_dependent_gain",
        "force_dependent_gain",
        "gain_drift",
        "direction_asymmetry",
        "fractional_rolloff",
        "stick_slip",
        "coupling",
        "contact_loss",
        "force_saturation",
        "bent_cutoff",
        "light_cutoff",
    }
)
"""What is of the finger, so that people differ in it; the rest is of the instrument."""

Change = Callable[[World, Mapping[str, float]], World]


def hide(world: World, hidden: Hidden, strength: float = 1.0) -> World:
    """Return a world with something hidden in it.

    Parameters
    ----------
    world : World
    hidden : Hidden
    strength : float
        Of this person: a factor of the first parameter.
    """
    first, *rest = hidden.parameters
    values = {first: strength * hidden.parameters[first]}
    values |= {name: hidden.parameters[name] for name in rest}
    return FORMS[hidden.name, hidden.form](world, values)


def _times_gain(exponent: Callable[[Moment, Mapping[str, float]], FloatArray]) -> Change:
    return lambda world, p: world.with_gain(lambda m: np.exp(exponent(m, p)))


def _times_cutoff(exponent: Callable[[Moment, Mapping[str, float]], FloatArray]) -> Change:
    return lambda world, p: world.with_cutoff(lambda m, hz: hz * np.exp(exponent(m, p)))


def _even(drive: FloatArray, share: float) -> FloatArray:
    return drive - 4.0 * share * drive * (1.0 - drive)


def _odd(drive: FloatArray, share: float) -> FloatArray:
    z = 2.0 * drive - 1.0
    return (1.0 + z + 4.0 * share * (z - z**3)) / 2.0


def _high(speed_mm_s: FloatArray) -> FloatArray:
    """Return 0 for slow and 1 for fast movement, half at 60 mm/s."""
    rise: FloatArray = 1.0 / (1.0 + np.exp((V0_MM_S - speed_mm_s) / 6.0))
    return rise


CATALOGUE: Final[Mapping[str, Change]] = {
    "speed_dependent_cutoff": lambda world, p: world.with_cutoff(
        lambda m, hz: hz + p["slope_hz_per_mm_s"] * (m.speed_mm_s - V0_MM_S)
    ),
    "force_dependent_cutoff": _times_cutoff(
        lambda m, p: p["exponent"] * np.log(m.normal_force_n / F0_N)
    ),
    "cutoff_drift": _times_cutoff(lambda m, p: p["per_minute"] * m.minutes * _one(m)),
    "speed_dependent_gain": _times_gain(
        lambda m, p: p["exponent"] * np.log(m.speed_mm_s / V0_MM_S)
    ),
    "force_dependent_gain": _times_gain(
        lambda m, p: p["exponent"] * np.log(m.normal_force_n / F0_N)
    ),
    "gain_drift": _times_gain(lambda m, p: p["per_minute"] * m.minutes * _one(m)),
    "direction_asymmetry": lambda world, p: world.with_gain(
        lambda m: 1.0 + p["share"] * m.direction
    ),
    "position_dependent_gain": _times_gain(lambda m, p: p["per_mm"] * (m.position_mm - X0_MM)),
    "charge_leakage": lambda world, p: replace(world, shelf=Shelf(p["corner_hz"], 1.0)),
    "channel_delay": lambda world, p: replace(world, delay_s=p["delay_s"]),
    "mount_resonance_shift": lambda world, p: replace(
        world, mount=mount(1714.0 * (1.0 + p["share"]))
    ),
    "fractional_rolloff": lambda world, p: replace(
        world, rolloff=power_of_first_order(1.0 + p["excess_order"])
    ),
    "residual_quadratic": lambda world, p: world.with_map(
        lambda drive, minutes, tone: _even(drive, p["share"])
    ),
    "amplitude_compression": lambda world, p: world.with_map(
        lambda drive, minutes, tone: _odd(drive, p["share"])
    ),
    "mains_interference": lambda world, p: replace(
        world, mains_n=p["amplitude_n"], mains_hz=p["frequency_hz"]
    ),
    "stick_slip": lambda world, p: replace(world, stick_slip=StickSlip(p["amplitude_n"])),
}

OTHER_FORMS: Final[Mapping[tuple[str, str], Change]] = {
    ("speed_dependent_cutoff", "step"): _times_cutoff(
        lambda m, p: p["log_change"] * _high(m.speed_mm_s)
    ),
    ("cutoff_drift", "saturating"): _times_cutoff(
        lambda m, p: p["log_change"] * (1.0 - np.exp(-m.minutes / 3.0)) * _one(m)
    ),
    ("speed_dependent_gain", "step"): _times_gain(
        lambda m, p: p["log_change"] * np.tanh((m.speed_mm_s - 35.0) / 8.0)
    ),
    ("force_dependent_gain", "saturating"): _times_gain(
        lambda m, p: p["log_change"] * -np.exp((0.2 - m.normal_force_n) / 0.07)
    ),
    ("gain_drift", "saturating"): _times_gain(
        lambda m, p: p["log_change"] * (1.0 - np.exp(-m.minutes / 3.0)) * _one(m)
    ),
    ("direction_asymmetry", "slow_only"): lambda world, p: world.with_gain(
        lambda m: 1.0 + p["share"] * m.direction * (1.0 - _high(m.speed_mm_s))
    ),
    ("position_dependent_gain", "quadratic"): _times_gain(
        lambda m, p: p["log_change"] * np.square((m.position_mm - 20.0) / 60.0)
    ),
    ("charge_leakage", "shelf"): lambda world, p: replace(
        world, shelf=Shelf(p["corner_hz"], p["share"])
    ),
    ("fractional_rolloff", "power_inside"): lambda world, p: replace(
        world, rolloff=first_order_of_power(1.0 + p["excess_order"])
    ),
    ("residual_quadratic", "charging"): lambda world, p: world.with_map(
        lambda drive, minutes, tone: _even(drive, p["share"] * minutes / 10.0)
    ),
    ("amplitude_compression", "slewing"): lambda world, p: world.with_map(
        lambda drive, minutes, tone: _odd(drive, p["share"] * tone / 500.0)
    ),
}

OTHER_SHAPES: Final[Mapping[tuple[str, str], Change]] = {
    ("stick_slip", "relaxing"): lambda world, p: replace(
        world, relaxation=Relaxation(p["amplitude_n"], p["stiffness_n_per_mm"])
    ),
}
"""Besides those of `OTHER_FORMS`, which the campaign on the catalogue draws."""

UNKNOWN: Final[Mapping[str, Change]] = {
    "hidden_mode": lambda world, p: replace(
        world,
        section=Section(p["frequency_hz"], 8.0, lambda m: p["depth"] * _one(m)),
    ),
    "fast_notch": lambda world, p: replace(
        world,
        section=Section(p["frequency_hz"], 2.0, lambda m: -p["depth"] * _high(m.speed_mm_s)),
    ),
    "speed_times_force": _times_gain(
        lambda m, p: (
            p["exponent"] * np.log(m.speed_mm_s / V0_MM_S) * np.log(m.normal_force_n / F0_N)
        )
    ),
    "gain_step": _times_gain(
        lambda m, p: p["log_change"] * float(m.minutes >= p["minutes"]) * _one(m)
    ),
    "other_mount": lambda world, p: replace(
        world, mount=other_mount(p["resonance_hz"], p["damping"])
    ),
    "extra_resonance": lambda world, p: replace(
        world, section=Section(p["frequency_hz"], p["quality"], lambda m: p["depth"] * _one(m))
    ),
    "notch_at_speed": lambda world, p: replace(
        world,
        section=Section(
            p["frequency_hz"], p["quality"], lambda m: -p["depth"] * _high(m.speed_mm_s)
        ),
    ),
    "echo": lambda world, p: replace(world, echo=Echo(p["delay_s"], p["share"])),
    "coupling": _times_gain(
        lambda m, p: (
            p["exponent"] * np.log(m.speed_mm_s / V0_MM_S) * np.log(m.normal_force_n / F0_N)
        )
    ),
    "time_step": _times_gain(
        lambda m, p: p["log_change"] * float(m.minutes >= p["minutes"]) * _one(m)
    ),
    "contact_loss": lambda world, p: world.with_gain(
        lambda m: 1.0 - p["share"] / (1.0 + (m.normal_force_n / p["force_n"]) ** 12)
    ),
    "force_saturation": lambda world, p: world.with_gain(
        lambda m: (1.0 + (m.normal_force_n / p["force_n"]) ** 10) ** (-p["exponent"] / 10.0)
    ),
    "bent_cutoff": _times_cutoff(
        lambda m, p: -p["exponent"] * 0.1 * np.log1p((m.speed_mm_s / p["speed_mm_s"]) ** 10.0)
    ),
    "light_cutoff": _times_cutoff(
        lambda m, p: np.log1p(-p["share"] / (1.0 + (m.normal_force_n / p["force_n"]) ** 12))
    ),
    "two_time_constants": lambda world, p: replace(
        world, shelf=Shelf(p["corner_hz"], -p["share"])
    ),
}

FORMS: Final[Mapping[tuple[str, str], Change]] = (
    {(name, "catalogue"): change for name, change in CATALOGUE.items()}
    | dict(OTHER_FORMS)
    | dict(OTHER_SHAPES)
    | {(name, "unknown"): change for name, change in UNKNOWN.items()}
)


def _one(moment: Moment) -> FloatArray:
    return np.ones_like(moment.speed_mm_s)

"""Which things are hidden, at which size, in which design."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Final

import numpy as np
from tests.blind.generator.case import Case, Design, Hidden
from tests.blind.generator.faults import FAULTS
from tests.blind.generator.people import SECOND_MODE

REALISTIC: Final[Mapping[str, dict[str, float]]] = {
    "speed_dependent_cutoff": {"slope_hz_per_mm_s": 4.8},
    "force_dependent_cutoff": {"exponent": 0.18},
    "cutoff_drift": {"per_minute": 0.02},
    "speed_dependent_gain": {"exponent": 0.25},
    "force_dependent_gain": {"exponent": 0.18},
    "gain_drift": {"per_minute": 0.02},
    "direction_asymmetry": {"share": 0.06},
    "position_dependent_gain": {"per_mm": 0.005},
    "charge_leakage": {"corner_hz": 1.0},
    "channel_delay": {"delay_s": 4e-6},
    "mount_resonance_shift": {"share": 0.0048},
    "fractional_rolloff": {"excess_order": 0.12},
    "residual_quadratic": {"share": 0.0048},
    "amplitude_compression": {"share": 0.0048},
    "mains_interference": {"amplitude_n": 0.004, "frequency_hz": 50.0},
    "stick_slip": {"amplitude_n": 0.06},
}
"""Twice the smallest that a prototype found. Drifts: a logarithm of 0.4 over 20 minutes."""

POSITIVE: Final = frozenset(
    {"charge_leakage", "channel_delay", "mains_interference", "stick_slip"}
)
"""Drawn without a sign. A delay may have one; that of an early channel is a kind of its own, so
that studies that were drawn before are drawn again."""

CONFUSABLE: Final = (
    {"channel_delay", "fractional_rolloff"},
    {"speed_dependent_gain", "stick_slip"},
)
"""Not drawn as a pair: a usual design need not tell them apart."""


def cause(
    name: str, size: float, rng: np.random.Generator, sign: float | None = None
) -> Hidden:
    """Return a cause of the catalogue, of so many times the realistic size.

    Parameters
    ----------
    name : str
    size : float
    rng : numpy.random.Generator
    sign : float, optional
        Drawn if not given; always positive where a cause has no sign.
    """
    drawn = 1.0 if name in POSITIVE else float(rng.choice([-1.0, 1.0]))
    chosen = drawn if sign is None else sign
    first, *_ = REALISTIC[name]
    parameters = REALISTIC[name] | {first: chosen * size * REALISTIC[name][first]}
    if name == "mains_interference":
        parameters["frequency_hz"] = float(rng.choice([50.0, 60.0]))
    return Hidden(name, parameters)


OTHER_FORMS: Final[Mapping[tuple[str, str], dict[str, float]]] = {
    ("speed_dependent_cutoff", "step"): {"log_change": 0.5},
    ("cutoff_drift", "saturating"): {"log_change": 0.5},
    ("speed_dependent_gain", "step"): {"log_change": 0.2},
    ("force_dependent_gain", "saturating"): {"log_change": 0.4},
    ("gain_drift", "saturating"): {"log_change": 0.5},
    ("direction_asymmetry", "slow_only"): {"share": 0.10},
    ("position_dependent_gain", "quadratic"): {"log_change": 0.6},
    ("charge_leakage", "shelf"): {"corner_hz": 60.0, "share": 0.1},
    ("fractional_rolloff", "power_inside"): {"excess_order": 0.15},
    ("residual_quadratic", "charging"): {"share": 0.0072},
    ("amplitude_compression", "slewing"): {"share": 0.0048},
}

MANY_TONES: Final = Design(n_tones=15, n_forces=1)
"""So that a mode can be located: fifteen tones, four speeds."""


def _unknown(name: str, rng: np.random.Generator) -> Case:
    sign = float(rng.choice([-1.0, 1.0]))
    if name == "hidden_mode":
        depth = 10.0 ** (sign * 2.0 / 20.0) - 1.0
        hidden = Hidden(name, {"depth": depth, "frequency_hz": 180.0}, "unknown")
        return Case("unknown", (hidden,), replace(MANY_TONES, near_hz=180.0))
    if name == "fast_notch":
        hidden = Hidden(name, {"depth": 0.3, "frequency_hz": 500.0}, "unknown")
        return Case("unknown", (hidden,), replace(MANY_TONES, near_hz=500.0))
    if name == "speed_times_force":
        return Case("unknown", (Hidden(name, {"exponent": 0.4 * sign}, "unknown"),))
    step = Hidden(name, {"log_change": 0.3 * sign, "minutes": 10.0}, "unknown")
    return Case("unknown", (step,))


UNKNOWN: Final = ("hidden_mode", "fast_notch", "speed_times_force", "gain_step")


def _moved_mount(which: str, rng: np.random.Generator) -> Case:
    if which == "moved":
        hidden = Hidden("mount_resonance_shift", {"share": 1636.0 / 1714.0 - 1.0})
        return Case("mount_moved", (hidden,))
    values = {"resonance_hz": float(rng.uniform(600.0, 1300.0)), "damping": 0.05}
    return Case("mount_moved", (Hidden("other_mount", values, "unknown"),))


def _cannot_tell(which: str, rng: np.random.Generator) -> Case:
    if which in ("gain_drift", "speed_dependent_gain"):
        design = Design(order="speed_blocks")
        return Case("cannot_tell", (cause(which, 1.0, rng),), design)
    # At 900 Hz a delay shows half as much as at 2 kHz, and this one must be seen.
    size = 3.0 if which == "channel_delay" else 1.0
    return Case("cannot_tell", (cause(which, size, rng),), Design(tones_hz=(150.0, 900.0)))


CANNOT_TELL: Final = (
    "gain_drift",
    "speed_dependent_gain",
    "fractional_rolloff",
    "channel_delay",
)


def _pair(rng: np.random.Generator) -> Case:
    names = sorted(REALISTIC)
    while True:
        first, second = rng.choice(names, 2, replace=False).tolist()
        if {first, second} not in CONFUSABLE:
            return Case("pair", (cause(first, 1.0, rng), cause(second, 1.0, rng)))


def _other_form(which: str, rng: np.random.Generator) -> Case:
    name, form = next(known for known in OTHER_FORMS if known[0] == which)
    values = OTHER_FORMS[name, form]
    first, *_ = values
    sign = 1.0 if name in POSITIVE else float(rng.choice([-1.0, 1.0]))
    return Case("other_form", (Hidden(name, values | {first: sign * values[first]}, form),))


STEEPER: Final = "speed_dependent_cutoff"
"""What is hidden in studies driven by noise; a slope of the cutoff needs no tone below it."""


def _noise(which: str) -> Case:
    slope = {"slope_hz_per_mm_s": 7.0}
    hidden = (Hidden(STEEPER, slope),) if which else ()
    return Case("noise", hidden, Design(n_tones=0))


SKINS: Final = Design(n_tones=12, n_speeds=3, n_forces=1)
"""So that a mode of the skin can be fitted: each tone at three speeds."""


def _skin(which: str, rng: np.random.Generator) -> Case:
    """Return a study of skins of 6 to 12 people, which may have a mode anywhere."""
    design = replace(SKINS, participants=int(rng.integers(6, 13)))
    if not which:
        return Case("skin", (), design)
    mode = {
        "share": float(rng.uniform(0.25, 0.6)),
        "frequency_hz": float(np.exp(rng.uniform(np.log(150.0), np.log(700.0)))),
        "quality": float(rng.uniform(2.0, 7.0)),
    }
    return Case("skin", (Hidden(which, mode),), design)


def _lifelike(which: str, rng: np.random.Generator) -> Case:
    """Return a study of 8 to 12 people who do not stroke as a machine would."""
    design = Design(participants=int(rng.integers(8, 13)), lifelike=True)
    return Case("lifelike", (cause(which, 1.0, rng),) if which else (), design)


def _faulty(fault: str, rng: np.random.Generator) -> Case:
    """Return a lifelike study with a fault of the rig; half of them hide a cause, too."""
    hides = rng.uniform() < 0.5
    drawn = _lifelike(str(rng.choice(list(REALISTIC))) if hides else "", rng)
    return Case("faulty", drawn.hidden, replace(drawn.design, fault=fault))


Draw = Callable[[str, np.random.Generator], Case]

KINDS: Final[Mapping[str, tuple[tuple[str, ...], Draw]]] = {
    "null": (("",), lambda which, rng: Case("null")),
    "single": (
        tuple(REALISTIC),
        lambda which, rng: Case("single", (cause(which, 1.0, rng),)),
    ),
    "below": (
        tuple(REALISTIC),
        lambda which, rng: Case("below", (cause(which, 0.25, rng),)),
    ),
    "pair": (("",), lambda which, rng: _pair(rng)),
    "unknown": (UNKNOWN, _unknown),
    "other_form": (tuple(name for name, _ in OTHER_FORMS), _other_form),
    "cannot_tell": (CANNOT_TELL, _cannot_tell),
    "paper": (("",), lambda which, rng: Case("paper")),
    "mount_moved": (("moved", "other"), _moved_mount),
    "noise": (("", STEEPER), lambda which, rng: _noise(which)),
    "skin": (("", SECOND_MODE), _skin),
    "early": (
        ("channel_delay",),
        lambda which, rng: Case("early", (cause(which, 1.0, rng, sign=-1.0),)),
    ),
    "lifelike": (("", *REALISTIC), _lifelike),
    "faulty": (tuple(FAULTS), _faulty),
}
"""By name: what may be asked for, and how a case is drawn."""


def draw_case(kind: str, which: str, rng: np.random.Generator, seconds: float = 2.0) -> Case:
    """Return a case of a kind.

    Parameters
    ----------
    kind : str
        A key of `KINDS`.
    which : str
        One of its names.
    rng : numpy.random.Generator
    seconds : float
        Duration of a trial.
    """
    case = KINDS[kind][1](which, rng)
    return replace(case, design=replace(case.design, seconds=seconds))

"""Forms of a friction response without a known cause: a grammar, and smooth discrepancies.

Discovery fits them to what no cause of the catalogue explains; twin and synthesis use them as
any effect. Each parameter has the range in which it is looked for, and nothing is followed
beyond where it was measured (`paths.MEASURED`, and what a law confines its schedule to).
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from itertools import product
from types import MappingProxyType
from typing import Final, Literal

from frictus_hardware.physics.effect import EffectDefinition, Parameter, Values, with_term
from frictus_hardware.physics.linear import TransferFunction
from frictus_hardware.physics.paths import Branch, DelayLine, Dose, FilterBank, ParallelPath
from frictus_hardware.physics.schedule import Coupling, Knee, Quantity, Switch, Term
from frictus_hardware.physics.simulator import Simulator

Part = Literal["gain", "cutoff"]
PARTS: Final[tuple[Part, ...]] = ("gain", "cutoff")
QUANTITIES: Final[Mapping[str, Quantity]] = {
    "speed": "speed_mm_s",
    "force": "normal_force_n",
    "time": "minutes",
    "direction": "direction",
    "position": "position_mm",
}
"""By the word in an id."""
WIDTHS: Final = {"speed": 4.0, "force": 0.03, "time": 0.2}
"""Over which a switch turns if nothing is said of it, in the quantity's unit."""
_WIDTH_BOUNDS: Final = {"speed": (1.0, 20.0), "force": (0.0075, 0.15), "time": (0.02, 10.0)}
BANDS_HZ: Final = (31, 62, 125, 250, 500, 1000, 2000)
"""Centres of the octaves of an empirical discrepancy."""
QUALITY: Final = math.sqrt(2.0)
"""Of an octave: a band pass is down by 3 dB at its edges."""

_BY_SPEED = Parameter("by_speed", "1", -2.0, 2.0, 0.01, default=0.0)
_BY_FORCE = Parameter("by_force", "1", -2.0, 2.0, 0.01, default=0.0)


def band_pass(frequency_hz: float, damping: float) -> TransferFunction:
    """Return ``2 d w s / (s^2 + 2 d w s + w^2)``: 1 at its frequency.

    Parameters
    ----------
    frequency_hz : float
        Of the resonance.
    damping : float
        Ratio d.
    """
    omega = 2.0 * math.pi * frequency_hz
    width = 2.0 * damping * omega
    return TransferFunction((width, 0.0), (1.0, width, omega**2))


def _path(
    dose: str, branch: Callable[[Values], Branch]
) -> Callable[[Simulator, Values], Simulator]:
    def extend(simulator: Simulator, values: Values) -> Simulator:
        rates: tuple[tuple[Quantity, float], ...] = (
            ("speed_mm_s", values["by_speed"]),
            ("normal_force_n", values["by_force"]),
        )
        path = ParallelPath(Dose(values[dose], rates), branch(values))
        return replace(simulator, paths=(*simulator.paths, path))

    return extend


def _high_pass(corner_hz: float) -> TransferFunction:
    return TransferFunction((-1.0, 0.0), (1.0, 2.0 * math.pi * corner_hz))


_PATHS: Final = (
    EffectDefinition(
        id="extra_resonance",
        equation=(
            "One more resonance: the response times ``1 + depth B``, B a band pass of 1 at its "
            "frequency; below 0 it is a notch."
        ),
        response="friction",
        scope="participant",
        parameters=(
            Parameter("depth", "1", -0.95, 10.0, 0.005),
            Parameter("frequency_hz", "Hz", 20.0, 2500.0, 1.0, default=200.0),
            Parameter("damping", "1", 0.005, 2.0, 0.005, default=0.07),
            _BY_SPEED,
            _BY_FORCE,
        ),
        apply=_path("depth", lambda v: band_pass(v["frequency_hz"], v["damping"])),
    ),
    EffectDefinition(
        id="echo",
        equation="An echo: the response times ``1 + share exp(-s delay)``, a comb.",
        response="friction",
        scope="participant",
        parameters=(
            Parameter("share", "1", -0.9, 0.9, 0.005),
            Parameter("delay_s", "s", 2e-5, 0.02, 1e-6, default=1e-3),
            _BY_SPEED,
            _BY_FORCE,
        ),
        apply=_path("share", lambda v: DelayLine(v["delay_s"])),
    ),
    EffectDefinition(
        id="pole_zero_pair",
        equation=(
            "One more pole and zero, or a second time constant: the response times "
            "``1 - share s / (s + 2 pi corner)``."
        ),
        response="friction",
        scope="participant",
        parameters=(
            Parameter("share", "1", -5.0, 1.0, 0.005),
            Parameter("corner_hz", "Hz", 2.0, 5000.0, 1.0, default=100.0),
            _BY_SPEED,
            _BY_FORCE,
        ),
        apply=_path("share", lambda v: _high_pass(v["corner_hz"])),
    ),
)

_LIMITS: Final = {
    "speed": ("threshold_mm_s", "mm/s", 5.0, 150.0, 60.0),
    "force": ("threshold_n", "N", 0.05, 2.0, 0.4),
    "time": ("threshold_min", "min", 0.1, 240.0, 10.0),
}


_SOFTNESS: Final = Parameter("softness", "1", 0.01, 0.5, 0.002, default=0.01)


def _threshold(by: str) -> Parameter:
    name, unit, low, high, default = _LIMITS[by]
    return Parameter(name, unit, low, high, 1e-3 * default, default=default)


def _scheduled(
    part: Part, term: Callable[[Values], Term]
) -> Callable[[Simulator, Values], Simulator]:
    place: Literal["gain_factors", "cutoff_factors"] = (
        "gain_factors" if part == "gain" else "cutoff_factors"
    )
    return lambda simulator, values: with_term(simulator, place, term(values))


def _width(by: str) -> Parameter:
    unit, usual = _LIMITS[by][1], WIDTHS[by]
    name = _LIMITS[by][0].replace("threshold", "width")
    return Parameter(name, unit, *_WIDTH_BOUNDS[by], 0.02 * usual, default=usual)


def _switch(part: Part, by: str) -> EffectDefinition:
    threshold, width = _threshold(by), _width(by)

    def term(values: Values) -> Term:
        at = values[threshold.name]
        over = values[width.name]
        return Switch(QUANTITIES[by], at, over, values["log_change"])

    return EffectDefinition(
        id=f"{part}_switch_by_{by}",
        equation=(
            f"The {part} is another beyond a threshold of {by}: times ``exp(log_change)``, "
            "over a width."
        ),
        response="friction",
        scope="participant",
        parameters=(Parameter("log_change", "1", -3.0, 3.0, 0.005), threshold, width),
        apply=_scheduled(part, term),
    )


def _knee(part: Part, by: str, side: str) -> EffectDefinition:
    threshold = _threshold(by)

    def term(values: Values) -> Term:
        at = values[threshold.name]
        softness = values["softness"]
        return Knee(QUANTITIES[by], at, values["exponent"], side == "above", softness)

    return EffectDefinition(
        id=f"{part}_knee_{side}_{by}",
        equation=(
            f"The {part} follows the {by} {side} a threshold only: "
            "``(x / threshold)^exponent``, bending within a softness of ``ln x``."
        ),
        response="friction",
        scope="participant",
        parameters=(Parameter("exponent", "1", -4.0, 4.0, 0.01), threshold, _SOFTNESS),
        apply=_scheduled(part, term),
    )


def _coupling(part: Part) -> EffectDefinition:
    return EffectDefinition(
        id=f"{part}_coupling_of_speed_and_force",
        equation=f"The {part} follows a product: ``exp(exponent ln(v / v0) ln(F / F0))``.",
        response="friction",
        scope="participant",
        parameters=(Parameter("exponent", "1", -2.0, 2.0, 0.01),),
        apply=_scheduled(part, lambda values: Coupling(values["exponent"])),
    )


def band_names() -> tuple[str, ...]:
    """Return the parameters of an empirical discrepancy, one per octave."""
    return tuple(f"at_{centre}_hz" for centre in BANDS_HZ)


def _empirical(by: str) -> EffectDefinition:
    rates: tuple[tuple[Quantity, float], ...] = () if by == "none" else ((QUANTITIES[by], 1.0),)

    def extend(simulator: Simulator, values: Values) -> Simulator:
        bands = tuple(
            (values[name], band_pass(float(centre), 0.5 / QUALITY))
            for centre, name in zip(BANDS_HZ, band_names(), strict=True)
        )
        dose = Dose(values["strength"], rates, level=0.0 if rates else 1.0)
        path = ParallelPath(dose, FilterBank(bands))
        return replace(simulator, paths=(*simulator.paths, path))

    everywhere = "in all conditions" if by == "none" else f"times the scaled {by}"
    return EffectDefinition(
        id="empirical" if by == "none" else f"empirical_by_{by}",
        equation=(
            "No form, only a smooth discrepancy: ``1 + strength sum a_k B_k``, B_k octave band "
            f"passes from {BANDS_HZ[0]} to {BANDS_HZ[-1]} Hz, {everywhere}."
        ),
        response="friction",
        scope="participant",
        parameters=(
            Parameter("strength", "1", 0.0, 1.0, 0.05),
            *(Parameter(name, "1", -0.9, 3.0, 0.005, default=0.0) for name in band_names()),
        ),
        apply=extend,
    )


def _made() -> dict[str, EffectDefinition]:
    made = [
        *_PATHS,
        *(_switch(part, by) for part, by in product(PARTS, WIDTHS)),
        *(
            _knee(part, by, side)
            for part, by, side in product(PARTS, ("speed", "force"), ("above", "below"))
        ),
        *map(_coupling, PARTS),
        *map(_empirical, ("none", *QUANTITIES)),
    ]
    return {form.id: form for form in sorted(made, key=lambda form: form.id)}


FORMS: Final[Mapping[str, EffectDefinition]] = MappingProxyType(_made())
"""By id, in alphabetical order."""

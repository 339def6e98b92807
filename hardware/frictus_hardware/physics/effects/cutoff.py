"""Effects on the cutoff of the friction response, and on how steeply it falls."""

from dataclasses import replace

from frictus_hardware.physics.effect import EffectDefinition, Parameter, Values, with_term
from frictus_hardware.physics.schedule import (
    REFERENCE_FORCE_N,
    REFERENCE_SPEED_MM_S,
    Exponential,
    Linear,
    Power,
)
from frictus_hardware.physics.simulator import Simulator


def _with_speed(simulator: Simulator, values: Values) -> Simulator:
    term = Linear("speed_mm_s", REFERENCE_SPEED_MM_S, values["slope_hz_per_mm_s"])
    return with_term(simulator, "cutoff_terms_hz", term)


def _with_force(simulator: Simulator, values: Values) -> Simulator:
    return with_term(
        simulator,
        "cutoff_factors",
        Power("normal_force_n", REFERENCE_FORCE_N, values["exponent"]),
    )


def _with_time(simulator: Simulator, values: Values) -> Simulator:
    return with_term(
        simulator, "cutoff_factors", Exponential("minutes", 0.0, values["per_minute"])
    )


def _order(simulator: Simulator, values: Values) -> Simulator:
    order = simulator.excess_order + values["excess_order"]
    return replace(simulator, excess_order=order)


EFFECTS = (
    EffectDefinition(
        id="speed_dependent_cutoff",
        equation="The cutoff rises with the speed: ``c(v) + slope (v - v0)``, v0 = 60 mm/s.",
        response="friction",
        scope="participant",
        parameters=(Parameter("slope_hz_per_mm_s", "Hz per mm/s", -100.0, 100.0, 0.2),),
        apply=_with_speed,
    ),
    EffectDefinition(
        id="force_dependent_cutoff",
        equation="The cutoff follows the normal force: ``c (F / F0)^a``, F0 = 0.4 N.",
        response="friction",
        scope="participant",
        parameters=(Parameter("exponent", "1", -2.0, 2.0, 0.01),),
        apply=_with_force,
    ),
    EffectDefinition(
        id="cutoff_drift",
        equation="The cutoff drifts over the session: ``c exp(r t)``, t in minutes.",
        response="friction",
        scope="participant",
        parameters=(Parameter("per_minute", "1/min", -1.0, 1.0, 0.001),),
        apply=_with_time,
    ),
    EffectDefinition(
        id="fractional_rolloff",
        equation="Friction falls with another order than one: ``g (1 + s / w0)^-(1 + a)``.",
        response="friction",
        scope="participant",
        parameters=(Parameter("excess_order", "1", -0.5, 0.5, 0.005),),
        apply=_order,
    ),
)

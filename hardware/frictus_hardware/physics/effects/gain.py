"""Effects on the gain: what the friction per unit of drive is multiplied with."""

from frictus_hardware.physics.effect import EffectDefinition, Parameter, Values, with_term
from frictus_hardware.physics.schedule import (
    REFERENCE_FORCE_N,
    REFERENCE_POSITION_MM,
    REFERENCE_SPEED_MM_S,
    Exponential,
    Linear,
    Power,
)
from frictus_hardware.physics.simulator import Simulator


def _with_speed(simulator: Simulator, values: Values) -> Simulator:
    return with_term(
        simulator, "gain_factors", Power("speed_mm_s", REFERENCE_SPEED_MM_S, values["exponent"])
    )


def _with_force(simulator: Simulator, values: Values) -> Simulator:
    return with_term(
        simulator,
        "gain_factors",
        Power("normal_force_n", REFERENCE_FORCE_N, values["exponent"]),
    )


def _with_position(simulator: Simulator, values: Values) -> Simulator:
    factor = Exponential("position_mm", REFERENCE_POSITION_MM, values["per_mm"])
    return with_term(simulator, "gain_factors", factor)


def _with_direction(simulator: Simulator, values: Values) -> Simulator:
    return with_term(
        simulator, "gain_factors", Linear("direction", 0.0, values["share"], at_reference=1.0)
    )


def _with_time(simulator: Simulator, values: Values) -> Simulator:
    return with_term(
        simulator, "gain_factors", Exponential("minutes", 0.0, values["per_minute"])
    )


EFFECTS = (
    EffectDefinition(
        id="speed_dependent_gain",
        equation="The gain follows the speed: ``g (v / v0)^a``, v0 = 60 mm/s.",
        response="friction",
        scope="participant",
        parameters=(Parameter("exponent", "1", -2.0, 2.0, 0.01),),
        apply=_with_speed,
    ),
    EffectDefinition(
        id="force_dependent_gain",
        equation="The gain follows the normal force: ``g (F / F0)^a``, F0 = 0.4 N.",
        response="friction",
        scope="participant",
        parameters=(Parameter("exponent", "1", -2.0, 2.0, 0.01),),
        apply=_with_force,
    ),
    EffectDefinition(
        id="position_dependent_gain",
        equation="The gain varies along the screen: ``g exp(p (x - x0))``, x0 = 35 mm.",
        response="friction",
        scope="instrument",
        parameters=(Parameter("per_mm", "1/mm", -0.1, 0.1, 0.0002),),
        apply=_with_position,
    ),
    EffectDefinition(
        id="direction_asymmetry",
        equation=(
            "The gain differs between the directions: ``g (1 + a d)``, d = +1 left to right."
        ),
        response="friction",
        scope="participant",
        parameters=(Parameter("share", "1", -0.9, 0.9, 0.005),),
        apply=_with_direction,
    ),
    EffectDefinition(
        id="gain_drift",
        equation="The gain drifts over the session: ``g exp(r t)``, t in minutes.",
        response="friction",
        scope="participant",
        parameters=(Parameter("per_minute", "1/min", -1.0, 1.0, 0.001),),
        apply=_with_time,
    ),
)

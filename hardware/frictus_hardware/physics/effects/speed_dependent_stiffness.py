"""The skin's stiffness follows the speed: ``k (v / v0)^a``, v0 = 60 mm/s."""

from collections.abc import Mapping
from dataclasses import replace

from frictus_hardware.physics.effect import Effect, Parameter
from frictus_hardware.physics.schedule import REFERENCE_SPEED_MM_S, Power
from frictus_hardware.physics.simulator import Simulator


def _extend(simulator: Simulator, parameters: Mapping[str, float]) -> Simulator:
    factor = Power("speed_mm_s", REFERENCE_SPEED_MM_S, parameters["exponent"])
    factors = (*simulator.skin.stiffness_factors, factor)
    return replace(simulator, skin=replace(simulator.skin, stiffness_factors=factors))


EFFECT = Effect(
    id="speed_dependent_stiffness",
    response="mobility",
    scope="participant",
    parameters=(Parameter("exponent", "1", -2.0, 2.0, 0.01),),
    extend=_extend,
)

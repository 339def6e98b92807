"""The gain varies along the screen: ``g exp(p (x - x0))``, x0 = 35 mm."""

from collections.abc import Mapping
from dataclasses import replace

from frictus_hardware.physics.effect import Effect, Parameter
from frictus_hardware.physics.schedule import REFERENCE_POSITION_MM, Exponential
from frictus_hardware.physics.simulator import Simulator


def _extend(simulator: Simulator, parameters: Mapping[str, float]) -> Simulator:
    factor = Exponential("position_mm", REFERENCE_POSITION_MM, parameters["per_mm"])
    schedule = simulator.schedule
    factors = (*schedule.gain_factors, factor)
    return replace(simulator, schedule=replace(schedule, gain_factors=factors))


EFFECT = Effect(
    id="position_dependent_gain",
    response="friction",
    scope="instrument",
    parameters=(Parameter("per_mm", "1/mm", -0.1, 0.1, 0.0002),),
    extend=_extend,
)

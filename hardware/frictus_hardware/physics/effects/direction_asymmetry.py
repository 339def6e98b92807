"""The gain differs between the directions: ``g (1 + a d)``, d = +1 left to right."""

from collections.abc import Mapping
from dataclasses import replace

from frictus_hardware.physics.effect import Effect, Parameter
from frictus_hardware.physics.schedule import Linear
from frictus_hardware.physics.simulator import Simulator


def _extend(simulator: Simulator, parameters: Mapping[str, float]) -> Simulator:
    factor = Linear("direction", 0.0, parameters["share"], at_reference=1.0)
    schedule = simulator.schedule
    factors = (*schedule.gain_factors, factor)
    return replace(simulator, schedule=replace(schedule, gain_factors=factors))


EFFECT = Effect(
    id="direction_asymmetry",
    response="friction",
    scope="participant",
    parameters=(Parameter("share", "1", -0.9, 0.9, 0.005),),
    extend=_extend,
)

"""The gain drifts over the session: ``g exp(r t)``, t in minutes."""

from collections.abc import Mapping
from dataclasses import replace

from frictus_hardware.physics.effect import Effect, Parameter
from frictus_hardware.physics.schedule import Exponential
from frictus_hardware.physics.simulator import Simulator


def _extend(simulator: Simulator, parameters: Mapping[str, float]) -> Simulator:
    factor = Exponential("minutes", 0.0, parameters["per_minute"])
    schedule = simulator.schedule
    factors = (*schedule.gain_factors, factor)
    return replace(simulator, schedule=replace(schedule, gain_factors=factors))


EFFECT = Effect(
    id="gain_drift",
    response="friction",
    scope="participant",
    parameters=(Parameter("per_minute", "1/min", -1.0, 1.0, 0.001),),
    extend=_extend,
)

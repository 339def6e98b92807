"""The cutoff drifts over the session: ``c exp(r t)``, t in minutes."""

from collections.abc import Mapping
from dataclasses import replace

from frictus_hardware.physics.effect import Effect, Parameter
from frictus_hardware.physics.schedule import Exponential
from frictus_hardware.physics.simulator import Simulator


def _extend(simulator: Simulator, parameters: Mapping[str, float]) -> Simulator:
    factor = Exponential("minutes", 0.0, parameters["per_minute"])
    schedule = simulator.schedule
    factors = (*schedule.cutoff_factors, factor)
    return replace(simulator, schedule=replace(schedule, cutoff_factors=factors))


EFFECT = Effect(
    id="cutoff_drift",
    response="friction",
    scope="participant",
    parameters=(Parameter("per_minute", "1/min", -1.0, 1.0, 0.001),),
    extend=_extend,
)

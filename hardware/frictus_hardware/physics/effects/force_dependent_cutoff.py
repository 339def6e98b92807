"""The cutoff follows the normal force: ``c (F / F0)^a``, F0 = 0.4 N."""

from collections.abc import Mapping
from dataclasses import replace

from frictus_hardware.physics.effect import Effect, Parameter
from frictus_hardware.physics.schedule import REFERENCE_FORCE_N, Power
from frictus_hardware.physics.simulator import Simulator


def _extend(simulator: Simulator, parameters: Mapping[str, float]) -> Simulator:
    factor = Power("normal_force_n", REFERENCE_FORCE_N, parameters["exponent"])
    schedule = simulator.schedule
    factors = (*schedule.cutoff_factors, factor)
    return replace(simulator, schedule=replace(schedule, cutoff_factors=factors))


EFFECT = Effect(
    id="force_dependent_cutoff",
    response="friction",
    scope="participant",
    parameters=(Parameter("exponent", "1", -2.0, 2.0, 0.01),),
    extend=_extend,
)

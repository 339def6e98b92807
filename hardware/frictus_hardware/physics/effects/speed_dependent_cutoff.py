"""The cutoff rises with the speed: ``c(v) + slope (v - v0)``, v0 = 60 mm/s."""

from collections.abc import Mapping
from dataclasses import replace

from frictus_hardware.physics.effect import Effect, Parameter
from frictus_hardware.physics.schedule import REFERENCE_SPEED_MM_S, Linear
from frictus_hardware.physics.simulator import Simulator


def _extend(simulator: Simulator, parameters: Mapping[str, float]) -> Simulator:
    term = Linear("speed_mm_s", REFERENCE_SPEED_MM_S, parameters["slope_hz_per_mm_s"])
    schedule = simulator.schedule
    terms = (*schedule.cutoff_terms_hz, term)
    return replace(simulator, schedule=replace(schedule, cutoff_terms_hz=terms))


EFFECT = Effect(
    id="speed_dependent_cutoff",
    response="friction",
    scope="participant",
    parameters=(Parameter("slope_hz_per_mm_s", "Hz per mm/s", -100.0, 100.0, 0.2),),
    extend=_extend,
)

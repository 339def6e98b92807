"""Friction falls with another order than one: ``g (1 + s / w0)^-(1 + a)``."""

from collections.abc import Mapping
from dataclasses import replace

from frictus_hardware.physics.effect import Effect, Parameter
from frictus_hardware.physics.simulator import Simulator


def _extend(simulator: Simulator, parameters: Mapping[str, float]) -> Simulator:
    order = simulator.excess_order + parameters["excess_order"]
    return replace(simulator, excess_order=order)


EFFECT = Effect(
    id="fractional_rolloff",
    response="friction",
    scope="participant",
    parameters=(Parameter("excess_order", "1", -0.5, 0.5, 0.005),),
    extend=_extend,
)

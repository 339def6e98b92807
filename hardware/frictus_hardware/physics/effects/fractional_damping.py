"""The skin's damping is of another order: ``b s (s / w_r)^a``, w_r = 2 pi 200 rad/s."""

from collections.abc import Mapping
from dataclasses import replace

from frictus_hardware.physics.effect import Effect, Parameter
from frictus_hardware.physics.simulator import Simulator


def _extend(simulator: Simulator, parameters: Mapping[str, float]) -> Simulator:
    order = simulator.skin.damping_excess_order + parameters["excess_order"]
    return replace(simulator, skin=replace(simulator.skin, damping_excess_order=order))


EFFECT = Effect(
    id="fractional_damping",
    response="mobility",
    scope="participant",
    parameters=(Parameter("excess_order", "1", -0.5, 0.5, 0.005),),
    extend=_extend,
)

"""The drive is not quite linear in V^2: ``m - 4 q m (1 - m)``, q of the second harmonic."""

from collections.abc import Mapping
from dataclasses import replace

from frictus_hardware.physics.effect import Effect, Parameter
from frictus_hardware.physics.simulator import Simulator


def _extend(simulator: Simulator, parameters: Mapping[str, float]) -> Simulator:
    size = 4.0 * parameters["share"]
    return replace(simulator, drive_map=simulator.drive_map.plus(-size, size, 0.0))


EFFECT = Effect(
    id="residual_quadratic",
    response="friction",
    scope="instrument",
    parameters=(Parameter("share", "1", -0.25, 0.25, 0.0005),),
    extend=_extend,
)

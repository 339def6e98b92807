"""The drive is compressed: ``z = 2 m - 1``, ``z + 4 a (z - z^3)``, -a of the third harmonic."""

from collections.abc import Mapping
from dataclasses import replace

from frictus_hardware.physics.effect import Effect, Parameter
from frictus_hardware.physics.simulator import Simulator


def _extend(simulator: Simulator, parameters: Mapping[str, float]) -> Simulator:
    size = 8.0 * parameters["share"]
    return replace(
        simulator, drive_map=simulator.drive_map.plus(-size, 3.0 * size, -2.0 * size)
    )


EFFECT = Effect(
    id="amplitude_compression",
    response="friction",
    scope="instrument",
    parameters=(Parameter("share", "1", -0.25, 0.125, 0.0005),),
    extend=_extend,
)

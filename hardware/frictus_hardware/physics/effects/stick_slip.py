"""The skin sticks and slips: a saw-tooth every 2 mm of path, ``a exp(-v / 20 mm/s)``."""

from collections.abc import Mapping
from dataclasses import replace

from frictus_hardware.physics.disturbances import StickSlip
from frictus_hardware.physics.effect import Effect, Parameter
from frictus_hardware.physics.simulator import Simulator


def _extend(simulator: Simulator, parameters: Mapping[str, float]) -> Simulator:
    oscillation = StickSlip(parameters["amplitude_n"])
    return replace(simulator, stick_slip=(*simulator.stick_slip, oscillation))


EFFECT = Effect(
    id="stick_slip",
    response="friction",
    scope="participant",
    parameters=(Parameter("amplitude_n", "N", 0.0, 2.0, 0.005),),
    extend=_extend,
)

"""A line of the mains stands in the force channel along x."""

from collections.abc import Mapping
from dataclasses import replace

from frictus_hardware.physics.disturbances import Hum
from frictus_hardware.physics.effect import Effect, Parameter
from frictus_hardware.physics.simulator import Simulator

MAINS_HZ = 50.0


def _extend(simulator: Simulator, parameters: Mapping[str, float]) -> Simulator:
    hum = Hum(parameters["amplitude_n"], parameters.get("frequency_hz", MAINS_HZ))
    return replace(simulator, hum=(*simulator.hum, hum))


EFFECT = Effect(
    id="mains_interference",
    response="friction",
    scope="instrument",
    parameters=(
        Parameter("amplitude_n", "N", 0.0, 1.0, 0.0005),
        Parameter("frequency_hz", "Hz", 45.0, 65.0, 0.01, default=MAINS_HZ),
    ),
    extend=_extend,
)

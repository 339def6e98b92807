"""A channel is late, and nobody said so: the drive, or for mobility the skin's."""

from collections.abc import Mapping
from dataclasses import replace

from frictus_hardware.physics.effect import Effect, Parameter
from frictus_hardware.physics.simulator import Simulator


def _extend(simulator: Simulator, parameters: Mapping[str, float]) -> Simulator:
    if simulator.response == "mobility":
        return replace(simulator, skin_delay_s=simulator.skin_delay_s + parameters["delay_s"])
    return replace(simulator, delay_s=simulator.delay_s + parameters["delay_s"])


EFFECT = Effect(
    id="channel_delay",
    response="both",
    scope="instrument",
    parameters=(Parameter("delay_s", "s", 0.0, 0.002, 2e-7),),
    extend=_extend,
)

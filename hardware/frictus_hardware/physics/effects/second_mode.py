"""A second resonance of the finger, beside the first: ``share / b`` at its frequency."""

from collections.abc import Mapping
from dataclasses import replace

from frictus_hardware.physics.effect import Effect, Parameter
from frictus_hardware.physics.simulator import Simulator
from frictus_hardware.physics.skin import SecondMode

FREQUENCY_HZ = 300.0


def _extend(simulator: Simulator, parameters: Mapping[str, float]) -> Simulator:
    mode = SecondMode(parameters["share"], parameters.get("frequency_hz", FREQUENCY_HZ))
    modes = (*simulator.skin.further_modes, mode)
    return replace(simulator, skin=replace(simulator.skin, further_modes=modes))


EFFECT = Effect(
    id="second_mode",
    response="mobility",
    scope="participant",
    parameters=(
        Parameter("share", "1", -0.9, 5.0, 0.005),
        Parameter("frequency_hz", "Hz", 50.0, 2000.0, 1.0, default=FREQUENCY_HZ),
    ),
    extend=_extend,
)

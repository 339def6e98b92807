"""The mount's upper resonance lies at ``1 + a`` times its nominal frequency."""

from collections.abc import Mapping
from dataclasses import replace

from frictus_hardware.physics.effect import Effect, Parameter
from frictus_hardware.physics.mount import with_moved_resonance
from frictus_hardware.physics.simulator import Simulator


def _extend(simulator: Simulator, parameters: Mapping[str, float]) -> Simulator:
    if simulator.mount is None:  # nothing resonates
        return simulator
    return replace(simulator, mount=with_moved_resonance(simulator.mount, parameters["share"]))


EFFECT = Effect(
    id="mount_resonance_shift",
    response="both",
    scope="instrument",
    parameters=(Parameter("share", "1", -0.5, 0.5, 0.0005),),
    extend=_extend,
)

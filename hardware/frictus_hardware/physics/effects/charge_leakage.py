"""Charge leaks away: the drive fraction passes ``s / (s + 2 pi f)``."""

import math
from collections.abc import Mapping
from dataclasses import replace

from frictus_hardware.physics.effect import Effect, Parameter
from frictus_hardware.physics.linear import TransferFunction
from frictus_hardware.physics.simulator import Simulator


def _extend(simulator: Simulator, parameters: Mapping[str, float]) -> Simulator:
    corner = 2.0 * math.pi * parameters["corner_hz"]
    leak = TransferFunction((1.0, 0.0), (1.0, corner))
    present = simulator.drive_filter
    return replace(simulator, drive_filter=leak if present is None else present * leak)


EFFECT = Effect(
    id="charge_leakage",
    response="friction",
    scope="instrument",
    parameters=(Parameter("corner_hz", "Hz", 0.0, 50.0, 0.1),),
    extend=_extend,
)

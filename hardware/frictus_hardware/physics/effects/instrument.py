"""Effects of the rig: drive path, delay, mount and mains."""

import math
from dataclasses import replace

from frictus_hardware.physics.disturbances import Hum
from frictus_hardware.physics.effect import EffectDefinition, Parameter, Values
from frictus_hardware.physics.linear import TransferFunction, with_moved_resonance
from frictus_hardware.physics.simulator import Simulator

MAINS_HZ = 50.0


def _compression(simulator: Simulator, values: Values) -> Simulator:
    size = 8.0 * values["share"]
    return replace(
        simulator, drive_map=simulator.drive_map.plus(-size, 3.0 * size, -2.0 * size)
    )


def _quadratic(simulator: Simulator, values: Values) -> Simulator:
    size = 4.0 * values["share"]
    return replace(simulator, drive_map=simulator.drive_map.plus(-size, size, 0.0))


def _leakage(simulator: Simulator, values: Values) -> Simulator:
    corner = 2.0 * math.pi * values["corner_hz"]
    leak = TransferFunction((1.0, 0.0), (1.0, corner))
    present = simulator.drive_filter
    return replace(simulator, drive_filter=leak if present is None else present * leak)


def _delay(simulator: Simulator, values: Values) -> Simulator:
    if simulator.response == "mobility":
        return replace(simulator, skin_delay_s=simulator.skin_delay_s + values["delay_s"])
    return replace(simulator, delay_s=simulator.delay_s + values["delay_s"])


def _resonance(simulator: Simulator, values: Values) -> Simulator:
    if simulator.mount is None:  # nothing resonates
        return simulator
    return replace(simulator, mount=with_moved_resonance(simulator.mount, values["share"]))


def _mains(simulator: Simulator, values: Values) -> Simulator:
    hum = Hum(values["amplitude_n"], values["frequency_hz"])
    return replace(simulator, hum=(*simulator.hum, hum))


EFFECTS = (
    EffectDefinition(
        id="amplitude_compression",
        equation=(
            "The drive is compressed: ``z = 2 m - 1``, ``z + 4 a (z - z^3)``, -a of the third "
            "harmonic."
        ),
        response="friction",
        scope="instrument",
        parameters=(Parameter("share", "1", -0.25, 0.125, 0.0005),),
        apply=_compression,
    ),
    EffectDefinition(
        id="residual_quadratic",
        equation=(
            "The drive is not quite linear in V^2: ``m - 4 q m (1 - m)``, q of the second "
            "harmonic."
        ),
        response="friction",
        scope="instrument",
        parameters=(Parameter("share", "1", -0.25, 0.25, 0.0005),),
        apply=_quadratic,
    ),
    EffectDefinition(
        id="charge_leakage",
        equation="Charge leaks away: the drive fraction passes ``s / (s + 2 pi f)``.",
        response="friction",
        scope="instrument",
        parameters=(Parameter("corner_hz", "Hz", 0.0, 50.0, 0.1),),
        apply=_leakage,
    ),
    EffectDefinition(
        id="channel_delay",
        equation=(
            "A channel is late, and nobody said so: the force's behind the drive's, or for "
            "mobility the skin's behind the force's. Below 0: the other one of the two is."
        ),
        response="both",
        scope="instrument",
        parameters=(Parameter("delay_s", "s", -0.002, 0.002, 2e-7),),
        apply=_delay,
    ),
    EffectDefinition(
        id="mount_resonance_shift",
        equation="The mount's upper resonance lies at ``1 + a`` times its nominal frequency.",
        response="both",
        scope="instrument",
        parameters=(Parameter("share", "1", -0.5, 0.5, 0.0005),),
        apply=_resonance,
    ),
    EffectDefinition(
        id="mains_interference",
        equation="A line of the mains stands in the force channel along x.",
        response="friction",
        scope="instrument",
        parameters=(
            Parameter("amplitude_n", "N", 0.0, 1.0, 0.0005),
            Parameter("frequency_hz", "Hz", 45.0, 65.0, 0.01, default=MAINS_HZ),
        ),
        apply=_mains,
    ),
)

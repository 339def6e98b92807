"""Effects on the moving skin: mass, damping, stiffness, further modes, stick-slip."""

from dataclasses import replace

from frictus_hardware.physics.disturbances import StickSlip
from frictus_hardware.physics.effect import EffectDefinition, Parameter, Values
from frictus_hardware.physics.schedule import REFERENCE_SPEED_MM_S, Power
from frictus_hardware.physics.simulator import Simulator
from frictus_hardware.physics.skin import SecondMode

SECOND_MODE_HZ = 300.0
SECOND_MODE_QUALITY = 5.0


def _mass(simulator: Simulator, values: Values) -> Simulator:
    factor = Power("speed_mm_s", REFERENCE_SPEED_MM_S, values["exponent"])
    factors = (*simulator.skin.mass_factors, factor)
    return replace(simulator, skin=replace(simulator.skin, mass_factors=factors))


def _stiffness(simulator: Simulator, values: Values) -> Simulator:
    factor = Power("speed_mm_s", REFERENCE_SPEED_MM_S, values["exponent"])
    factors = (*simulator.skin.stiffness_factors, factor)
    return replace(simulator, skin=replace(simulator.skin, stiffness_factors=factors))


def _damping(simulator: Simulator, values: Values) -> Simulator:
    order = simulator.skin.damping_excess_order + values["excess_order"]
    return replace(simulator, skin=replace(simulator.skin, damping_excess_order=order))


def _second_mode(simulator: Simulator, values: Values) -> Simulator:
    mode = SecondMode(
        values["share"],
        values["frequency_hz"],
        values["quality"],
    )
    modes = (*simulator.skin.further_modes, mode)
    return replace(simulator, skin=replace(simulator.skin, further_modes=modes))


def _stick_slip(simulator: Simulator, values: Values) -> Simulator:
    oscillation = StickSlip(values["amplitude_n"])
    return replace(simulator, stick_slip=(*simulator.stick_slip, oscillation))


EFFECTS = (
    EffectDefinition(
        id="speed_dependent_mass",
        equation="The moving mass follows the speed: ``m (v / v0)^a``, v0 = 60 mm/s.",
        response="mobility",
        scope="participant",
        parameters=(Parameter("exponent", "1", -2.0, 2.0, 0.01),),
        apply=_mass,
    ),
    EffectDefinition(
        id="speed_dependent_stiffness",
        equation="The skin's stiffness follows the speed: ``k (v / v0)^a``, v0 = 60 mm/s.",
        response="mobility",
        scope="participant",
        parameters=(Parameter("exponent", "1", -2.0, 2.0, 0.01),),
        apply=_stiffness,
    ),
    EffectDefinition(
        id="fractional_damping",
        equation=(
            "The skin's damping is of another order: ``b s (s / w_r)^a``, w_r = 2 pi 200 rad/s."
        ),
        response="mobility",
        scope="participant",
        parameters=(Parameter("excess_order", "1", -0.5, 0.5, 0.005),),
        apply=_damping,
    ),
    EffectDefinition(
        id="second_mode",
        equation=(
            "A second resonance of the finger, beside the first: ``share / b`` at its "
            "frequency."
        ),
        response="mobility",
        scope="participant",
        parameters=(
            Parameter("share", "1", -0.9, 5.0, 0.005),
            Parameter("frequency_hz", "Hz", 50.0, 2000.0, 1.0, default=SECOND_MODE_HZ),
            Parameter("quality", "1", 0.5, 50.0, 0.05, default=SECOND_MODE_QUALITY),
        ),
        apply=_second_mode,
    ),
    EffectDefinition(
        id="stick_slip",
        equation=(
            "The skin sticks and slips: a saw-tooth every 2 mm of path, "
            "``a exp(-v / 20 mm/s)``."
        ),
        response="friction",
        scope="participant",
        parameters=(Parameter("amplitude_n", "N", 0.0, 2.0, 0.005),),
        apply=_stick_slip,
    ),
)

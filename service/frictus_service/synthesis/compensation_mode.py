"""What the renderer inverts in each compensation mode: the model, at one speed, or nothing."""

from dataclasses import replace
from typing import Final

from frictus.compensation import Compensation
from frictus.errors import ArgumentError
from frictus_hardware.physics.friction import FrictionLaw, cutoff_hz
from frictus_service.synthesis.compensation import Inverse

BEYOND_HZ: Final = 1e5
"""A cutoff so high that its inverse is a plain gain up to any frequency that is felt."""


def uncompensated(law: FrictionLaw) -> FrictionLaw:
    """Return a law whose inverse is a plain gain."""
    return FrictionLaw(law.gain_n, BEYOND_HZ, 0.0, law.speed_range_mm_s)


def fixed_at(law: FrictionLaw, speed_mm_s: float) -> FrictionLaw:
    """Return a law whose inverse does not follow the speed."""
    cutoff = float(cutoff_hz(law, speed_mm_s))
    return FrictionLaw(law.gain_n, cutoff, 0.0, law.speed_range_mm_s)


def inverse_in_mode(inverse: Inverse, compensation: Compensation) -> Inverse:
    """Return what is inverted in a compensation mode instead of the model.

    Scenes stay compiled for the model: gain and bias do not depend on the mode, so that what is
    felt in two modes differs by the compensation alone.

    Parameters
    ----------
    inverse : Inverse
        Of the model in force.
    compensation : Compensation
        The mode. With `fixed` all that depends on the speed is taken at the fixed one; effects
        of force, place, direction and time are followed as before. With `none` effects are not
        undone either.

    Raises
    ------
    ArgumentError
        If the fixed speed is outside of what the model was measured for: its cutoff there would
        silently be that of another speed.
    """
    match compensation.mode:
        case "model":
            return inverse
        case "none":
            return Inverse(uncompensated(inverse.law))
        case "fixed":
            return _fixed(inverse, compensation.speed_mm_s)


def _fixed(inverse: Inverse, speed_mm_s: float | None) -> Inverse:
    slowest, fastest = inverse.law.speed_range_mm_s
    if speed_mm_s is None or not slowest <= speed_mm_s <= fastest:
        raise ArgumentError(
            f"speed_mm_s: {speed_mm_s}; the model holds from {slowest:g} to {fastest:g} mm/s: "
            "fix a speed within"
        )
    ranges = replace(inverse.ranges, speed_mm_s=(speed_mm_s, speed_mm_s))
    return replace(inverse, law=fixed_at(inverse.law, speed_mm_s), ranges=ranges)

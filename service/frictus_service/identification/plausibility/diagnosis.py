"""From what is implausible to the slip behind it: one slip trips several checks."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from frictus_service.identification.plausibility.finding import Finding

OF_FORCE: Final = (
    *("normal_sign", "force_unit", "force_target", "friction_sign", "friction_unit"),
    *("friction_axis", "force_axis", "drive_sign", "mobility_sign", "skin_unit", "skin_delay"),
)
CONSEQUENCES: Final = {
    "motion_axis": ("speed_unit", "speed_target", "skin_direction", "skin_scale"),
    "normal_axis": ("normal_flips", *OF_FORCE),
    "normal_flips": OF_FORCE,
    "normal_sign": ("force_target",),
    "force_unit": ("force_target", "skin_unit", "friction_unit"),
    "speed_unit": ("speed_target", "skin_scale"),
    "friction_unit": ("skin_unit",),
    "friction_axis": ("force_axis", "skin_unit", "skin_delay", "mobility_sign", "drive_sign"),
    "force_axis": ("skin_unit", "skin_delay", "mobility_sign", "drive_sign"),
    "skin_axis": ("skin_unit", "skin_delay", "mobility_sign", "skin_direction", "skin_scale"),
    "skin_scale": ("skin_unit",),
    "carrier": ("stamps", "stamps_missing", "skin_unit", "skin_delay"),
    "stamps": ("skin_scale", "speed_unit"),
}
"""By check: what it explains, which is then not said."""

SIGNS: Final = ("friction_sign", "drive_sign", "mobility_sign", "skin_direction")
"""Each compares two of force, skin and position, and trips where one of the two is turned."""

OF_SKIN: Final = ("mobility_sign", "skin_axis", "skin_direction", "skin_scale", "skin_unit")
"""Where these alone trip, it is the skin's sensor."""


def diagnose(findings: Sequence[Finding]) -> tuple[Finding, ...]:
    """Return the findings that no other one explains, those that stop first.

    Parameters
    ----------
    findings : sequence of Finding
        In the order of the checks.
    """
    explained = {
        consequence
        for cause in findings
        if cause.severity == "stop"
        for consequence in CONSEQUENCES.get(cause.code, ())
    }
    left = [each for each in findings if each.code not in explained]
    turned = _turned({each.code for each in left if each.severity == "stop"})
    told = [
        replace(each, remedy=turned) if turned and each.code in SIGNS else each for each in left
    ]
    return tuple(sorted(told, key=lambda finding: finding.severity != "stop"))


def without_skin(findings: Sequence[Finding]) -> tuple[Finding, ...]:
    """Return the findings where the skin's sensor is not used: nothing stops that is its own.

    Parameters
    ----------
    findings : sequence of Finding
        From `diagnose`.
    """
    if any(each.severity == "stop" and each.code not in OF_SKIN for each in findings):
        return tuple(findings)
    return tuple(
        replace(each, severity="warning", leaves_out=False) if each.code in OF_SKIN else each
        for each in findings
    )


def _turned(codes: set[str]) -> str | None:
    """Return which channel is turned, as what to do; None where no sign is wrong."""
    force_or_position = bool(codes & {"friction_sign", "drive_sign"})
    force_or_skin = "mobility_sign" in codes
    skin_or_position = "skin_direction" in codes
    if force_or_position and force_or_skin:
        return (
            "turn force_n along x: the sensor under the screen reports a force of the sign of "
            "the velocity"
        )
    if force_or_skin:
        return "turn accel_m_s2 or skin_velocity_m_s along x: force and positions agree"
    if force_or_position and skin_or_position:
        return (
            "turn position_mm along x (it rises to the right), or force_n and the skin's "
            "sensor, which agree"
        )
    if force_or_position:
        return (
            "turn force_n along x, or position_mm along x, or take off what the force sensor "
            "reports at rest"
        )
    return "turn the skin's sensor or position_mm along x" if skin_or_position else None

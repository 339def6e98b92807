"""How the accelerometer is mounted and how late the touch sensor is, by free strokes."""

from typing import Final

from frictus_hardware.sensors.rotation import AXES
from frictus_service.errors import AlignmentError
from frictus_service.identification.observation.sensor_alignment import (
    SensorAlignment,
    Strokes,
    align_sensors,
)
from frictus_service.identification.observation.sensor_discrepancies import (
    mounted_off_deg,
    sensor_discrepancies,
)
from frictus_service.selftest.playing import Played
from frictus_service.selftest.report import Finding, Measure, Outcome, judged, lost

TEST: Final = "strokes"
SECONDS: Final = 20.0
REQUEST: Final = (
    f"Put the accelerometer on your nail and stroke the screen for {SECONDS:g} s, without "
    "lifting, to and fro, slowly and fast, to the right and away from you"
)
TOLD_DEG: Final = 15.0
"""An angle that is known no better has not been told."""


def judge_strokes(played: Played, declared_latency_s: float) -> Outcome:
    """Say what strokes tell of the accelerometer, the force sensor and the touch sensor.

    Parameters
    ----------
    played : Played
        At zero drive, while somebody stroked.
    declared_latency_s : float
        Of the touch sensor, as configured.
    """
    if not played.touched:
        return Outcome(TEST, "skip", "nobody stroked the screen")
    if played.lost_samples:
        return lost(TEST, played.lost_samples)
    strokes = Strokes(
        played.sample_rate_hz,
        played.force_n,
        played.accel_m_s2,
        played.touches[:, 0] / played.sample_rate_hz,
        played.touches[:, 1:],
    )
    try:
        found = align_sensors([strokes])
    except AlignmentError as error:
        return Outcome(TEST, "warn", str(error), "run the test again")
    remarks = [
        Finding("fail" if slip.serious else "warn", slip.found, slip.to_do)
        for slip in sensor_discrepancies(found, declared_latency_s)
    ]
    return judged(TEST, _figures(found), remarks, _fine(found))


def _figures(found: SensorAlignment) -> list[Measure]:
    off_deg, half_deg = mounted_off_deg(found)
    late_ms, half_ms = 1e3 * found.touch_late_s, 2e3 * found.touch_late_sd_s
    figures = [
        Measure("off the configured frame", off_deg, "deg", half_deg),
        Measure("touch reports later than declared", late_ms, "ms", half_ms),
        Measure("acceleration over that of the strokes", found.scale, "", 2.0 * found.scale_sd),
        Measure("acceleration explained by the strokes", 100.0 * found.explained, "%"),
        Measure("strokes", found.seconds, "s"),
    ]
    if found.friction_off_deg is not None:
        figures.append(Measure("force off the motion", found.friction_off_deg, "deg"))
    if found.off_level_deg is not None:
        figures.append(Measure("gravity off the screen's depth", found.off_level_deg, "deg"))
    return figures


def _fine(found: SensorAlignment) -> str:
    late_ms, half_ms = 1e3 * found.touch_late_s, 2e3 * found.touch_late_sd_s
    text = (
        "the accelerometer is mounted as configured; touch reports are "
        f"{late_ms:+.1f} ± {half_ms:.1f} ms later than declared"
    )
    for axis, sd_deg in zip(AXES, found.rotation_sd_deg, strict=True):
        if 2.0 * sd_deg > TOLD_DEG:
            text += f"; the angle about {axis} is known within {2.0 * sd_deg:.0f}° only, since "
            text += "no strokes went across it"
    return text

"""How the sensors of a rig are mounted, by taps in known directions and by free strokes."""

from collections.abc import Sequence
from typing import Final

import numpy as np
from scipy.spatial.transform import Rotation

from frictus_hardware.arrays import FloatArray
from frictus_hardware.sensors.rotation import AXES, Orientation, check_orientation
from frictus_service.errors import AlignmentError
from frictus_service.identification.observation.sensor_alignment import (
    SensorAlignment,
    align_sensors,
)
from frictus_service.identification.observation.sensor_discrepancies import (
    mounted_off_deg,
    sensor_discrepancies,
)
from frictus_service.identification.observation.stroke_pieces import SensedStrokes
from frictus_service.selftest.playing import Played
from frictus_service.selftest.report import (
    Measure,
    Outcome,
    SelftestFinding,
    half_width,
    judged,
    lost,
)

TAPS_S: Final = 4.0
HOW: Final = {
    "force": "Tap the screen once so that it is pushed towards {axis}",
    "accel": "Lay the accelerometer down as it is worn and knock it once towards {axis}",
}
"""What to ask for, by what is sensed."""
WHERE: Final = {
    "x": "+x (to the right)",
    "y": "+y (away from you)",
    "z": "+z (into the screen)",
}


def requests(sensor: str) -> tuple[str, ...]:
    """Return what to ask for, one text per tap.

    Parameters
    ----------
    sensor : {'force', 'accel'}
    """
    end = f", within {TAPS_S:g} s of your answer, and let go"
    return tuple(HOW[sensor].format(axis=WHERE[axis]) + end for axis in AXES)


def judge_orientation(sensor: str, taps: Sequence[FloatArray]) -> Outcome:
    """Say how far a sensor is off the configured frame.

    Parameters
    ----------
    sensor : {'force', 'accel'}
    taps : sequence of three ndarray, shape (n_samples, 3)
        In the rig's frame as configured, while it was tapped towards +x, +y and +z.

    Raises
    ------
    SensorError
        If a tap cannot be told, or the taps are not along three lines.
    """
    found = check_orientation(taps, np.eye(3))
    half_deg = _half_deg(check_orientation(taps, found.rotation))
    vector_deg = np.rad2deg(Rotation.from_matrix(found.rotation).as_rotvec())
    figures = [
        Measure("off the configured frame", found.off_deg, "deg", half_deg),
        *(
            Measure(f"tap towards +{axis}, off by", off_deg, "deg")
            for axis, off_deg in zip(AXES, found.tap_off_deg, strict=True)
        ),
        *(
            Measure(f"still to turn about {axis}", float(deg), "deg", half_deg)
            for axis, deg in zip(AXES, vector_deg, strict=True)
        ),
    ]
    test = f"orientation, {sensor}"
    if found.fits:
        fine = f"{found.text()}, {found.off_deg:.0f} ± {half_deg:.0f}° in all"
        return judged(test, figures, [], fine)
    to_do = (
        f"correct the signs or the order of {sensor}.channels"
        if found.mirrored
        else f"add the rotation found to {sensor}.rotation, and tap again"
    )
    return judged(test, figures, [SelftestFinding("fail", found.text(), to_do)], "")


def _half_deg(fitted: Orientation) -> float:
    """Return half of the 95 % interval of each angle of a rotation, from what no rotation fits.

    Three taps give six angles, a rotation takes three of them; two taps see each of its angles.
    """
    left = np.sqrt(np.sum(np.square(fitted.tap_off_deg)) / 3.0)
    return half_width(float(left) / np.sqrt(2.0), 3)


TEST: Final = "strokes"
STROKES_S: Final = 20.0
REQUEST: Final = (
    f"Put the accelerometer on your nail and stroke the screen for {STROKES_S:g} s, without "
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
    strokes = SensedStrokes(
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
        SelftestFinding("fail" if slip.serious else "warn", slip.found, slip.to_do)
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

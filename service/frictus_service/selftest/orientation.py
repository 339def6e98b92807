"""The orientation of a sensor: three taps in known directions, beside what it says of them."""

from collections.abc import Sequence
from typing import Final

import numpy as np
from scipy.spatial.transform import Rotation

from frictus_hardware.arrays import FloatArray
from frictus_hardware.sensors.rotation import AXES, Orientation, check_orientation
from frictus_service.selftest.report import Finding, Measure, Outcome, half_width, judged

SECONDS: Final = 4.0
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
    end = f", within {SECONDS:g} s of your answer, and let go"
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
    return judged(test, figures, [Finding("fail", found.text(), to_do)], "")


def _half_deg(fitted: Orientation) -> float:
    """Return half of the 95 % interval of each angle of a rotation, from what no rotation fits.

    Three taps give six angles, a rotation takes three of them; two taps see each of its angles.
    """
    left = np.sqrt(np.sum(np.square(fitted.tap_off_deg)) / 3.0)
    return half_width(float(left) / np.sqrt(2.0), 3)

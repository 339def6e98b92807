"""What strokes say of a rig's sensors that is not as configured, and what to do about it."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.spatial.transform import Rotation

from frictus_hardware.sensors.rotation import AXES, angle_deg
from frictus_service.identification.observation.sensor_alignment import SensorAlignment

ROTATION_DEG: Final = 10.0, 20.0
FRICTION_DEG: Final = 20.0, 60.0
SCALE: Final = 0.1, 0.3
LATENCY_MS: Final = 3.0, 20.0
"""Up to the first all is fine, beyond the second it is serious; the interval is taken off."""
EXPLAINED: Final = 0.8
"""Share of the acceleration; less, and something else shakes the sensor."""


@dataclass(frozen=True, slots=True)
class SensorDiscrepancy:
    """Something that strokes contradict.

    Attributes
    ----------
    serious : bool
        Whether what is measured with it is worth nothing.
    found : str
        With figures.
    to_do : str
        What a person should do.
    """

    serious: bool
    found: str
    to_do: str


def sensor_discrepancies(
    found: SensorAlignment, declared_latency_s: float
) -> tuple[SensorDiscrepancy, ...]:
    """Return what is not as configured, the likeliest slips first.

    Parameters
    ----------
    found : SensorAlignment
        What strokes tell.
    declared_latency_s : float
        Of the touch sensor, as configured.
    """
    if found.mirrored:
        what = "the acceleration of the strokes and gravity form a left-handed frame"
        to_do = "correct the signs or the order of accel.channels"
        return (SensorDiscrepancy(True, what, to_do),)
    told = []

    def tell(size: float, bounds: tuple[float, float], what: str, to_do: str) -> None:
        if not size <= bounds[0]:
            told.append(SensorDiscrepancy(not size <= bounds[1], what, to_do))

    if found.friction_off_deg is not None:
        tell(
            abs(found.friction_off_deg),
            FRICTION_DEG,
            f"the lateral force is {found.friction_off_deg:+.0f}° off the motion",
            "correct the signs, the order or the rotation of force.channels",
        )
    off_deg, half_deg = mounted_off_deg(found)
    tell(
        off_deg - half_deg,
        ROTATION_DEG,
        f"the accelerometer is mounted {off_deg:.0f} ± {half_deg:.1g}° off what is configured",
        f"append {_turns(found)} to accel.rotation",
    )
    tell(
        abs(found.scale - 1.0) - 2.0 * found.scale_sd,
        SCALE,
        f"the acceleration is {found.scale:.3g} times that of the strokes",
        "correct the unit or the sensitivity of accel.channels, or the screen's size",
    )
    tell(
        1.0 - found.explained,
        (1.0 - EXPLAINED, 1.0),
        f"the strokes explain {found.explained:.0%} of the acceleration",
        "press the accelerometer on anew, and stroke faster",
    )
    late_ms, half_ms = 1e3 * found.touch_late_s, 2e3 * found.touch_late_sd_s
    age = "older" if late_ms > 0.0 else "younger"
    latency_ms = max(1e3 * declared_latency_s + late_ms, 0.0)
    tell(
        abs(late_ms) - half_ms,
        LATENCY_MS,
        f"touch reports are {abs(late_ms):.1f} ± {half_ms:.1f} ms {age} than declared",
        f"declare a latency of {latency_ms:.1f} ms for the touch sensor",
    )
    return tuple(told)


def mounted_off_deg(found: SensorAlignment) -> tuple[float, float]:
    """Return how far the accelerometer is off, and half of that angle's 95 % interval.

    Parameters
    ----------
    found : SensorAlignment
        What strokes tell.
    """
    vector = Rotation.from_matrix(found.rotation).as_rotvec()
    size = float(np.linalg.norm(vector))
    sd_deg = np.array(found.rotation_sd_deg)
    across = float(np.linalg.norm(sd_deg * vector) / size) if size > 0.0 else 0.0
    return angle_deg(found.rotation), 2.0 * across


def _turns(found: SensorAlignment) -> str:
    angles_deg = Rotation.from_matrix(found.rotation).as_euler("xyz", degrees=True)
    turns = ", ".join(
        f'["{axis}", {deg:.1f}]' for axis, deg in zip(AXES, angles_deg, strict=True)
    )
    return f"[{turns}]"

"""Analogue sensors: volts to any unit, accelerometers of three axes, six strain gauges."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from frictus_hardware.arrays import BoolArray, FloatArray
from frictus_hardware.errors import ConfigError, SensorError
from frictus_hardware.sensors.rotation import checked_rotation, rotated


def at_ends(volts: FloatArray, range_v: tuple[float, float], margin: float = 0.0) -> BoolArray:
    """Return where volts are at or beyond the ends of a range, or not a number.

    Parameters
    ----------
    volts : ndarray
        Of any shape.
    range_v : tuple of float
        Least and greatest.
    margin : float
        Share of the range at either end that counts as its end.
    """
    low_v, high_v = range_v
    margin_v = margin * (high_v - low_v)
    within: BoolArray = (volts > low_v + margin_v) & (volts < high_v - margin_v)
    return ~within


@dataclass(frozen=True, slots=True)
class AnalogueChannel:
    """One channel, ``value = scale volts + offset``.

    Attributes
    ----------
    name, unit : str
        As people read it, and its unit.
    scale : float
        Units per volt, not 0; 50.0 for the monitor behind an amplifier that divides by 50.
    offset : float
        In the unit.
    range_v : tuple of float
        Lowest and highest volts that are believed.

    Raises
    ------
    ConfigError
        If a number is not finite, the scale is 0, or the range is empty.
    """

    name: str
    unit: str
    scale: float
    offset: float
    range_v: tuple[float, float]

    def __post_init__(self) -> None:
        """Refuse what cannot be a channel."""
        if not (np.isfinite(self.scale) and self.scale):
            raise ConfigError(
                f"channel {self.name}: scale is {self.scale} {self.unit}/V; accepted is a "
                "finite number other than 0"
            )
        if not np.isfinite(self.offset):
            raise ConfigError(
                f"channel {self.name}: offset is {self.offset}; it must be finite"
            )
        low_v, high_v = self.range_v
        if not (np.isfinite(low_v) and np.isfinite(high_v) and low_v < high_v):
            raise ConfigError(
                f"channel {self.name}: range_v is {low_v} to {high_v}; accepted are finite "
                "volts, the lower first"
            )

    def value(self, volts: FloatArray) -> FloatArray:
        """Return the value in the channel's unit, in the shape of `volts`."""
        return self.scale * volts + self.offset

    def out_of_range(self, volts: FloatArray) -> BoolArray:
        """Return where volts are at or beyond the range, or not a number."""
        return at_ends(volts, self.range_v)


STANDARD_GRAVITY_M_S2: Final = 9.80665
SATURATION_MARGIN: Final = 0.005
"""Share of the output range at either end that counts as at its end."""


@dataclass(frozen=True, slots=True, eq=False)
class Accelerometer:
    """What turns its volts into acceleration.

    Attributes
    ----------
    zero_g_v : tuple of float
        Volts of x, y, z without acceleration.
    sensitivity_v_per_g : tuple of float
        Volts per standard gravity (9.80665 m/s²), not 0; negative where a channel is wired
        the other way round.
    output_range_v : tuple of float
        Lowest and highest volts that it can put out.
    rotation : ndarray, shape (3, 3)
        From its frame to the rig's: `in_turn` of some rotations, or a matrix.

    Raises
    ------
    ConfigError
        If a number is not finite, a sensitivity is 0, a zero lies outside of the range, or
        the matrix is no rotation.
    """

    zero_g_v: tuple[float, float, float]
    sensitivity_v_per_g: tuple[float, float, float]
    output_range_v: tuple[float, float]
    rotation: FloatArray

    def __post_init__(self) -> None:
        """Refuse what cannot be an accelerometer."""
        low_v, high_v = self.output_range_v
        if not low_v < high_v:
            raise ConfigError(
                f"output_range_v is {low_v:g} to {high_v:g}; the lower comes first"
            )
        if not all(low_v < zero_v < high_v for zero_v in self.zero_g_v):
            raise ConfigError(
                f"zero_g_v is {self.zero_g_v}; accepted is what lies within output_range_v, "
                f"{low_v:g} to {high_v:g} V"
            )
        if not all(np.isfinite(slope) and slope for slope in self.sensitivity_v_per_g):
            raise ConfigError(
                f"sensitivity_v_per_g is {self.sensitivity_v_per_g}; accepted are finite "
                "numbers other than 0"
            )
        object.__setattr__(self, "rotation", checked_rotation(self.rotation))


def sensed(accelerometer: Accelerometer, volts: FloatArray) -> FloatArray:
    """Return the acceleration in the frame of the sensor, m/s².

    Parameters
    ----------
    accelerometer : Accelerometer
        Its scale, range and mounting.
    volts : ndarray, shape (n_samples, 3)

    Returns
    -------
    accel_m_s2 : ndarray, shape (n_samples, 3)
        With gravity: at rest it is 9.81 m/s² upwards.
    """
    slope = np.asarray(accelerometer.sensitivity_v_per_g) / STANDARD_GRAVITY_M_S2
    accel: FloatArray = (volts - np.asarray(accelerometer.zero_g_v)) / slope
    return accel


def acceleration(accelerometer: Accelerometer, volts: FloatArray) -> FloatArray:
    """Return the acceleration in the frame of the rig, m/s²; as `sensed`, rotated.

    Parameters
    ----------
    accelerometer : Accelerometer
        Its scale, range and mounting.
    volts : ndarray, shape (n_samples, 3)

    Returns
    -------
    accel_m_s2 : ndarray, shape (n_samples, 3)
    """
    return rotated(sensed(accelerometer, volts), accelerometer.rotation)


def saturated(accelerometer: Accelerometer, volts: FloatArray) -> BoolArray:
    """Return where a channel is at the end of its output range, or not a number.

    Parameters
    ----------
    accelerometer : Accelerometer
        Its scale, range and mounting.
    volts : ndarray, shape (n_samples, 3)

    Returns
    -------
    saturated : ndarray of bool, shape (n_samples, 3)
        By channel of the sensor; rotated, all three axes of such a sample are wrong.
    """
    return at_ends(volts, accelerometer.output_range_v, SATURATION_MARGIN)


GAUGES: Final = 6
OVERLOAD_MARGIN: Final = 0.005
"""Share of the output range at either end that counts as at its end; of ±10 V it is 0.1 V."""
TARE_PARTS: Final = 10
TARE_SAMPLES: Final = 10 * TARE_PARTS


@dataclass(frozen=True, slots=True, eq=False)
class ForceCalibration:
    """Calibration of one sensor with six gauges.

    Attributes
    ----------
    serial, body_style : str
        Which sensor it belongs to; another of the same type has another matrix.
    output_mode : str
        How the gauges are wired, in the words of the maker.
    matrix : ndarray, shape (6, 6)
        Rows Fx, Fy, Fz in N/V and Tx, Ty, Tz in N m/V; one column for each gauge, in the
        order in which the gauges are wired. Read-only.
    gauge_range_v : tuple of float
        Lowest and highest volts that a gauge can put out.
    software_temperature : bool
        The maker gave slopes for a compensation of temperature in software; it is not applied.
    """

    serial: str
    body_style: str
    output_mode: str
    matrix: FloatArray
    gauge_range_v: tuple[float, float]
    software_temperature: bool


def wrench(
    calibration: ForceCalibration, gauges_v: FloatArray, bias_v: FloatArray
) -> FloatArray:
    """Return forces and torques in the frame of the sensor, ``matrix (v - bias)``.

    `frictus_hardware.sensors.rotation.rotated` takes the forces to the frame of the rig.

    Parameters
    ----------
    calibration : ForceCalibration
        Matrix and bias of the sensor.
    gauges_v : ndarray, shape (n_samples, 6)
        Sampled at one time: see `frictus_hardware.sensors.timing`.
    bias_v : ndarray, shape (6,)
        From `tare`.

    Returns
    -------
    wrench : ndarray, shape (n_samples, 6)
        Fx, Fy, Fz in N, Tx, Ty, Tz in N m.
    """
    loads: FloatArray = (gauges_v - bias_v) @ calibration.matrix.T
    return loads


def tare(
    calibration: ForceCalibration, gauges_v: FloatArray, moved_limit_n: float = 0.02
) -> FloatArray:
    """Return the volts without load, from a stretch during which nobody touches.

    The stretch is cut into ten parts; noise averages out within each, and what differs between
    them has moved.

    Parameters
    ----------
    calibration : ForceCalibration
        Matrix and bias of the sensor.
    gauges_v : ndarray, shape (n_samples, 6)
        At least 100 samples; half a second is plenty.
    moved_limit_n : float
        Largest difference of a force between two parts.

    Returns
    -------
    bias_v : ndarray, shape (6,)

    Raises
    ------
    SensorError
        If it is too short, a gauge is at its range, or the load moved.
    """
    samples = gauges_v.shape[0]
    if samples < TARE_SAMPLES:
        raise SensorError(f"a tare needs at least {TARE_SAMPLES} samples, not {samples}")
    fault = overload_fault(calibration, overloaded(calibration, gauges_v))
    if fault is not None:
        raise SensorError(f"no tare: {fault}")
    bias_v: FloatArray = gauges_v.mean(axis=0)
    means_v = np.array([part.mean(axis=0) for part in np.array_split(gauges_v, TARE_PARTS)])
    moved_n = np.ptp(wrench(calibration, means_v, bias_v)[:, :3], axis=0)
    if not np.all(moved_n <= moved_limit_n):
        axis = int(np.argmax(moved_n))
        raise SensorError(
            f"no tare: the force along {'xyz'[axis]} of the sensor moved by "
            f"{moved_n[axis]:.3g} N; at most {moved_limit_n:g} N is accepted. "
            "Touch neither screen nor table, and tare again"
        )
    return bias_v


def overloaded(calibration: ForceCalibration, gauges_v: FloatArray) -> BoolArray:
    """Return where a gauge is at the end of its output range, or not a number.

    Parameters
    ----------
    calibration : ForceCalibration
        Matrix and bias of the sensor.
    gauges_v : ndarray, shape (n_samples, 6)

    Returns
    -------
    overloaded : ndarray of bool, shape (n_samples, 6)
        The forces of a sample with any of them mean nothing.
    """
    return at_ends(gauges_v, calibration.gauge_range_v, OVERLOAD_MARGIN)


def overload_fault(calibration: ForceCalibration, at_end: BoolArray) -> str | None:
    """Return which gauges are overloaded and how often, or None.

    Parameters
    ----------
    calibration : ForceCalibration
        Matrix and bias of the sensor.
    at_end : ndarray of bool, shape (n_samples, 6)
        From `overloaded`.
    """
    times = at_end.sum(axis=0)
    if not times.any():
        return None
    low_v, high_v = calibration.gauge_range_v
    gauges = ", ".join(
        f"gauge {number} in {count} of {at_end.shape[0]} samples"
        for number, count in enumerate(times, start=1)
        if count
    )
    return (
        f"sensor {calibration.serial}: {gauges} at the end of its output, {low_v:g} to "
        f"{high_v:g} V: overload or a broken cable"
    )

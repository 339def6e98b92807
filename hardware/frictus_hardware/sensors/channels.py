"""Analogue channels: volts to any unit, and accelerometers of three axes."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from frictus_hardware.arrays import BoolArray, FloatArray
from frictus_hardware.errors import ConfigError
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

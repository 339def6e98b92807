"""Generic analogue channels: volts to any unit."""

from dataclasses import dataclass

import numpy as np

from frictus_hardware.arrays import BoolArray, FloatArray
from frictus_hardware.errors import ConfigError


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

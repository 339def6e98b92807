"""From volts at the inputs to force, acceleration and screen volts."""

from dataclasses import dataclass
from typing import Protocol

from frictus_hardware.arrays import FloatArray


@dataclass(frozen=True, slots=True)
class Sensed:
    """A block in the rig frame.

    Attributes
    ----------
    force_n : ndarray, shape (n_samples, 3)
        Force of the finger on the screen.
    accel_m_s2 : ndarray, shape (n_samples, 3)
        Skin acceleration at the nail.
    voltage_v : ndarray, shape (n_samples,)
        Monitored screen volts.
    saturated_samples : int
        In which an acceleration or a further channel was at the end of its range.
    aux : ndarray, shape (n_samples, n_aux), or None
        Further channels, each in its unit; None where there are none.
    """

    force_n: FloatArray
    accel_m_s2: FloatArray
    voltage_v: FloatArray
    saturated_samples: int = 0
    aux: FloatArray | None = None


class Conversion(Protocol):
    """What the sensors make of the volts. Columns are in the order of `NiConfig.channels`."""

    @property
    def delay_samples(self) -> int:
        """How many further samples it takes to convert one."""
        ...

    @property
    def tare_samples(self) -> int:
        """How many samples without load it wants before it starts; 0 once it has them."""
        ...

    def tare(self, input_v: FloatArray) -> None:
        """Take these volts for those without load.

        Parameters
        ----------
        input_v : ndarray, shape (tare_samples, n_channels)

        Raises
        ------
        SensorError
            If there was a load, or a sensor is broken.
        """
        ...

    def start(self, conversion_rate_hz: float) -> None:
        """Begin anew; the device's clock is about to start.

        Parameters
        ----------
        conversion_rate_hz : float
            The channels of a sample are converted one after the other at this rate, in the
            order of the columns.
        """
        ...

    def prime(self, input_v: FloatArray) -> None:
        """Take the first samples; each block ends as much before the last sample taken.

        Parameters
        ----------
        input_v : ndarray, shape (delay_samples, n_channels)
        """
        ...

    def __call__(self, input_v: FloatArray) -> Sensed:
        """Convert as many samples as are given: those of `delay_samples` before.

        Parameters
        ----------
        input_v : ndarray, shape (n_samples, n_channels)
            Follow those given before.

        Raises
        ------
        SensorError
            If a sensor is overloaded or broken; the block is lost, and is counted as overrun
            by the next one.
        """
        ...

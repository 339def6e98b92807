"""From volts at the inputs to force, acceleration and screen volts."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


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
    """

    force_n: FloatArray
    accel_m_s2: FloatArray
    voltage_v: FloatArray


class Conversion(Protocol):
    """What the sensors make of the volts."""

    def start(self, conversion_rate_hz: float) -> None:
        """Begin with device sample 0, which is about to be taken.

        Parameters
        ----------
        conversion_rate_hz : float
            The channels of a sample are converted one after the other at this rate, in the
            order of the columns.
        """
        ...

    def __call__(self, input_v: FloatArray) -> Sensed:
        """Convert the block that follows the one before.

        Parameters
        ----------
        input_v : ndarray, shape (n_samples, n_channels)
            Columns in the order of `NiConfig.channels`: force, accel, monitor.

        Raises
        ------
        SensorError
            If a sensor is overloaded or broken; the block is lost, and is counted as overrun
            by the next one.
        """
        ...


@dataclass(frozen=True)
class LinearConversion:
    """Every quantity a fixed matrix times volts less a bias, all channels taken at one time.

    Attributes
    ----------
    force_n_per_v : ndarray, shape (3, n_force)
    accel_m_s2_per_v : ndarray, shape (3, n_accel)
    monitor_gain : float
        Screen volts per volt at the monitor, which is the last channel.
    force_bias_v, accel_bias_v : ndarray, shape (n_force,) and (n_accel,)
        Volts of the sensors at rest.
    """

    force_n_per_v: FloatArray
    accel_m_s2_per_v: FloatArray
    monitor_gain: float
    force_bias_v: FloatArray
    accel_bias_v: FloatArray

    def start(self, conversion_rate_hz: float) -> None:
        """Do nothing: there is no state."""

    def __call__(self, input_v: FloatArray) -> Sensed:
        """See `Conversion`."""
        n_force = self.force_bias_v.size
        force_v = input_v[:, :n_force] - self.force_bias_v
        accel_v = input_v[:, n_force:-1] - self.accel_bias_v
        return Sensed(
            force_n=force_v @ self.force_n_per_v.T,
            accel_m_s2=accel_v @ self.accel_m_s2_per_v.T,
            voltage_v=input_v[:, -1] * self.monitor_gain,
        )

"""From volts at the inputs to what is sensed: gauges, accelerometer, monitor, in one time."""

from dataclasses import dataclass, replace
from typing import Final, Protocol

import numpy as np

from frictus_hardware.arrays import FloatArray
from frictus_hardware.errors import ConfigError, SensorError
from frictus_hardware.nidaq.config import Inputs, NiConfig
from frictus_hardware.sensors.analogue import (
    GAUGES,
    Accelerometer,
    ForceCalibration,
    acceleration,
    overload_fault,
    overloaded,
    saturated,
    tare,
    wrench,
)
from frictus_hardware.sensors.rotation import rotated
from frictus_hardware.sensors.timing import DELAY_SAMPLES, Deskew, deskew, turn_offsets_s


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


AXES: Final = 3
MONITOR: Final = GAUGES + AXES
"""Column of the monitor; further channels come after it."""
TARE_S: Final = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class ForceSensor:
    """Six gauges under the screen.

    Attributes
    ----------
    calibration : ForceCalibration
        Matrix and bias of the sensor.
    rotation : ndarray, shape (3, 3)
        From the sensor's frame to the rig's.
    bias_v : tuple of float or None
        Volts of the gauges without load; None: measured when the rig is opened first.
    """

    calibration: ForceCalibration
    rotation: FloatArray
    bias_v: tuple[float, ...] | None = None


class SensorConversion:
    """See `frictus_hardware.nidaq.sensing.Conversion`.

    The converter takes the channels in turn, so all are moved to the edge of the sample clock
    before gauges are mixed; it takes samples to come to move one, which is the delay.

    Parameters
    ----------
    config : NiConfig
        The device and what is wired to it.
    force : ForceSensor
        Gauges and their calibration.
    accel : Accelerometer

    Raises
    ------
    ConfigError
        If the channels do not fit the sensors.
    """

    def __init__(self, config: NiConfig, force: ForceSensor, accel: Accelerometer) -> None:
        for name, inputs, wanted in (
            ("force", config.force, GAUGES),
            ("accel", config.accel, AXES),
        ):
            if len(inputs.channels) != wanted:
                raise ConfigError(
                    f"{name}.channels = {list(inputs.channels)}: {wanted} channels accepted"
                )
        bias_v = force.bias_v
        if bias_v is not None and len(bias_v) != GAUGES:
            raise ConfigError(f"force.bias_v = {list(bias_v)}: {GAUGES} volts accepted")
        self._config = config
        gauges = force.calibration
        gauge_range_v = _seen(config.force, gauges.gauge_range_v)
        self._force = replace(force, calibration=replace(gauges, gauge_range_v=gauge_range_v))
        self._accel = replace(accel, output_range_v=_seen(config.accel, accel.output_range_v))
        self._bias_v = None if bias_v is None else np.array(bias_v)
        self._deskew: Deskew | None = None
        self._state: FloatArray | None = None

    @property
    def delay_samples(self) -> int:
        """How many further samples it takes to convert one."""
        return DELAY_SAMPLES

    @property
    def tare_samples(self) -> int:
        """How many samples without load it wants; 0 once the bias is known."""
        return round(TARE_S * self._config.sample_rate_hz) if self._bias_v is None else 0

    @property
    def bias_v(self) -> FloatArray | None:
        """Volts of the gauges without load, shape (6,); None: not known yet."""
        return self._bias_v

    def tare(self, input_v: FloatArray) -> None:
        """Take the gauges' mean for their volts without load; kept for as long as this is."""
        self._bias_v = tare(self._force.calibration, input_v[:, :GAUGES])

    def start(self, conversion_rate_hz: float) -> None:
        """Begin anew; see `Conversion`."""
        offsets_s = turn_offsets_s(len(self._config.channels), conversion_rate_hz)
        self._deskew = deskew(offsets_s, self._config.sample_rate_hz)
        self._state = None

    def prime(self, input_v: FloatArray) -> None:
        """Take the first samples; the very first is taken to have been for ever."""
        assert self._deskew is not None, "start() comes first"
        _, self._state = self._deskew.run(input_v, self._deskew.started(input_v[0]))

    def __call__(self, input_v: FloatArray) -> Sensed:
        """Convert a block; see `Conversion`."""
        assert self._deskew is not None, "start() comes first"
        assert self._state is not None, "prime() comes first"
        assert self._bias_v is not None, "tare() comes first"
        moved, self._state = self._deskew.run(input_v, self._state)
        calibration = self._force.calibration
        fault = overload_fault(calibration, overloaded(calibration, input_v[:, :GAUGES]))
        if fault is not None:
            raise SensorError(fault)
        loads = wrench(calibration, moved[:, :GAUGES], self._bias_v)
        beyond = saturated(self._accel, input_v[:, GAUGES:MONITOR]).any(axis=1)
        further = []
        for column, each in enumerate(self._config.aux, start=MONITOR + 1):
            beyond |= each.channel.out_of_range(input_v[:, column])
            further.append(each.channel.value(moved[:, column]))
        return Sensed(
            force_n=rotated(loads[:, :3], self._force.rotation),
            accel_m_s2=acceleration(self._accel, moved[:, GAUGES:MONITOR]),
            voltage_v=moved[:, MONITOR] * self._config.monitor_gain,
            saturated_samples=int(np.count_nonzero(beyond)),
            aux=np.array(further).T if further else None,
        )


def _seen(inputs: Inputs, sensor_v: tuple[float, float]) -> tuple[float, float]:
    """Return what is seen of a sensor's range: inputs of a smaller one cut off before it."""
    low_v, high_v = sensor_v
    return max(low_v, -inputs.range_v), min(high_v, inputs.range_v)

"""From the volts of six strain gauges to forces and torques: tare, wrench, overload."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from frictus_hardware.arrays import BoolArray, FloatArray
from frictus_hardware.errors import SensorError
from frictus_hardware.sensors.channels import at_ends

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

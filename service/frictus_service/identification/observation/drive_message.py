"""The drive fraction from screen volts, and what the held DAC does to it."""

import numpy as np

from frictus_hardware.arrays import ComplexArray, FloatArray


def drive_fraction(voltage_v: FloatArray, screen_peak_v: float) -> FloatArray:
    """Return ``2 V² / V_pk²``: the drive fraction, and the carrier's line far above the tones.

    The amplitude of the message comes from this and not from a sideband of the voltage, which
    holds 0.60 of it and grows with its square root.

    Parameters
    ----------
    voltage_v : ndarray, shape (n_samples,)
    screen_peak_v : float
        Screen volts at a drive fraction of 1.
    """
    fraction: FloatArray = np.square(voltage_v * (np.sqrt(2.0) / screen_peak_v))
    return fraction


def hold(frequency_hz: FloatArray, sample_rate_hz: float) -> ComplexArray:
    """Return the response of a DAC that holds each sample until the next.

    Parameters
    ----------
    frequency_hz : ndarray
        Where it is evaluated.
    sample_rate_hz : float
        Samples per second of the device's clock.
    """
    cycles = np.asarray(frequency_hz) / sample_rate_hz
    response: ComplexArray = np.sinc(cycles) * np.exp(-1j * np.pi * cycles)
    return response


def advance(frequency_hz: FloatArray, skew_s: float) -> ComplexArray:
    """Return the response of a sensor that samples so much later than it says.

    Parameters
    ----------
    frequency_hz : ndarray
        Where it is evaluated.
    skew_s : float
        Seconds, positive where it samples later.
    """
    response: ComplexArray = np.exp(2j * np.pi * np.asarray(frequency_hz) * skew_s)
    return response

"""The screen: from drive fraction to volts, and from volts back to drive fraction.

Paper, Section 2.1 and Appendix A, with its slips mended: the carrier is ``cos(2 pi f_c t)``,
its square ``(1 + cos(4 pi f_c t)) / 2``, and the shift under the root is ``|min V_m|``.
"""

from dataclasses import dataclass

import numpy as np

from frictus_hardware.arrays import FloatArray


@dataclass(frozen=True, slots=True)
class Screen:
    """An electrovibration screen with its amplifier.

    Attributes
    ----------
    peak_v : float
        Volts at the screen for a drive fraction of 1.
    carrier_hz : float
        Carrier frequency.
    amplifier_gain : float
        Screen volts per volt at the DAC.
    size_mm : tuple of float
        Width (x, along the slide) and height (y).
    """

    peak_v: float = 75.0
    carrier_hz: float = 7000.0
    amplifier_gain: float = 50.0
    size_mm: tuple[float, float] = (70.0, 35.0)


def screen_voltage(
    screen: Screen, drive_fraction: FloatArray, first_sample: int, sample_rate_hz: float
) -> FloatArray:
    """Return ``V = V_pk sqrt(m) cos(2 pi f_c n / fs)``, Equation 2.

    Parameters
    ----------
    screen : Screen
        Its peak voltage, carrier and size.
    drive_fraction : ndarray, shape (n_samples,)
        m, in [0, 1].
    first_sample : int
        Device index of the first sample; the carrier's phase hangs on it alone, so that it is
        continuous across blocks.
    sample_rate_hz : float

    Returns
    -------
    ndarray, shape (n_samples,)
        Volts at the screen, each held for one sample.

    Raises
    ------
    ValueError
        If a drive fraction is outside [0, 1] or not finite.
    """
    if not np.all((drive_fraction >= 0.0) & (drive_fraction <= 1.0)):
        raise ValueError("drive fraction must lie in [0, 1]")
    sample = np.arange(first_sample, first_sample + drive_fraction.size)
    # Whole cycles are taken off before the cosine: exact after days of samples too.
    cycles = np.mod(sample * screen.carrier_hz, sample_rate_hz) / sample_rate_hz
    carrier: FloatArray = np.cos(2.0 * np.pi * cycles)
    return screen.peak_v * np.sqrt(drive_fraction) * carrier


def drive_fraction_of(screen: Screen, voltage_v: FloatArray) -> FloatArray:
    """Return ``2 V^2 / V_pk^2``: the drive fraction in the baseband, plus the carrier's line.

    The electrostatic force goes with V^2 (Equation 1), whose baseband is m / 2. Sampled at
    20 kHz the 14 kHz line of a 7 kHz carrier appears at 6 kHz, outside the tactile band.

    Parameters
    ----------
    screen : Screen
        Its peak voltage, carrier and size.
    voltage_v : ndarray
        Volts at the screen.
    """
    return 2.0 * np.square(voltage_v / screen.peak_v)

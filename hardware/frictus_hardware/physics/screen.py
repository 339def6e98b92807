"""The screen: from drive fraction to volts and back, and its way to the finger.

Paper, Section 2.1 and Appendix A, with its slips mended: the carrier is ``cos(2 pi f_c t)``,
its square ``(1 + cos(4 pi f_c t)) / 2``, and the shift under the root is ``|min V_m|``.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics import linear
from frictus_hardware.physics.linear import TransferFunction
from frictus_hardware.physics.twin import Signals


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


class MapHarmonics(NamedTuple):
    """What a static map makes of a tone; arrays of shape (n_rows,).

    Attributes
    ----------
    gain : ndarray
        Best linear gain of the tone.
    second, third : ndarray
        Amplitudes at two and three times its frequency, where its own phase is 0.
    """

    gain: FloatArray
    second: FloatArray
    third: FloatArray


@dataclass(frozen=True, slots=True)
class DriveMap:
    """A static map of the drive fraction, ``linear m + quadratic m^2 + cubic m^3``.

    Without constant: no drive stays no drive.
    """

    linear: float = 1.0
    quadratic: float = 0.0
    cubic: float = 0.0

    def plus(self, linear: float, quadratic: float, cubic: float) -> "DriveMap":
        """Return a map that adds more; small distortions add up in any order."""
        return DriveMap(self.linear + linear, self.quadratic + quadratic, self.cubic + cubic)

    def factor(self, drive_fraction: FloatArray) -> FloatArray:
        """Return by how much a drive fraction is multiplied.

        Parameters
        ----------
        drive_fraction : ndarray
            In [0, 1].
        """
        return self.linear + drive_fraction * (self.quadratic + drive_fraction * self.cubic)

    def harmonics(
        self, message_mean: FloatArray, amplitude: FloatArray, power: FloatArray
    ) -> MapHarmonics:
        """Return what becomes of tones around a mean, whose sums and differences are apart.

        Parameters
        ----------
        message_mean, amplitude : ndarray, shape (n_rows,)
            Of the drive fraction, and of each tone in it.
        power : ndarray, shape (n_rows,)
            Sum over all tones of ``amplitude^2 / 2``.
        """
        square = np.square(amplitude)
        slope = self.linear + message_mean * (
            2.0 * self.quadratic + 3.0 * self.cubic * message_mean
        )
        return MapHarmonics(
            gain=slope + self.cubic * (3.0 * power - 0.75 * square),
            second=(self.quadratic + 3.0 * self.cubic * message_mean) * square / 2.0,
            third=self.cubic * square * amplitude / 4.0,
        )


@dataclass(frozen=True, slots=True)
class MapDrive:
    """The static map in the twin. It acts on the envelope, and the carrier's line with it.

    Volts that do not carry the carrier are taken as at most full drive.

    Attributes
    ----------
    drive_map : DriveMap
        A polynomial of the drive fraction.
    carrier_hz : float
        Of the screen's voltage.
    first_sample : int
        Device index of the twin's first sample: it says where the carrier stands.
    """

    drive_map: DriveMap
    carrier_hz: float
    first_sample: int

    def initial(self) -> int:
        """Return the index of the sample that is held during the first steps."""
        return self.first_sample - 1

    def run(self, signals: Signals, state: int) -> tuple[Signals, int]:
        """Change `drive_fraction`."""
        samples = signals.voltage_v.size
        steps = signals.drive_fraction.size // samples
        rate_hz = signals.sample_rate_hz / steps
        held = np.arange(state, state + samples)
        cycles = np.mod(held * self.carrier_hz, rate_hz) / rate_hz
        carried = np.repeat(2.0 * np.square(np.cos(2.0 * np.pi * cycles)), steps)
        drive = signals.drive_fraction
        # Near a zero of the carrier the converter's rounding counts for more than the envelope;
        # the product is then next to nothing.
        envelope = np.divide(drive, carried, out=np.ones_like(drive), where=carried > drive)
        mapped = drive * self.drive_map.factor(envelope)
        return replace(signals, drive_fraction=mapped), state + samples


@dataclass(frozen=True, slots=True)
class FilterDrive:
    """A linear filter between screen and finger, such as a leak.

    Attributes
    ----------
    response : TransferFunction
        Drive to drive, in s.
    """

    response: TransferFunction

    def initial(self) -> None:
        """Return None: nothing has been driven."""

    def run(self, signals: Signals, state: FloatArray | None) -> tuple[Signals, FloatArray]:
        """Change `drive_fraction`."""
        sampled = linear.sample(self.response, signals.sample_rate_hz)
        passed, state = sampled.run(
            signals.drive_fraction[:, np.newaxis],
            sampled.at_rest(1) if state is None else state,
        )
        return replace(signals, drive_fraction=passed[:, 0]), state

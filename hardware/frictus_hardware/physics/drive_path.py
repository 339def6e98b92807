"""What becomes of the drive fraction between the screen's volts and the finger."""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics import linear
from frictus_hardware.physics.linear import TransferFunction
from frictus_hardware.physics.twin import Signals


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

"""What is in the measured force whether or not there is a drive."""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.friction import motion_fade
from frictus_hardware.physics.linear import TransferFunction
from frictus_hardware.physics.twin import Signals

LOW_BAND_HZ: Final = (4.0, 30.0)
"""Where stick-slip is looked for."""
EDGE_SHARE: Final = 0.05
"""Speed wanders by this share, and with it which lines lie within the band."""
LINES: Final = 15


@dataclass(frozen=True, slots=True)
class StickSlip:
    """Relaxation oscillation of sliding skin: a saw-tooth over the path.

    Attributes
    ----------
    amplitude_n : float
        Peak at rest; it falls as ``exp(-v / 20 mm/s)``.
    period_mm : float
        Path per period, so that its frequency is v / period.
    """

    amplitude_n: float
    period_mm: float = 2.0

    def peak_n(self, speed_mm_s: FloatArray) -> FloatArray:
        """Return its amplitude at a speed, N.

        Parameters
        ----------
        speed_mm_s : ndarray
            Without sign.
        """
        return self.amplitude_n * np.exp(-np.abs(speed_mm_s) / 20.0)

    def low_power_n2(
        self, speed_mm_s: FloatArray, mount: TransferFunction | None
    ) -> FloatArray:
        """Return its power from 4 to 30 Hz as the sensor feels it, N^2.

        Parameters
        ----------
        speed_mm_s : ndarray, shape (n_rows,)
        mount : TransferFunction or None
            Between screen and sensor; in this band it is at rest.
        """
        order = np.arange(1.0, LINES + 1.0)
        line_hz = np.multiply.outer(np.abs(speed_mm_s) / self.period_mm, order)
        line_n = 2.0 / (np.pi * order) * self.peak_n(speed_mm_s)[:, np.newaxis]
        if mount is not None:
            line_n = line_n * (mount.numerator[-1] / mount.denominator[-1])
        low, high = LOW_BAND_HZ
        inside = _above(line_hz, low) * (1.0 - _above(line_hz, high))
        power: FloatArray = (np.square(line_n) / 2.0 * inside).sum(axis=1)
        return power


def _above(line_hz: FloatArray, edge_hz: float) -> FloatArray:
    """Return the share of a line of varying frequency that lies above an edge."""
    return (1.0 + np.tanh((line_hz - edge_hz) / (EDGE_SHARE * edge_hz))) / 2.0


@dataclass(frozen=True, slots=True)
class AddStickSlip:
    """Stick-slip in the twin.

    Attributes
    ----------
    stick_slip : StickSlip
        Its amplitude and length.
    start : float
        Where in its period it begins, 0 to 1.
    """

    stick_slip: StickSlip
    start: float

    def initial(self) -> float:
        """Return the periods so far."""
        return self.start

    def run(self, signals: Signals, state: float) -> tuple[Signals, float]:
        """Add to `friction_n`."""
        speed = np.hypot(signals.velocity_mm_s[:, 0], signals.velocity_mm_s[:, 1])
        turned = speed / (signals.sample_rate_hz * self.stick_slip.period_mm)
        # Added up one by one from the state on, blocks do not show.
        periods = np.cumsum(np.append(state, turned))[1:]
        saw = 2.0 * np.mod(periods, 1.0) - 1.0
        felt = self.stick_slip.peak_n(speed) * saw * motion_fade(speed) * signals.in_contact
        return replace(signals, friction_n=signals.friction_n + felt), float(periods[-1])


@dataclass(frozen=True, slots=True)
class Hum:
    """A line of the mains in the force channel along x.

    Attributes
    ----------
    amplitude_n, frequency_hz : float
        Of the sinusoid.
    """

    amplitude_n: float
    frequency_hz: float


@dataclass(frozen=True, slots=True)
class AddHum:
    """The mains' line in the twin, at the device's rate.

    Attributes
    ----------
    hum : Hum
        Amplitude and frequency.
    phase_rad : float
        At the twin's first sample.
    """

    hum: Hum
    phase_rad: float

    def initial(self) -> int:
        """Return the samples so far."""
        return 0

    def run(self, signals: Signals, state: int) -> tuple[Signals, int]:
        """Add to `force_n`."""
        samples = signals.force_n.shape[0]
        cycles = np.arange(state, state + samples) * (
            self.hum.frequency_hz / signals.sample_rate_hz
        )
        force = signals.force_n.copy()
        force[:, 0] += self.hum.amplitude_n * np.cos(2.0 * np.pi * cycles + self.phase_rad)
        return replace(signals, force_n=force), state + samples

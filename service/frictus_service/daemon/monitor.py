"""Whether the screen gets what it was told: the monitored voltage against the drive."""

import math

import numpy as np
from numpy.typing import NDArray

from frictus_hardware.base import Exchange
from frictus_hardware.sample_ring import SampleRing

RING_SAMPLES = 1 << 16
"""More than any lead and block together."""


class Monitor:
    """Remembers what was handed over until it has been played and sensed.

    Root mean squares over a block are compared, not samples: a carrier of 7 kHz turns a skew
    of microseconds between output and monitor into volts.

    Parameters
    ----------
    lead_samples : int
        Samples between handing over and playing.
    """

    def __init__(self, lead_samples: int) -> None:
        self._lead = lead_samples
        self._told_v = SampleRing(RING_SAMPLES)  # NaN where it is not known what played

    def restart(self) -> None:
        """Forget everything: the device began anew."""
        self._told_v.write(0, RING_SAMPLES, 0.0)

    def compare(self, exchange: Exchange, zero_from: int) -> float:
        """Return how far monitor and drive are apart over the sensed block, V rms.

        A block that lacks samples is not compared; a monitor that is not finite always is
        apart.

        Parameters
        ----------
        exchange : Exchange
            What was applied and sensed.
        zero_from : int
            Where the ramp of the last stop ends; what was played before is not what had been
            handed over, and is not compared.
        """
        n = exchange.applied_v.size
        play, lost = exchange.play_sample, exchange.overrun_samples
        self._told_v.write(play, n, exchange.applied_v)
        if lost or exchange.underrun_samples:
            missing = max(lost, exchange.underrun_samples)
            self._told_v.write(play - lost, min(missing, RING_SAMPLES), np.nan)
        sensed_v = _rms(exchange.voltage_v)
        if not math.isfinite(sensed_v):
            return math.inf
        told_v = _rms(self._told_v.read(exchange.first_sample, n))
        if exchange.first_sample < zero_from or math.isnan(told_v):
            return 0.0
        return abs(sensed_v - told_v)


def _rms(volts: NDArray[np.float64]) -> float:
    return math.sqrt(np.dot(volts, volts) / volts.size)

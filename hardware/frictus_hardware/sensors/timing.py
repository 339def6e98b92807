"""When samples of sensors were taken: ticks, the host's clock, channels taken in turn.

Which sample of a device was taken when, by the clock of the host.

A block never comes before its last sample was taken, so of many blocks those that came with
the least delay tell; what they tell fades as fast as the two clocks may run apart. A counter in
seconds is a device of 1 Hz.

Channels that one converter takes in turn, moved to a common time.

A fractional delay by Lagrange interpolation: it has no delay of its own beyond the declared
samples, is exact for polynomials, and its error has a closed bound.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from frictus_hardware.arrays import FloatArray
from frictus_hardware.errors import ConfigError

TICKS_PER_S: Final = 32768
WRAP: Final = 1 << 16
JUMP_S: Final = 0.25
"""Beyond any jitter of arrival, and below the half wrap of 1 s that cannot be told apart."""


@dataclass(frozen=True, slots=True)
class Instant:
    """When a report was made, by the sensor's own counter.

    Attributes
    ----------
    ticks : int
        The 16 bits that were sent.
    time_s : float
        Since the first report, without wraps.
    arrival_s : float
        When it came, by the clock of the host.
    jumped : bool
        The counter did not agree with the arrival; time goes on by the arrival.
    """

    ticks: int
    time_s: float
    arrival_s: float
    jumped: bool = False


def unwrapped(previous: Instant | None, ticks: int, arrival_s: float) -> Instant:
    """Return the instant of a report.

    Wraps are counted by the arrival, so any number of reports may be missing.

    Parameters
    ----------
    previous : Instant or None
        Of the report before; None for the first.
    ticks : int
        0 to 65535.
    arrival_s : float
        Monotonic clock of the host.
    """
    if previous is None:
        return Instant(ticks, 0.0, arrival_s)
    waited = (arrival_s - previous.arrival_s) * TICKS_PER_S
    passed = (ticks - previous.ticks) % WRAP
    # A report that is held up more than the one before it never takes time backwards.
    passed += max(0, round((waited - passed) / WRAP)) * WRAP
    jumped = not abs(passed - waited) <= JUMP_S * TICKS_PER_S
    passed_s = (waited if jumped else passed) / TICKS_PER_S
    return Instant(ticks, previous.time_s + passed_s, arrival_s, jumped)


LARGEST_SKEW: Final = 2e-4
"""Of two quartz clocks, with room to spare."""


@dataclass(frozen=True, slots=True)
class Alignment:
    """Device samples and the host's clock.

    Attributes
    ----------
    sample_rate_hz : float
        Nominal.
    offset : float
        Sample index at time 0 of the host.
    at_s : float
        Host time at which this was found.
    """

    sample_rate_hz: float
    offset: float
    at_s: float

    def sample_at(self, time_s: float) -> float:
        """Return the sample that was taken at a time of the host."""
        return self.offset + self.sample_rate_hz * time_s


def aligned(
    before: Alignment | None, end_sample: float, now_s: float, sample_rate_hz: float
) -> Alignment:
    """Return what is known once a block has come.

    Parameters
    ----------
    before : Alignment or None
        After the block before; None for the first.
    end_sample : float
        The sample after the block's last.
    now_s : float
        Monotonic clock of the host.
    sample_rate_hz : float
        Samples per second of the device's clock.
    """
    offset = end_sample - sample_rate_hz * now_s
    if before is not None:
        faded = LARGEST_SKEW * sample_rate_hz * (now_s - before.at_s)
        offset = max(offset, before.offset - faded)
    return Alignment(sample_rate_hz, offset, now_s)


DELAY_SAMPLES: Final = 3
"""0.15 ms at 20 kHz; the error at 1 kHz is then below 1.1e-7 of the amplitude."""


def turn_offsets_s(n_channels: int, conversion_rate_hz: float) -> FloatArray:
    """Return when each channel of a scan is taken after the sample clock's edge.

    Parameters
    ----------
    n_channels : int
        In the order of the scan.
    conversion_rate_hz : float
        Conversions per second within a scan, as the driver tells it.

    Returns
    -------
    offsets_s : ndarray, shape (n_channels,)
    """
    if not conversion_rate_hz > 0.0:
        raise ConfigError(
            f"the conversion rate is {conversion_rate_hz} Hz; it must be above 0. Read it "
            "from the driver"
        )
    return np.arange(n_channels) / conversion_rate_hz


@dataclass(frozen=True, slots=True, eq=False)
class Deskew:
    """Moves channels to the time of the sample clock's edge, `delay_samples` ago.

    Output sample n is every channel at the edge of sample ``n - delay_samples``.

    Attributes
    ----------
    delay_samples : int
        How many samples later a value appears.
    taps : ndarray, shape (2 delay_samples + 2, n_channels)
        Newest sample first.
    """

    delay_samples: int
    taps: FloatArray

    def started(self, first: FloatArray) -> FloatArray:
        """Return the state as if a first sample had always been.

        Parameters
        ----------
        first : ndarray, shape (n_channels,)

        Returns
        -------
        state : ndarray, shape (2 delay_samples + 1, n_channels)
        """
        return np.repeat(first[np.newaxis], self.taps.shape[0] - 1, axis=0)

    def run(self, skewed: FloatArray, state: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Move one block; how a stream is cut into blocks does not show.

        Parameters
        ----------
        skewed : ndarray, shape (n_samples, n_channels)
        state : ndarray, shape (2 delay_samples + 1, n_channels)
            From `started` or the run before; it is not changed.

        Returns
        -------
        moved : ndarray, shape (n_samples, n_channels)
        state : ndarray, shape (2 delay_samples + 1, n_channels)
        """
        samples = skewed.shape[0]
        past = self.taps.shape[0] - 1
        line = np.concatenate([state, skewed])
        moved = self.taps[0] * line[past:]
        for age in range(1, past + 1):
            moved += self.taps[age] * line[past - age : past - age + samples]
        return moved, line[samples:]


def deskew(
    offsets_s: ArrayLike, sample_rate_hz: float, delay_samples: int = DELAY_SAMPLES
) -> Deskew:
    """Return the filter for channels taken at known times after each edge.

    Parameters
    ----------
    offsets_s : array_like, shape (n_channels,)
        From `turn_offsets_s`; 0 for one that needs only the common delay.
    sample_rate_hz : float
        Samples per second of the device's clock.
    delay_samples : int
        1 to 8; each adds two points to the interpolation.

    Raises
    ------
    ConfigError
        If an offset is not within one sample, or the delay not within its range.
    """
    offsets = np.atleast_1d(np.asarray(offsets_s, dtype=np.float64)) * sample_rate_hz
    if not np.all((offsets >= 0.0) & (offsets <= 1.0)):
        raise ConfigError(
            f"channels are taken {offsets.min():.3g} to {offsets.max():.3g} samples after the "
            "clock's edge; 0 to 1 is accepted. Lower the sample rate, raise the conversion "
            "rate, or scan fewer channels"
        )
    if not 1 <= delay_samples <= 8:
        raise ConfigError(f"delay_samples is {delay_samples}; 1 to 8 is accepted")
    taps = np.array([_lagrange(delay_samples + offset, delay_samples) for offset in offsets]).T
    return Deskew(delay_samples, np.ascontiguousarray(taps))


def _lagrange(delay: float, delay_samples: int) -> Sequence[float]:
    points = range(2 * delay_samples + 2)
    return [
        math.prod((delay - other) / (point - other) for other in points if other != point)
        for point in points
    ]

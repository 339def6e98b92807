"""Which sample of a device was taken when, by the clock of the host.

A block never comes before its last sample was taken, so of many blocks those that came with
the least delay tell; what they tell fades as fast as the two clocks may run apart. A counter in
seconds is a device of 1 Hz.
"""

from dataclasses import dataclass
from typing import Final

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

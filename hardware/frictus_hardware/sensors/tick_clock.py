"""The 16-bit counter of a touch sensor, carried on beyond 2 s and over losses."""

from dataclasses import dataclass
from typing import Final

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

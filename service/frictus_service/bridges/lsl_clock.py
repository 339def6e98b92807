"""Device samples on the local clock of Lab Streaming Layer (LSL).

A rig publishes how its sample counter goes with UTC; LSL's `local_clock` is another clock of
this machine. Their difference is read anew with every fit, and each fit is approached slowly:
stamps of consecutive samples always rise.
"""

from collections.abc import Callable
from typing import Final

from frictus.block import MAX_FIRST_SAMPLE
from frictus.messages import TimeState
from frictus.slewed_clock import SlewedClock

READINGS: Final = 5
"""Of the difference, of which the one that took least time is used."""
RUNS: Final = 2
"""Kept: blocks of the one before may still come."""
NS_PER_SAMPLE: Final = (1.0, 1e9)
"""1 Hz to 1 GHz."""
MAX_LEAP_NS: Final = 86_400e9
"""From the newest sample: no gap in one run is longer."""


class LslClock:
    """Runs of one rig on LSL's local clock.

    Parameters
    ----------
    local_clock_s : callable
        LSL's `local_clock`.
    utc_ns : callable
        UTC of this machine.
    """

    def __init__(self, local_clock_s: Callable[[], float], utc_ns: Callable[[], int]) -> None:
        self._local_clock_s = local_clock_s
        self._utc_ns = utc_ns
        self._runs: dict[int, SlewedClock] = {}
        """The one used last at the end. Numbers of runs tell no order: anybody may say one."""
        self._newest_ns = 0
        self._offset_ns = 0
        self._read_offset()

    @property
    def run(self) -> int | None:
        """The run that was spoken of last; None before the first."""
        return next(reversed(self._runs), None)

    @property
    def error_ms(self) -> float:
        """How far the stamps of that run were off the newest fit when it came."""
        run = self.run
        return 0.0 if run is None else 1e-6 * self._runs[run].error_ns

    def follow(self, fit: TimeState) -> bool:
        """Take a fit as the rig publishes it; return whether its run can be stamped.

        Parameters
        ----------
        fit : TimeState
            Of a new run, it begins the line.
        """
        self._read_offset()
        begun = self.begin(fit.run, fit.sample, fit.utc_ns, fit.ns_per_sample)
        if begun:
            at_ns = fit.utc_ns - self._offset_ns
            self._runs[fit.run].approach(fit.sample, at_ns, fit.ns_per_sample)
        return begun

    def begin(self, run: int, sample: int, utc_ns: int, ns_per_sample: float) -> bool:
        """Begin a run that is not known yet; return whether this sample can be stamped.

        Parameters
        ----------
        run : int
            Of the rig; of two others the one that was spoken of last is kept.
        sample : int
            Device index, of which the time is known.
        utc_ns : int
            Its UTC.
        ns_per_sample : float
            From 1 to 1e9; others are refused, as are indices above 2^62, and those a day
            away from the newest.
        """
        low, high = NS_PER_SAMPLE
        if not (low <= ns_per_sample <= high and abs(sample) <= MAX_FIRST_SAMPLE):
            return False
        if run in self._runs:
            self._runs[run] = known = self._runs.pop(run)
            return abs(sample - known.newest_sample) * ns_per_sample <= MAX_LEAP_NS
        if len(self._runs) == RUNS:
            del self._runs[next(iter(self._runs))]
        later_ns = self._newest_ns + round(ns_per_sample)  # whatever UTC was set to meanwhile
        at_ns = max(utc_ns - self._offset_ns, later_ns)
        self._runs[run] = SlewedClock(sample, at_ns, ns_per_sample)
        return True

    def knows(self, run: int) -> bool:
        """Return whether a run was begun, and not two others since."""
        return run in self._runs

    def stamp_s(self, run: int, sample: int) -> float:
        """Return the local time of a sample, s.

        Parameters
        ----------
        run : int
            One that `knows`.
        sample : int
            Device index.
        """
        at_ns = self._runs[run].time_of(sample)
        self._newest_ns = max(self._newest_ns, at_ns)
        return 1e-9 * at_ns

    def local_s(self, utc_ns: int) -> float:
        """Return the local time of a UTC, s."""
        return 1e-9 * (utc_ns - self._offset_ns)

    def utc_of(self, local_s: float) -> int:
        """Return the UTC of a local time, ns."""
        return round(1e9 * local_s) + self._offset_ns

    def _read_offset(self) -> None:
        readings = []
        for _ in range(READINGS):
            before_s, utc_ns, after_s = (
                self._local_clock_s(),
                self._utc_ns(),
                self._local_clock_s(),
            )
            readings.append((after_s - before_s, utc_ns - round(5e8 * (before_s + after_s))))
        self._offset_ns = min(readings)[1]

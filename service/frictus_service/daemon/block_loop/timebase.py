"""Device samples to this machine's clock to UTC, with an honest uncertainty.

A block is seen some time after its last sample was taken, never before. So the points (last
sample, time of return) lie on or above the line wanted, and the line is the lower edge of
their cloud: the edge of its convex hull that passes under the middle (Moon, Skelly and
Towsley, INFOCOM 1999). Offset and rate of UTC come apart from it, by reading the UTC clock
between two readings of the monotonic one, once per block.
"""

import itertools
from dataclasses import dataclass
from typing import Final

import numpy as np

from frictus_hardware.arrays import FloatArray

UNSEEN_NS: Final = 200_000
"""Taken as the 95 % bound of the least time from a sample to this process seeing its block.
No one-sided observation can show it; a woken thread on a busy machine stays below it."""
STEP_NS: Final = 2_000_000
"""A UTC change larger than this within one block is a step; smaller ones are slewing."""
SLEW_PPM: Final = 500.0
"""How fast a disciplined clock is slewed at most (adjtime, NTP)."""
RATE_PPM: Final = 200.0
"""A device clock further off than this is not believed."""
BIN_BLOCKS: Final = 20
"""Blocks of which only the least late one is kept."""
BINS: Final = 128
SETTLED_BINS: Final = 16
"""Before so many bins the nominal rate is used, and what it is off by is called unknown:
`RATE_PPM`. 1.6 s at 5 ms per block."""


@dataclass(frozen=True, slots=True)
class UtcReading:
    """UTC read between two readings of the monotonic clock.

    Attributes
    ----------
    before_ns, after_ns : int
        Monotonic time just before and just after.
    utc_ns : int
        UTC of this moment.
    """

    before_ns: int
    utc_ns: int
    after_ns: int


@dataclass(frozen=True, slots=True)
class Stamp:
    """UTC of a sample, off by at most `uncertainty_ns` (95 %)."""

    utc_ns: int
    uncertainty_ns: int


class Timebase:
    """The running fit; memory is fixed, and no clock is read here.

    Parameters
    ----------
    clock_hz : float
        Nominal samples of the device per second of this machine's clock.

    Attributes
    ----------
    ns_per_sample : float
        Fitted.
    skew_uncertainty_ppm : float
        What `skew_ppm` may be off by (95 %), at most `RATE_PPM`.
    """

    def __init__(self, clock_hz: float) -> None:
        self.nominal_ns: Final = 1e9 / clock_hz
        self.ns_per_sample = self.nominal_ns
        self.skew_uncertainty_ppm = RATE_PPM
        self.utc_steps = 0
        self._samples = np.zeros(BINS, np.int64)
        self._returns_ns = np.zeros(BINS, np.int64)
        self._bins = 0  # closed bins since the start; the ring holds the last BINS of them
        self._open_blocks = 0
        self._least: tuple[int, int, float] | None = None  # sample, return, residual
        self._origin: tuple[int, int] | None = None  # a point of the line: sample, monotonic
        self._spread_ns = 0.0
        self._offset_ns = 0  # UTC less monotonic
        self._bracket_ns = 0
        self._read_ns: int | None = None
        self.newest_sample = 0
        self._step_seen_ns = 0
        self._step_ns = 0

    @property
    def ready(self) -> bool:
        """Whether a block has been observed."""
        return self._origin is not None

    @property
    def skew_ppm(self) -> float:
        """Rate of the device clock against this machine's; positive where it runs fast."""
        return 1e6 * (self.nominal_ns / self.ns_per_sample - 1.0)

    def observe(self, end_sample: int, returned_ns: int, reading: UtcReading) -> None:
        """Take in one block; the line is fitted anew by `fit`.

        Parameters
        ----------
        end_sample : int
            Device index one past the block's last sample.
        returned_ns : int
            Monotonic time at which the block was there.
        reading : UtcReading
            Taken then.
        """
        self._follow_utc(reading)
        self.newest_sample = end_sample
        if self._origin is None:
            self._origin = (end_sample, returned_ns)
        residual = returned_ns - self._line_ns(end_sample)
        if residual < 0.0:  # the line was too late: no block comes before its samples
            self._origin = (end_sample, returned_ns)
        if self._least is None or residual < self._least[2]:
            self._least = (end_sample, returned_ns, residual)
        self._open_blocks += 1

    def fit(self) -> None:
        """Fit the line anew where a bin is full.

        Takes as long as packing ten blocks: call it after what waits for a stamp.
        """
        if self._open_blocks >= BIN_BLOCKS:
            self._close_bin()

    def stamp(self, sample: int) -> Stamp:
        """Return UTC of a device sample near the newest block.

        Raises
        ------
        RuntimeError
            Before the first block.
        """
        if self._origin is None:
            raise RuntimeError("no block has been observed yet")
        monotonic_ns = self._line_ns(sample)
        settling_ns = 0.0
        if self._bins < SETTLED_BINS:
            settling_ns = RATE_PPM * 1e-6 * abs(monotonic_ns - self._origin[1])
        uncertainty = UNSEEN_NS + self._spread_ns + settling_ns + self._bracket_ns / 2
        if monotonic_ns <= self._step_seen_ns:
            # The sample may have been taken on either side of the step.
            uncertainty += self._step_ns
        return Stamp(int(monotonic_ns) + self._offset_ns, int(uncertainty) + 1)

    def _line_ns(self, sample: int) -> float:
        assert self._origin is not None
        at_sample, at_ns = self._origin
        # Differences stay small, so that float64 keeps nanoseconds.
        return at_ns + (sample - at_sample) * self.ns_per_sample

    def _follow_utc(self, reading: UtcReading) -> None:
        offset = reading.utc_ns - (reading.before_ns + reading.after_ns) // 2
        bracket = reading.after_ns - reading.before_ns
        if self._read_ns is not None:
            elapsed = reading.after_ns - self._read_ns
            allowed = STEP_NS + bracket + self._bracket_ns + SLEW_PPM * 1e-6 * elapsed
            change = abs(offset - self._offset_ns)
            if change > allowed:
                self.utc_steps += 1
                self._step_ns = change
                self._step_seen_ns = reading.after_ns
            elif bracket > 10 * self._bracket_ns + 10_000 and change <= bracket:
                return  # this thread was set aside between the readings: the last one is better
        self._offset_ns = offset
        self._bracket_ns = bracket
        self._read_ns = reading.after_ns

    def _close_bin(self) -> None:
        assert self._least is not None
        slot = self._bins % BINS
        self._samples[slot], self._returns_ns[slot], _ = self._least
        self._bins += 1
        self._open_blocks, self._least = 0, None
        held = min(self._bins, BINS)
        oldest = self._bins - held
        order = (oldest + np.arange(held)) % BINS
        base_sample, base_ns = int(self._samples[order[0]]), int(self._returns_ns[order[0]])
        x = (self._samples[order] - base_sample).astype(np.float64)
        y = (self._returns_ns[order] - base_ns) - x * self.nominal_ns
        if held < SETTLED_BINS:
            slope, intercept = 0.0, float(y.min())
        else:
            slope, intercept = _lower_edge(x, y)
            limit = RATE_PPM * 1e-6 * self.nominal_ns
            if abs(slope) > limit:
                slope = limit if slope > 0.0 else -limit
                intercept = float((y - slope * x).min())
        self.ns_per_sample = self.nominal_ns + slope
        newest = float(x[-1])
        at_ns = base_ns + intercept + newest * self.ns_per_sample
        self._origin = (base_sample + int(newest), round(at_ns))
        # How far typical bins lie above the line bounds how far the line is above the truth.
        above_ns = y - slope * x - intercept
        self._spread_ns = float(np.median(above_ns))
        if held >= SETTLED_BINS:
            # Either end of the edge may be off by what most bins are, a whole busy stretch of
            # them among these: that turns it about its middle.
            most_ns = float(np.percentile(above_ns, 95.0))
            turned = 2.0 * most_ns / (newest * self.nominal_ns)
            self.skew_uncertainty_ppm = min(1e6 * turned, RATE_PPM)


def _lower_edge(x: FloatArray, y: FloatArray) -> tuple[float, float]:
    """Return slope and intercept of the lower hull's edge under the mean of x."""
    hull: list[tuple[float, float]] = []
    # As Python's numbers: taken one by one, an array's cost several times as much.
    for point in zip(x.tolist(), y.tolist(), strict=True):
        while len(hull) > 1 and _turns_right(hull[-2], hull[-1], point):
            hull.pop()
        hull.append(point)
    middle = float(x.mean())
    for (x_0, y_0), (x_1, y_1) in itertools.pairwise(hull):
        if x_1 >= middle:
            slope = (y_1 - y_0) / (x_1 - x_0)
            return slope, y_0 - slope * x_0
    return 0.0, float(y.min())


def _turns_right(
    a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]
) -> bool:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) <= 0.0

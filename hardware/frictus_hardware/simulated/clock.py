"""The device's sample clock: real, scaled, or virtual."""

import math
import time
from collections.abc import Callable
from typing import Annotated, Literal, Protocol

from pydantic import Field

ClockSetting = Literal["real", "virtual"] | Annotated[float, Field(ge=0.01, le=100.0)]
"""As a configuration gives it; a number is the scale: device seconds per second."""


class Clock(Protocol):
    """Counts samples from 0."""

    def start(self) -> None:
        """Begin at sample 0."""
        ...

    def sample(self) -> int:
        """Return how many samples are over."""
        ...

    def wait_until(self, sample: int) -> None:
        """Return once `sample` samples are over."""
        ...


class RealClock:
    """Follows a monotonic clock, so that a late call does not make the next one late.

    Parameters
    ----------
    sample_rate_hz : float
        Samples per second of the device's clock.
    scale : float
        Device seconds per second of the monotonic clock.
    skew_ppm : float
        How much faster than nominal the device runs.
    now, sleep : callable
        Monotonic seconds, and a sleep of at least so many seconds.
    """

    def __init__(
        self,
        sample_rate_hz: float,
        scale: float = 1.0,
        skew_ppm: float = 0.0,
        now: Callable[[], float] = time.perf_counter,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self._samples_per_s = sample_rate_hz * scale * (1.0 + 1e-6 * skew_ppm)
        self._now = now
        self._sleep = sleep
        self._origin_s = now()

    def start(self) -> None:
        """Begin at sample 0."""
        self._origin_s = self._now()

    def sample(self) -> int:
        """Return how many samples are over."""
        return math.floor((self._now() - self._origin_s) * self._samples_per_s)

    def wait_until(self, sample: int) -> None:
        """Sleep to the instant of a sample, counted from the start, not from the last call."""
        deadline_s = self._origin_s + sample / self._samples_per_s
        while (remaining_s := deadline_s - self._now()) > 0.0:
            self._sleep(remaining_s)


class VirtualClock:
    """Jumps to whatever is waited for: nothing is ever late."""

    def __init__(self) -> None:
        self._sample = 0

    def start(self) -> None:
        """Begin at sample 0."""
        self._sample = 0

    def sample(self) -> int:
        """Return how many samples are over."""
        return self._sample

    def wait_until(self, sample: int) -> None:
        """Jump."""
        self._sample = max(self._sample, sample)


def scale_of(setting: ClockSetting) -> float:
    """Return device seconds per second; 1 for the virtual clock, which has no pace."""
    return 1.0 if isinstance(setting, str) else setting


def make_clock(setting: ClockSetting, sample_rate_hz: float, skew_ppm: float = 0.0) -> Clock:
    """Return the configured clock."""
    if setting == "virtual":
        return VirtualClock()
    return RealClock(sample_rate_hz, scale_of(setting), skew_ppm)

"""What the loop looks at in its blocks: monitor, force and health, flags, and lateness."""

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from frictus.block import FingerSensor, Flag
from frictus_hardware.base import Backend, Exchange
from frictus_hardware.output import SampleRing
from frictus_service.config import Limits
from frictus_service.daemon.safety import Event, FaultCleared, FaultRaised
from frictus_service.synthesis.chain import RenderedBlock

RING_SAMPLES = 1 << 16
"""Beside the longest lead; more than any block."""


class Monitor:
    """Remembers what was handed over until it has been played and sensed.

    Root mean squares over a block are compared, not samples: a carrier of 7 kHz turns a skew
    of microseconds between output and monitor into volts.

    Parameters
    ----------
    lead_samples : int
        The longest lead.
    """

    def __init__(self, lead_samples: int) -> None:
        # NaN where it is not known what played.
        self._told_v = SampleRing(RING_SAMPLES + lead_samples)

    def restart(self) -> None:
        """Forget everything: the device began anew."""
        self._told_v.write(0, self._told_v.capacity, 0.0)

    def note_zeros(self, first_sample: int, n_samples: int) -> None:
        """Take note that zeros play where nothing is handed over.

        Parameters
        ----------
        first_sample, n_samples : int
            Where, in samples of the device.
        """
        self._told_v.write(first_sample, n_samples, 0.0)

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
            self._told_v.write(play - lost, min(missing, self._told_v.capacity), np.nan)
        sensed_v = _rms(exchange.voltage_v)
        if not math.isfinite(sensed_v):
            return math.inf
        told_v = _rms(self._told_v.read(exchange.first_sample, n))
        if exchange.first_sample < zero_from or math.isnan(told_v):
            return 0.0
        return abs(sensed_v - told_v)


def _rms(volts: NDArray[np.float64]) -> float:
    return math.sqrt(np.dot(volts, volts) / volts.size)


class BlockChecks:
    """What trips a rig although its block was done: monitor, force, the device's own health.

    Parameters
    ----------
    backend : Backend
        Open; asked for its health.
    limits : Limits
        What monitor and force may be off by.
    feed : callable
        Takes the event of what is wrong.

    Attributes
    ----------
    sensor_lost : bool
        Whether a sensor failed, and has not been seen well since.
    """

    def __init__(self, backend: Backend, limits: Limits, feed: Callable[[Event], None]) -> None:
        self._backend = backend
        self._tolerance_v = limits.monitor_tolerance_v
        self._force_limit_n = limits.force_limit_n
        self._feed = feed
        self._monitor = Monitor(backend.info.longest_lead_samples)
        self.sensor_lost = False

    def restart(self) -> None:
        """Forget what was handed over: the device began anew."""
        self._monitor.restart()

    def note_zeros(self, first_sample: int, n_samples: int) -> None:
        """See `Monitor.note_zeros`.

        Parameters
        ----------
        first_sample, n_samples : int
            Where, in samples of the device.
        """
        self._monitor.note_zeros(first_sample, n_samples)

    def check(self, exchange: Exchange, zero_from: int) -> None:
        """Trip where the monitor contradicts the drive, or someone leans on the screen.

        Parameters
        ----------
        exchange : Exchange
            Of the block.
        zero_from : int
            Device sample from which on the device was told to output zero.
        """
        forces_n = exchange.force_n.ravel()
        # None is larger than all together, which mostly are within the limit, and soon told.
        if not math.sqrt(np.dot(forces_n, forces_n)) <= self._force_limit_n:
            self._check_force(exchange)
        apart_v = self._monitor.compare(exchange, zero_from)
        if not apart_v <= self._tolerance_v:  # NaN must trip too
            wrong = (
                f"the monitor is {apart_v:.3g} V rms off the drive"
                if math.isfinite(apart_v)
                else "the monitored voltage is no finite number"
            )
            self._trip(wrong, f"{self._tolerance_v:g} V", exchange)

    def _trip(self, wrong: str, accepted: str, exchange: Exchange) -> None:
        at = f"at sample {exchange.first_sample}, {accepted} is accepted"
        self._feed(FaultRaised("safety", f"{wrong} {at}"))

    def _check_force(self, exchange: Exchange) -> None:
        power_n2 = np.einsum("ij,ij->i", exchange.force_n, exchange.force_n)
        largest_n = math.sqrt(float(power_n2.max()))
        if not largest_n <= self._force_limit_n:
            wrong = (
                f"a force of {largest_n:.3g} N"
                if math.isfinite(largest_n)
                else "the force is no finite number"
            )
            self._trip(wrong, f"{self._force_limit_n:g} N", exchange)

    def check_health(self) -> None:
        """Ask the device what is wrong with it."""
        wrong = self._backend.health()
        if wrong is not None:
            self._feed(FaultRaised("sensor", wrong))
        elif self.sensor_lost:
            self._feed(FaultCleared("sensor"))
        self.sensor_lost = wrong is not None


UNDERRUN: Final = Flag.UNDERRUN.value
CLIPPED: Final = Flag.CLIPPED.value
EXTRAPOLATED: Final = Flag.EXTRAPOLATED.value
SCALED: Final = Flag.SCALED.value


class OutputFlags:
    """Flags of the ranges handed over lately, looked up by device sample.

    A drive is played one lead after it was handed over, and a block must say of its own
    samples what became of them.

    Parameters
    ----------
    lead_samples, block_samples : int
        The longest lead, and a block: they bound how many ranges are kept.
    """

    def __init__(self, lead_samples: int, block_samples: int) -> None:
        # Two ranges per block, of the lead and of the blocks at both of its ends.
        blocks = lead_samples // block_samples + 3
        # Numbers: joining enumerations one by one takes 20 times as long.
        self._ranges: deque[tuple[int, int, int]] = deque(maxlen=2 * blocks)

    def restart(self) -> None:
        """Forget everything: the device's samples begin anew."""
        self._ranges.clear()

    def note(self, step: RenderedBlock, scaled: bool) -> None:
        """Take note of a block that was handed over, and of the gap before it.

        Parameters
        ----------
        step : RenderedBlock
            What was rendered and sensed.
        scaled : bool
            Whether its scene was scaled to fit.
        """
        exchange, rendered = step.exchange, step.rendered
        first = exchange.play_sample
        if exchange.underrun_samples:
            empty = first - exchange.overrun_samples
            self._ranges.append((empty, empty + exchange.underrun_samples, UNDERRUN))
        flags = 0
        if rendered.clipped_samples or exchange.clipped_samples:
            flags |= CLIPPED
        if rendered.extrapolated_samples:
            flags |= EXTRAPOLATED
        if scaled:
            flags |= SCALED
        self._ranges.append((first, first + exchange.applied_v.size, flags))

    def over(self, first: int, n_samples: int) -> Flag:
        """Return what became of any of the samples from `first` on."""
        end = first + n_samples
        flags = 0
        for begins, ends, noted in reversed(self._ranges):
            if ends <= first:
                break
            if begins < end:
                flags |= noted
        return Flag(flags)


NO_SENSOR: Final = FingerSensor(0)


@dataclass(slots=True)
class LoopCounters:
    """Counts since the rig started, and what holds now. Each is written by the loop alone."""

    blocks: int = 0
    deadline_misses: int = 0
    overruns: int = 0
    underruns: int = 0
    clipped_samples: int = 0
    extrapolated_samples: int = 0
    stale_touches: int = 0
    blocks_dropped: int = 0
    lead_growths: int = 0
    lead_samples: int = 0
    finger_sensors: FingerSensor = NO_SENSOR


KEPT_BLOCKS: Final = 1024
FOLLOW: Final = 1.0 + 2e-4
"""Deadlines are the earliest seen so far, one block after another; they may slip by 200 ppm,
which is more than any device clock is off."""


class Lateness:
    """Rings of fixed size; the loop writes, anybody may read.

    Parameters
    ----------
    clock_hz : float
        Nominal samples of the device per second of this machine's clock.

    Attributes
    ----------
    max_ms : float
        Since the start.
    """

    def __init__(self, clock_hz: float) -> None:
        self._sample_ns = 1e9 / clock_hz
        self._end_sample = 0
        self._late_ms = np.zeros(KEPT_BLOCKS)
        self._margin_ms = np.zeros(KEPT_BLOCKS)
        self._count = 0
        self._deadline_ns: float | None = None
        self._late_in_a_row = 0
        self.max_ms = 0.0

    def restart(self) -> None:
        """Forget the deadline: the device's clock began anew."""
        self._deadline_ns = None
        self._late_in_a_row = 0

    def forget_blocks(self) -> None:
        """Begin the window anew: what was left of a shorter lead says nothing of a longer."""
        self._count = 0

    def note(
        self, returned_ns: int, end_sample: int, block_samples: int, margin_samples: int
    ) -> int:
        """Take in a block; return how many in a row came more than a block late.

        Parameters
        ----------
        returned_ns : int
            Monotonic time at which the block was there.
        end_sample : int
            Device index one past the block's last sample.
        block_samples : int
            Length of a block.
        margin_samples : int
            Output still queued when the block was handed over.
        """
        due_ns = float(returned_ns)
        if self._deadline_ns is not None:
            passed_ns = (end_sample - self._end_sample) * self._sample_ns
            due_ns = min(due_ns, self._deadline_ns + passed_ns * FOLLOW)
        self._deadline_ns, self._end_sample = due_ns, end_sample
        late_ns = returned_ns - due_ns
        late_ms = 1e-6 * late_ns
        slot = self._count % KEPT_BLOCKS
        self._late_ms[slot] = late_ms
        self._margin_ms[slot] = 1e-6 * margin_samples * self._sample_ns
        self._count += 1
        self.max_ms = max(self.max_ms, late_ms)
        self._late_in_a_row = (
            self._late_in_a_row + 1 if late_ns > block_samples * self._sample_ns else 0
        )
        return self._late_in_a_row

    def percentiles_ms(self) -> tuple[float, float]:
        """Return the median and the 99th percentile over the last blocks, ms."""
        late = self._kept(self._late_ms)
        if not late.size:
            return 0.0, 0.0
        median, high = np.percentile(late, (50.0, 99.0))
        return float(median), float(high)

    def least_margin_ms(self) -> float:
        """Return the least output still queued over the last blocks, ms."""
        margin = self._kept(self._margin_ms)
        return float(margin.min()) if margin.size else 0.0

    def _kept(self, ring: NDArray[np.float64]) -> NDArray[np.float64]:
        return ring[: min(self._count, KEPT_BLOCKS)].copy()

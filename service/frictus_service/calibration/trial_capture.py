"""One trial, gathered by the device's samples from what a rig publishes meanwhile."""

from collections.abc import Iterator
from contextlib import ExitStack
from typing import Final, Literal, Self, TypeVar

import numpy as np

from frictus.block import Block, Flag
from frictus.errors import SilenceError
from frictus.gaps import BlockFeed
from frictus.messages import FingerState, TouchState
from frictus.reception import Feed
from frictus.rig import Rig
from frictus_service.calibration.checks import StrokesCapture
from frictus_service.errors import CalibrationError, CaptureError
from frictus_service.study.trial import Trial, TrialInfo

T = TypeVar("T")

SILENT_S: Final = 3.0
"""Without a block for so long, the rig is gone."""
Stream = Literal["force", "accel", "voltage"]
OTHERS: Final[tuple[Stream, ...]] = ("accel", "voltage")


class StreamReader:
    """Follows a rig from block to block; a context manager.

    Time is what the blocks say: the device's sample count, never a clock here.

    Parameters
    ----------
    rig : Rig
        That is calibrated.
    strokes : StrokesCapture
        Takes all that is heard.

    Attributes
    ----------
    sample : int
        Device index one past the newest force sample.
    finger : FingerState or None
        The newest.
    armed : bool
        Whether the device was armed in the newest block.
    was_armed : bool
        Whether it was in any.
    capture : TrialCapture or None
        Takes what arrives.
    """

    def __init__(self, rig: Rig, strokes: StrokesCapture) -> None:
        self._rig = rig
        self._strokes = strokes
        self._undo = ExitStack()
        self._run: int | None = None
        self.sample = 0
        self.sample_rate_hz = 0.0
        self.armed = False
        self.was_armed = False
        self.finger: FingerState | None = None
        self.capture: TrialCapture | None = None
        self._late: list[range] = []

    def __enter__(self) -> Self:
        """Listen, and wait for the first block."""
        with ExitStack() as undo:
            self._force = undo.enter_context(self._rig.blocks("force", timeout_s=SILENT_S))
            self._others = {
                stream: undo.enter_context(self._rig.blocks(stream, timeout_s=0.0))
                for stream in OTHERS
            }
            self._touches = undo.enter_context(self._rig.touches(timeout_s=0.0))
            self._fingers = undo.enter_context(self._rig.fingers(timeout_s=0.0))
            self.advance()
            self._undo = undo.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        """Stop listening."""
        self._undo.close()

    def advance(self) -> None:
        """Wait for the next force block, and take what else has come.

        Raises
        ------
        CalibrationError
            If nothing comes, or the rig began anew.
        """
        try:
            block = next(item for item in self._force if isinstance(item, Block))
        except (SilenceError, StopIteration) as error:
            raise CalibrationError(
                f"rig {self._rig.name} has said nothing for {SILENT_S:g} s; see what became of "
                "it, then start the calibration again: it goes on where it ended"
            ) from error
        self._take_force(block)
        for stream, feed in self._others.items():
            for other in _blocks_waiting(feed):
                if other.run == self._run:
                    self._add_block(stream, other)
        for touch in self._touches.drain():
            if touch.run == self._run:
                self._strokes.add_touch(touch)
                if self.capture is not None:
                    self.capture.add_touch(touch)
        for finger in self._fingers.drain():
            self.finger = finger

    def gaps_within(self, begin: int, end: int) -> int:
        """Return how many blocks between two samples lacked a drive: it came too late.

        Parameters
        ----------
        begin, end : int
            Device indices.
        """
        return sum(late.start < end and late.stop > begin for late in self._late)

    def _take_force(self, block: Block) -> None:
        if self._run is None:
            self._run = block.run
        elif block.run != self._run:
            raise CalibrationError(
                f"rig {self._rig.name} began anew during a trial; start the calibration "
                "again: it goes on where it ended"
            )
        self.sample = block.first_sample + block.data.shape[1]
        if block.flags & Flag.UNDERRUN:
            self._late.append(range(block.first_sample, self.sample))
        self.sample_rate_hz = block.sample_rate_hz
        self.armed = bool(block.flags & Flag.ARMED)
        self.was_armed |= self.armed
        self._add_block("force", block)

    def _add_block(self, stream: Stream, block: Block) -> None:
        self._strokes.add_block(stream, block)
        if self.capture is not None:
            self.capture.add_block(stream, block)


def _blocks_waiting(feed: BlockFeed) -> Iterator[Block]:
    return (item for item in _waiting(feed) if isinstance(item, Block))


def _waiting(feed: Feed[T]) -> Iterator[T]:
    """Give what waits in a feed without waiting for more."""
    try:
        yield from feed
    except SilenceError:
        return


MAX_MISSING: Final = 0.05
"""Of the samples of a stream; a trial that lost more is refused."""
BESIDE_S: Final = 0.15
"""Touch reports just before and after are kept too: the velocity at the ends hangs on them."""
CHANNELS: Final[dict[Stream, int]] = {"force": 3, "accel": 3, "voltage": 1}


class TrialCapture:
    """Takes what arrives, in any order, and keeps what belongs to the trial.

    Parameters
    ----------
    first_sample, n_samples : int
        Of the trial, in device samples.
    sample_rate_hz : float
        Samples per second of the device's clock.
    """

    def __init__(self, first_sample: int, n_samples: int, sample_rate_hz: float) -> None:
        self.first_sample = first_sample
        self.end_sample = first_sample + n_samples
        self.utc_ns = 0
        """UTC of the first sample, once a block has told it."""
        self._rate_hz = sample_rate_hz
        self._data = {
            stream: np.full((n_samples, channels), np.nan)
            for stream, channels in CHANNELS.items()
        }
        self._touches: dict[float, tuple[float, float]] = {}

    def add_block(self, stream: Stream, block: Block) -> None:
        """Take a block; samples outside the trial are left alone."""
        n = block.data.shape[1]
        begin = max(block.first_sample, self.first_sample)
        end = min(block.first_sample + n, self.end_sample)
        if begin >= end:
            return
        source = block.data[:, begin - block.first_sample : end - block.first_sample]
        self._data[stream][begin - self.first_sample : end - self.first_sample] = source.T
        if self.utc_ns == 0:
            since = (self.first_sample - block.first_sample) / self._rate_hz
            self.utc_ns = block.utc_ns + round(1e9 * since)

    def add_touch(self, touch: TouchState) -> None:
        """Take a touch report; those without contact say nothing of the path."""
        at_s = (touch.sample - self.first_sample) / self._rate_hz
        length_s = (self.end_sample - self.first_sample) / self._rate_hz
        if touch.in_contact and -BESIDE_S <= at_s <= length_s + BESIDE_S:
            self._touches[at_s] = (touch.x_mm, touch.y_mm)

    def missing(self) -> dict[Stream, int]:
        """Return how many samples of each stream have not come."""
        return {
            stream: int(np.count_nonzero(np.isnan(data[:, 0])))
            for stream, data in self._data.items()
        }

    def trial(self, info: TrialInfo) -> Trial:
        """Return the trial; what is missing of it is NaN.

        Parameters
        ----------
        info : TrialInfo

        Raises
        ------
        CaptureError
            If more than 5 % of a stream is missing, or the finger was hardly seen.
        """
        n = self.end_sample - self.first_sample
        for stream, count in self.missing().items():
            if count > MAX_MISSING * n:
                raise CaptureError(
                    f"{count} of {n} samples of {stream} did not arrive, at most "
                    f"{100 * MAX_MISSING:g} % may be missing: check the network and the load"
                )
        if len(self._touches) < 4:
            raise CaptureError(
                f"{len(self._touches)} touch reports with contact: the finger was not on the "
                "screen, or its sensor is gone"
            )
        time = np.array(sorted(self._touches))
        return Trial(
            info=info,
            voltage_v=self._data["voltage"][:, 0],
            force_n=self._data["force"],
            accel_m_s2=self._data["accel"],
            skin_velocity_m_s=None,
            position_mm=np.array([self._touches[at] for at in time]),
            position_t_s=time,
            voltage_source="monitor",
        )

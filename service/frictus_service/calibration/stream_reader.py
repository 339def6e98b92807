"""What a rig publishes during a trial, read in step with its force blocks."""

from collections.abc import Iterator
from contextlib import ExitStack
from types import TracebackType
from typing import Final, Self, TypeVar

from frictus.block import Block, Flag
from frictus.errors import SilenceError
from frictus.gaps import BlockFeed
from frictus.messages import FingerState
from frictus.reception import Feed
from frictus.rig import Rig
from frictus_service.calibration.errors import CalibrationError
from frictus_service.calibration.trial_capture import Stream, TrialCapture

T = TypeVar("T")

SILENT_S: Final = 3.0
"""Without a block for so long, the rig is gone."""
OTHERS: Final[tuple[Stream, ...]] = ("accel", "voltage")


class StreamReader:
    """Follows a rig from block to block; a context manager.

    Time is what the blocks say: the device's sample count, never a clock here.

    Parameters
    ----------
    rig : Rig

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

    def __init__(self, rig: Rig) -> None:
        self._rig = rig
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

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
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
                if self.capture is not None and other.run == self._run:
                    self.capture.add_block(stream, other)
        for touch in self._touches.drain():
            if self.capture is not None and touch.run == self._run:
                self.capture.add_touch(touch)
        for finger in self._fingers.drain():
            self.finger = finger

    def gaps_within(self, begin: int, end: int, lead_samples: int) -> int:
        """Return how many blocks were to play between two samples, but came too late.

        Parameters
        ----------
        begin, end : int
            Device indices.
        lead_samples : int
            From handing a drive over, when a block tells that it was late, to its playing.
        """
        return sum(
            late.start + lead_samples < end and late.stop + lead_samples > begin
            for late in self._late
        )

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
        if self.capture is not None:
            self.capture.add_block("force", block)


def _blocks_waiting(feed: BlockFeed) -> Iterator[Block]:
    return (item for item in _waiting(feed) if isinstance(item, Block))


def _waiting(feed: Feed[T]) -> Iterator[T]:
    """Give what waits in a feed without waiting for more."""
    try:
        yield from feed
    except SilenceError:
        return

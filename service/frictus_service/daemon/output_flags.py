"""What became of the output, remembered until its samples have played and are published."""

from collections import deque
from typing import Final

from frictus.block import Flag
from frictus_service.synthesis.chain import RenderedBlock

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
        They bound how many ranges are kept.
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

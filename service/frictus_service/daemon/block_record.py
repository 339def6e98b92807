"""What the loop hands to the publisher, block by block."""

from dataclasses import dataclass

from frictus.block import Flag
from frictus_service.daemon.timebase import UtcReading
from frictus_service.synthesis.chain import RenderedBlock


@dataclass(frozen=True, slots=True)
class BlockRecord:
    """One block, for the publisher.

    Attributes
    ----------
    run : int
        Changes when the device was opened anew; sample and block counts begin again with it.
    number : int
        Counts the blocks of a run from 0; a jump is a block that the queue could not take.
    step : RenderedBlock
        What was rendered and sensed.
    armed : bool
        Whether the device was armed.
    output : Flag
        What became of the output that played during the block.
    finger : tuple of float
        Estimate at the end of the sensed samples: x, y in mm and vx, vy in mm/s.
    report_age_s : float
        Of the touch report behind it.
    returned_ns : int
        Monotonic time at which the block was there.
    reading : UtcReading
        Of the clocks when the block was there.
    """

    run: int
    number: int
    step: RenderedBlock
    armed: bool
    output: Flag
    finger: tuple[float, float, float, float]
    report_age_s: float
    returned_ns: int
    reading: UtcReading

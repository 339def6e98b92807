"""Where the screen voltage leaves what a steady bias gives: when an update is first felt."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from frictus.block import Block
from frictus_hardware.physics.screen import Screen, screen_voltage

CHANGED_V: Final = 0.01
"""Far above the rounding to float32, far below what an update does within a millisecond."""


def changed_samples(block: Block, screen: Screen, bias: float) -> NDArray[np.intp]:
    """Return the samples of a voltage block that are not what the bias alone gives.

    Parameters
    ----------
    block : Block
        Monitor volts.
    screen : Screen
        Its peak voltage, carrier and size.
    bias : float
        Drive fraction without texture.
    """
    voltage_v = block.data[0].astype(float)
    drive = np.full(voltage_v.size, bias)
    known_v = screen_voltage(screen, drive, block.first_sample, block.sample_rate_hz)
    return np.flatnonzero(np.abs(voltage_v - known_v) > CHANGED_V)

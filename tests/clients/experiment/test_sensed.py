"""What was sensed while an interval was felt."""

import numpy as np
import pytest

from frictus.block import Block, Flag
from frictus.experiment.sensed import SensedForce
from frictus.gaps import Gap


def test_blocks_of_other_channels_end_no_experiment() -> None:
    blocks = [
        Block(1, 1, number, 100 * number, 0, 0, 20_000.0, Flag(0), np.full((rows, 100), 0.4))
        for number, rows in enumerate((3, 4, 1, 3))
    ]
    found = SensedForce.of([*blocks, Gap(2, 4, 200, "lost")])
    assert found is not None
    assert (found.samples, found.lost_blocks) == (300, 2)
    assert found.normal_n == pytest.approx(0.4)

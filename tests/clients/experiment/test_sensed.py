"""What was sensed while an interval was felt."""

from typing import Any

import numpy as np
import pytest

from frictus.block import Block, Flag
from frictus.experiment.sensed import FingerPath, SensedForce
from frictus.gaps import Gap


@pytest.mark.parametrize(("way_mm", "still"), [(0.4, True), (0.6, False)])
def test_a_finger_within_half_a_millimetre_is_still(
    fake: Any, way_mm: float, still: bool
) -> None:
    places = (0.0, way_mm) * 100  # a long way, as the noise of a touch sensor makes it
    path = FingerPath.of([fake.finger(0).model_copy(update={"y_mm": y}) for y in places])
    assert path is not None
    assert path.path_mm > 30.0
    assert path.still == still


def test_blocks_of_other_channels_end_no_experiment() -> None:
    blocks = [
        Block(1, 1, number, 100 * number, 0, 0, 20_000.0, Flag(0), np.full((rows, 100), 0.4))
        for number, rows in enumerate((3, 4, 1, 3))
    ]
    found = SensedForce.of([*blocks, Gap(2, 4, 200, "lost")])
    assert found is not None
    assert (found.samples, found.lost_blocks) == (300, 2)
    assert found.normal_n == pytest.approx(0.4)

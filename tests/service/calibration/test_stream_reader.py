"""What a listener remembers of the blocks that it heard."""

from contextlib import nullcontext
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

import frictus
from frictus.block import Block, Flag
from frictus_service.calibration.checks import StrokesCapture
from frictus_service.calibration.trial_capture import StreamReader

N = 200
LATE_AT = 2_000


class Played:
    """A rig of which every feed is over at once, but for that of the force."""

    name = "rig1"

    def blocks(self, stream: str, timeout_s: float) -> Any:
        said = [_block(first) for first in range(0, 4_000, N)] if stream == "force" else []
        return nullcontext(iter(said))

    def touches(self, timeout_s: float) -> Any:
        return nullcontext(SimpleNamespace(drain=list))

    fingers = touches


def _block(first: int) -> Block:
    flags = Flag.ARMED | (Flag.UNDERRUN if first == LATE_AT else Flag(0))
    return Block(1, 1, first // N, first, 0, 1, 20_000.0, flags, np.zeros((3, N), np.float32))


@pytest.fixture
def heard() -> StreamReader:
    with StreamReader(cast(frictus.Rig, Played()), StrokesCapture()) as listener:
        while listener.sample < 4_000:
            listener.advance()
    return listener


@pytest.mark.parametrize(
    ("begin", "end", "gaps"),
    [(0, 2_000, 0), (0, 2_001, 1), (2_100, 2_110, 1), (2_199, 9_000, 1), (2_200, 9_000, 0)],
)
def test_a_drive_that_came_too_late_is_a_gap_where_it_should_have_played(
    heard: StreamReader, begin: int, end: int, gaps: int
) -> None:
    assert heard.gaps_within(begin, end) == gaps

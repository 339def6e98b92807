"""Frames follow one another: each begins where the one before ended, plus what was lost."""

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from frictus.block import Block, Flag
from frictus.websocket.messages import Watch
from frictus_service.api.dashboard.traces import Trace

RATE_HZ = 1_000.0
BLOCK = 10


def watch(**changes: Any) -> Watch:
    given: dict[str, Any] = {"columns": 100, "window_s": 0.7}  # 7 samples a column
    return Watch(op="watch", rig="rig1", **(given | changes))


def block(sequence: int, run: int = 1, flags: int = 0) -> Block:
    first = sequence * BLOCK
    data = np.arange(first, first + BLOCK, dtype=np.float32)[np.newaxis].repeat(2, axis=0)
    return Block(1, run, sequence, first, first * 1_000_000, 0, RATE_HZ, Flag(flags), data)


@settings(deadline=None)  # the machine may be busy
@given(st.lists(st.booleans(), max_size=60), st.booleans(), st.data())
def test_every_sample_is_shown_once_or_counted_lost(
    arrived: list[bool], raw: bool, data: st.DataObject
) -> None:
    blocks = [block(number) for number, came in enumerate(arrived) if came]
    trace = Trace(watch(raw=raw))
    frames = []
    while blocks:
        taken = data.draw(st.integers(1, len(blocks)))
        frames += trace.push(blocks[:taken])
        blocks = blocks[taken:]
    for before, after in pairwise(frames):
        assert after.first_sample == before.next_sample + after.lost_samples
    for frame in frames:
        assert frame.utc_ns == frame.first_sample * 1_000_000
        assert frame.samples_per_column == (1 if raw else 7)
        numbers = frame.first_sample + np.arange(frame.columns) * frame.samples_per_column
        low = frame.data[0] if raw else frame.data[0, 0]
        high = frame.data[1] if raw else frame.data[1, 1]
        np.testing.assert_array_equal(low, numbers)
        np.testing.assert_array_equal(high, numbers + frame.samples_per_column - 1)


def test_a_new_run_begins_anew() -> None:
    trace = Trace(watch())
    trace.push([block(5)])
    (frame,) = trace.push([block(0, run=2)])
    assert (frame.run, frame.first_sample, frame.lost_samples) == (2, 0, 0)


def test_flags_of_all_blocks_are_told() -> None:
    (frame,) = Trace(watch()).push([block(0, flags=Flag.ARMED), block(1, flags=Flag.CLIPPED)])
    assert frame.flags == Flag.ARMED | Flag.CLIPPED


@pytest.mark.parametrize("raw", [True, False])
def test_nothing_makes_no_frame(raw: bool) -> None:
    assert Trace(watch(raw=raw)).push([]) == []


def test_counts_that_went_back_mute_nothing() -> None:
    trace = Trace(watch(raw=True))
    frames = trace.push([block(0), block(2**40), block(1), block(2)])
    assert [frame.first_sample for frame in frames] == [
        block(0).first_sample,
        block(2**40).first_sample,
        block(1).first_sample,
    ]
    assert frames[-1].data.shape[1] == 2 * block(1).data.shape[1]

"""What is missing in a feed, whoever lost it."""

import asyncio
from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import frictus
from frictus.block import FLOAT32
from frictus.websocket import AsyncFeed, CountedFeed, FingerSample, SampleChunk
from frictus.websocket.feeds import fingers_of, samples_of
from frictus.websocket.frames import Frame, Kind, is_known
from frictus.websocket.messages import Watch
from frictus.websocket.session import Session


def frame(first: int, count: int, lost: int = 0) -> Frame:
    data = np.arange(first, first + count, dtype=np.float32)[np.newaxis]
    return Frame(1, 3, 7, first, lost, 2e4, 1, Kind.RAW, 0, data)


def taken(feed: AsyncFeed[Any]) -> list[Any]:
    feed.fail(ZeroDivisionError())
    items: list[Any] = []

    async def take() -> None:
        async for item in feed:
            items.append(item)

    with pytest.raises(ZeroDivisionError):
        asyncio.run(take())
    return items


@pytest.mark.parametrize("capacity", [1, 2, 3, 100])
def test_every_sample_is_handed_over_or_counted(
    capacity: int, rng: np.random.Generator
) -> None:
    feed: CountedFeed[SampleChunk] = CountedFeed(capacity, None, lambda _: None)
    at = 0
    for _ in range(20):
        count, lost = (int(number) for number in rng.integers(1, 50, 2) * (1, rng.integers(2)))
        feed.put(samples_of(frame(at + lost, count, lost)))
        at += lost + count
    items = taken(feed)
    assert len(items) == min(capacity, 20)
    assert feed.lost + sum(item.count for item in items) == at
    for before, after in pairwise(items):
        assert after.first_sample == before.first_sample + before.count + after.lost
    assert items[0].first_sample == items[0].lost
    assert items[0].flags == frictus.Flag.ARMED | frictus.Flag.CLIPPED


def test_a_failure_comes_behind_what_has_arrived_and_closing_ends_at_once() -> None:
    closed: list[object] = []

    async def work() -> None:
        feed: AsyncFeed[int] = AsyncFeed(4, 0.001, closed.append)
        with pytest.raises(frictus.SilenceError, match=r"0\.001 s"):
            await anext(feed)
        for number in range(6):
            feed.put(number)
        feed.close()
        feed.close()
        assert [number async for number in feed] == []
        assert closed == [feed]
        with pytest.raises(ValueError, match="at least 1"):
            AsyncFeed(0, None, closed.append)

    asyncio.run(work())


def test_states_are_read_as_they_were_packed() -> None:
    rows = np.zeros((8, 2), dtype=FLOAT32)
    rows[:, 1] = [100.0, 1.0, 2.0, 3.0, 4.0, 0.5, 6.0, 5.0]
    first, second = fingers_of(Frame(100, 0, 7, 400, 3, 2e4, 1, Kind.FINGER, 10, rows))
    assert (first.sample, first.lost, first.utc_ns, first.in_contact) == (400, 3, 10, False)
    values = (1.0, 2.0, 3.0, 4.0, 0.5, 6.0, True, False, True)
    assert second == FingerSample(7, 500, 0, 5_000_010, *values)
    with pytest.raises(frictus.FrameError, match="7 rows"):
        fingers_of(Frame(100, 0, 7, 400, 3, 2e4, 1, Kind.FINGER, 10, rows[:7]))
    with pytest.raises(frictus.FrameError, match="0 Hz"):
        fingers_of(Frame(100, 0, 7, 400, 3, 0.0, 1, Kind.FINGER, 10, rows))


def test_frames_of_later_versions_are_passed_over() -> None:
    known = frame(0, 4).pack()
    assert is_known(known)
    assert not is_known(known[:2] + b"\x63" + known[3:])  # a stream
    assert not is_known(known[:44] + b"\x03" + known[45:])  # a kind
    assert is_known(known[:10])  # torn: whoever reads it says so


def test_a_rig_that_is_looked_at_again_is_told_anew() -> None:
    watched: list[str | None] = []

    async def say(asked: Watch) -> None:
        watched.append(asked.rig)

    async def work() -> None:
        session = Session(60.0)
        session.connection = SimpleNamespace(say=say)  # type: ignore[assignment]
        session.look_at("rig1")
        await session.watch()
        session.look_at("rig2")
        session.look_at("rig1")  # what was known of it is forgotten by now
        await session.watch()
        await session.watch()

    asyncio.run(work())
    assert watched == ["rig1", "rig1"]

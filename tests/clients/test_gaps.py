"""Blocks and gaps: the detector alone, then over real Zenoh."""

import asyncio
import threading
from dataclasses import replace
from itertools import islice
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from frictus import Block, Client, Flag, Gap
from frictus.errors import SilenceError
from frictus.gaps import NEAR, GapDetector

WAIT_S = 10.0


def block(sequence: int, run: int = 1, first_sample: int | None = None) -> Block:
    first = 100 * sequence if first_sample is None else first_sample
    data = np.zeros((3, 100), np.float32)
    return Block(1, run, sequence, first, 0, 0, 20_000.0, Flag(0), data)


@given(st.sets(st.integers(0, 60), min_size=2))
def test_every_missing_block_is_counted_where_it_is_missing(kept: set[int]) -> None:
    detector = GapDetector()
    missing: list[int] = []
    samples = 0
    for sequence in sorted(kept):
        *gaps, last = detector.follow(block(sequence))
        assert isinstance(last, Block)
        for gap in gaps:
            assert isinstance(gap, Gap)
            assert gap.reason == "lost"
            first = gap.first_missing_sequence
            missing += range(first, first + gap.missing_blocks)
            samples += gap.samples
    expected = [n for n in range(min(kept), max(kept)) if n not in kept]
    assert missing == expected
    assert samples == 100 * len(expected)
    assert (detector.received, detector.lost) == (len(kept), len(expected))


def test_a_new_run_is_a_gap_even_when_nothing_of_it_is_missing() -> None:
    detector = GapDetector()
    detector.follow(block(9, run=1))
    assert detector.follow(block(0, run=2)) == []
    gap, *blocks = detector.follow(block(1, run=2))
    assert isinstance(gap, Gap)
    assert [one.sequence for one in blocks if isinstance(one, Block)] == [0, 1]
    assert (gap.reason, gap.missing_blocks, gap.samples) == ("restart", 0, 0)
    detector = GapDetector()
    detector.follow(block(9, run=1))
    detector.follow(block(3, run=2))
    gap, *_ = detector.follow(block(4, run=2))
    assert isinstance(gap, Gap)
    assert (gap.missing_blocks, gap.first_missing_sequence, gap.samples) == (3, 0, 300)


def test_samples_lost_by_the_device_are_a_gap_without_blocks() -> None:
    detector = GapDetector()
    detector.follow(block(0))
    gap, _ = detector.follow(block(1, first_sample=150))
    assert gap == Gap(0, 1, 50, "overrun")


def test_a_repeated_block_is_left_out_and_counted() -> None:
    detector = GapDetector()
    detector.follow(block(5))
    assert detector.follow(block(5)) == []
    assert detector.follow(block(4)) == []
    assert (detector.received, detector.repeated, detector.lost) == (1, 2, 0)


FORGED = {
    "far ahead": block(2**40, first_sample=2**50),
    "blocks far ahead": block(2**40, first_sample=500),
    "samples far ahead": block(5, first_sample=2**50),
    "far behind": block(0),
    "another run": block(2**40, run=2),
    "the highest run": block(5, run=2**32 - 1),
    "the lowest run": block(5, run=0),
}


@pytest.mark.parametrize("before", [4, 400])
@pytest.mark.parametrize("forged", FORGED.values(), ids=FORGED.keys())
def test_a_block_that_no_rig_said_costs_itself_alone(forged: Block, before: int) -> None:
    detector = GapDetector()
    true = [block(before + n) for n in range(8)]
    if forged.run == 1 and forged.sequence == 5:  # it must be ahead of the next one
        forged = replace(forged, sequence=before + 4)
    passed = [detector.follow(one) for one in (*true[:4], forged, *true[4:])]
    handed_on = [one for items in passed for one in items]
    assert len(handed_on) == 8
    assert all(one is other for one, other in zip(handed_on, true, strict=True))
    assert detector.lost == 0
    assert detector.strays + detector.repeated == 1


@given(
    st.lists(
        st.tuples(st.integers(0, 2), st.integers(0, 2**64 - 1), st.integers(0, 2**64 - 1)),
        max_size=20,
    )
)
def test_a_stream_comes_back_whatever_was_said_in_its_name(
    forged: list[tuple[int, int, int]],
) -> None:
    detector = GapDetector()
    for run, sequence, first_sample in forged:
        detector.follow(block(sequence, run, first_sample))
    true = [block(10_000 + n) for n in range(2 * NEAR)]
    passed = [detector.follow(one) for one in true]
    assert passed[-1][-1] is true[-1]


def test_samples_that_the_device_lost_for_long_are_a_gap_too() -> None:
    detector = GapDetector()
    detector.follow(block(0))
    assert detector.follow(block(1, first_sample=200_000)) == []
    gap, *blocks = detector.follow(block(2, first_sample=200_100))
    assert gap == Gap(0, 1, 199_900, "overrun")
    assert len(blocks) == 2


def test_a_reader_that_reads_seldom_gets_the_newest_at_once() -> None:
    detector = GapDetector()
    detector.follow(block(0))
    gap, newest = detector.follow(block(1_000), dropped_here=999)
    assert gap == Gap(999, 1, 99_900, "overflow", "999 dropped by this reader's queue")
    assert isinstance(newest, Block)


def test_counts_that_go_back_within_a_run_are_a_gap() -> None:
    detector = GapDetector()
    for sequence in (5_000, 5_001, 7):
        detector.follow(block(sequence))
    gap, *blocks = detector.follow(block(8))
    assert gap == Gap(0, 7, 0, "restart", "run 1 went back")
    assert [one.sequence for one in blocks if isinstance(one, Block)] == [7, 8]
    assert detector.lost == 0


def test_gaps_arrive_in_order_among_the_blocks(client: Client, fake: Any) -> None:
    topic = fake_topic()
    with client.rig("sim").blocks("force", timeout_s=WAIT_S) as feed:
        first = begin(feed, fake)
        for one in (
            fake.block(first + 1),
            fake.block(first + 4),
            fake.block(0, run=2),
            fake.block(1, run=2),
        ):
            fake.say(topic, one)
        items = list(islice(feed, 6))
    kinds = [item.reason if isinstance(item, Gap) else item.sequence for item in items]
    assert kinds == [first + 1, "lost", first + 4, "restart", 0, 1]
    lost = items[1]
    assert isinstance(lost, Gap)
    assert (lost.missing_blocks, lost.first_missing_sequence) == (2, first + 2)
    assert lost.samples == 200
    assert feed.lost == 2


def fake_topic() -> Any:
    from frictus import Topics

    return Topics.FORCE


def begin(feed: Any, fake: Any) -> int:
    """Publish until the first block arrives: the subscription may still be on its way."""
    quiet = threading.Event()
    said = 0
    arrived: list[Any] = []

    def read() -> None:
        arrived.append(next(feed))
        quiet.set()

    reader = threading.Thread(target=read)
    reader.start()
    while not quiet.wait(0.02):
        fake.say(fake_topic(), fake.block(said))
        said += 1
    reader.join()
    last = arrived[0].sequence
    while last < said - 1:  # what was said meanwhile
        last = next(feed).sequence
    return int(last)


def test_a_slow_reader_loses_its_own_blocks_only(client: Client, fake: Any) -> None:
    rig = client.rig("sim")
    with (
        rig.blocks("force", timeout_s=WAIT_S) as quick,
        rig.blocks("force", capacity=4, timeout_s=WAIT_S) as slow,
    ):
        first = begin(quick, fake)
        at_first = next(slow)
        assert isinstance(at_first, Block | Gap)
        before = slow.lost
        for sequence in range(first + 1, first + 101):
            fake.say(fake_topic(), fake.block(sequence))
        received = [item.sequence for item in islice(quick, 100) if isinstance(item, Block)]
        assert received == list(range(first + 1, first + 101))
        # All have arrived by now, so the slow queue holds the last four and one gap.
        items = []
        for item in slow:
            items.append(item)
            if isinstance(item, Block) and item.sequence == first + 100:
                break
    gaps = [item for item in items if isinstance(item, Gap)]
    blocks = [item for item in items if isinstance(item, Block)]
    assert {gap.reason for gap in gaps} == {"overflow"}
    assert [one.sequence for one in blocks[-4:]] == list(range(first + 97, first + 101))
    assert quick.lost == 0
    assert slow.lost - before == sum(gap.missing_blocks for gap in gaps) > 90


def test_garbage_and_foreign_streams_are_gaps_with_a_reason(client: Client, fake: Any) -> None:
    with client.rig("sim").blocks("force", timeout_s=WAIT_S) as feed:
        first = begin(feed, fake)
        fake.say(fake_topic(), b"garbage")
        fake.say(fake_topic(), b"FRIC\x02\x00" + bytes(100))
        fake.say(fake_topic(), replace(fake.block(0), stream=2))
        fake.say(fake_topic(), fake.block(first + 1))
        items = list(islice(feed, 4))
    details = [item.detail for item in items if isinstance(item, Gap)]
    assert len(details) == 3
    assert "header of 64" in details[0]
    assert "version 2" in details[1]
    assert "stream id 2" in details[2]
    assert isinstance(items[3], Block)
    assert feed.unreadable == 3


def test_closing_ends_a_waiting_iteration(client: Client, fake: Any) -> None:
    feed = client.rig("sim").blocks("force")
    seen: list[Any] = []
    reader = threading.Thread(target=lambda: seen.extend(feed))
    reader.start()
    feed.close()
    feed.close()
    reader.join(WAIT_S)
    assert not reader.is_alive()
    assert seen == []


def test_closing_the_client_ends_every_iteration(client: Client, fake: Any) -> None:
    feed = client.rig("sim").fingers()
    reader = threading.Thread(target=lambda: list(feed))
    reader.start()
    client.close()
    reader.join(WAIT_S)
    assert not reader.is_alive()


def test_fingers_give_the_newest_to_a_slow_reader(client: Client, fake: Any) -> None:
    from frictus import Topics

    rig = client.rig("sim")
    with rig.fingers(timeout_s=WAIT_S) as slow, rig.blocks("force", timeout_s=WAIT_S) as mark:
        begin(mark, fake)
        for sequence in range(50):
            fake.say(Topics.FINGER, fake.finger(sequence))
        # Another topic may overtake; the newest finger state is waited for.
        seen = []
        for finger in slow:
            seen.append(finger.sequence)
            if finger.sequence == 49:
                break
    assert seen == sorted(seen)


def test_an_unreadable_finger_is_skipped_and_counted(client: Client, fake: Any) -> None:
    from frictus import Topics

    rig = client.rig("sim")
    with rig.fingers(timeout_s=WAIT_S) as fingers, rig.blocks("force") as mark:
        begin(mark, fake)
        fake.say(Topics.FINGER, b'{"x_mm": NaN}')
        fake.say(Topics.FINGER, fake.finger(3))
        assert next(fingers).sequence == 3
    assert fingers.unreadable == 1


def test_async_iteration_wakes_times_out_and_ends(client: Client, fake: Any) -> None:
    rig = client.rig("sim")
    feed = rig.blocks("force", timeout_s=WAIT_S)
    first = begin(feed, fake)

    async def read() -> list[int]:
        sequences = []
        async with feed:
            asyncio.get_running_loop().call_later(
                0.05, lambda: [fake.say(fake_topic(), fake.block(first + n)) for n in (1, 2, 3)]
            )
            async for item in feed:
                assert isinstance(item, Block)
                sequences.append(item.sequence)
                if item.sequence == first + 3:
                    break
        async for _ in feed:  # it is closed by now
            raise AssertionError
        async with rig.fingers(timeout_s=0.05) as silent:
            with pytest.raises(SilenceError):
                await anext(silent)
        return sequences

    assert asyncio.run(read()) == [first + 1, first + 2, first + 3]


def test_a_cancelled_wait_loses_nothing(client: Client, fake: Any) -> None:
    feed = client.rig("sim").blocks("force")
    first = begin(feed, fake)

    async def read() -> Any:
        with pytest.raises(TimeoutError):
            await asyncio.wait_for(anext(feed), 0.05)
        fake.say(fake_topic(), fake.block(first + 1))
        return await asyncio.wait_for(anext(feed), WAIT_S)

    assert asyncio.run(read()).sequence == first + 1

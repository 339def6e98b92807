"""Several streams as one: every sample that all have, once, at its place."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

import frictus
from frictus.block import Block, Flag
from frictus.keys import CHANNELS, STREAMS

RATE_HZ = 20_000.0


def stream(
    rng: np.random.Generator,
    ranges: list[tuple[int, int]],
    run: int = 1,
    channels: int = 2,
    flags: Flag = Flag.SIMULATED,
) -> Iterator[Block | frictus.Gap]:
    """Yield blocks of random lengths over ranges of samples; a sample holds its own index."""
    for first, end in ranges:
        yield frictus.Gap(1, 0, 0, "lost")
        at = first
        while at < end:
            size = min(int(rng.integers(1, 300)), end - at)
            index = np.arange(at, at + size, dtype=np.float32)
            data = np.stack([index + 0.25 * channel for channel in range(channels)])
            yield Block(1, run, 0, at, round(at * 5e4), 0, RATE_HZ, flags, data)
            at += size


def test_every_common_sample_comes_once_at_its_place(rng: np.random.Generator) -> None:
    force = stream(rng, [(0, 5_000), (5_200, 9_000)], channels=3)
    render = stream(rng, [(400, 7_000), (7_001, 9_400)], flags=Flag.ARMED)
    parts = list(frictus.align(force=force, render=render))
    seen = np.concatenate([part.data["force"][0] for part in parts])
    wanted = np.r_[400:5_000, 5_200:7_000, 7_001:9_000]
    np.testing.assert_array_equal(seen, wanted)
    for part in parts:
        n_samples = part.data["force"].shape[1]
        assert part.data["force"].shape == (3, n_samples)
        assert part.data["render"].shape == (2, n_samples)
        np.testing.assert_array_equal(part.data["force"][0], part.data["render"][0])
        assert part.first_sample == part.data["force"][0, 0]
        assert part.utc_ns == round(part.first_sample * 5e4)
        np.testing.assert_allclose(part.time_s * RATE_HZ, part.data["force"][0])
        assert part.flags == Flag.SIMULATED | Flag.ARMED
    left_out = {part.first_sample: part.missing_samples for part in parts}
    assert {at: n for at, n in left_out.items() if n} == {5_200: 200, 7_001: 1}
    for before, after in pairwise(parts):
        end = before.first_sample + before.data["force"].shape[1]
        assert after.first_sample == end + after.missing_samples


@pytest.mark.parametrize(("former", "later"), [(1, 2), (2, 1)])
@pytest.mark.parametrize(
    ("ends_a", "ends_b"), [((1_000, 500), (600, 700)), ((0, 500), (600, 700))]
)
def test_a_new_run_begins_anew(
    rng: np.random.Generator,
    former: int,
    later: int,
    ends_a: tuple[int, int],
    ends_b: tuple[int, int],
) -> None:
    def both(ends: tuple[int, int]) -> Iterator[Block | frictus.Gap]:
        yield from stream(rng, [(0, ends[0])], run=former)
        for item in stream(rng, [(0, ends[1])], run=later):
            yield replace(item, utc_ns=item.utc_ns + 10**9) if isinstance(item, Block) else item

    parts = list(frictus.align(a=both(ends_a), b=both(ends_b)))
    for run, end in ((former, min(ends_a[0], ends_b[0])), (later, 500)):
        samples = [part.data["a"][0] for part in parts if part.run == run]
        np.testing.assert_array_equal(np.concatenate(samples or [[]]), np.arange(end))
    assert all(part.missing_samples == 0 for part in parts)


@pytest.mark.parametrize("forged", [(1, 2**50), (2**32 - 1, 0), (0, 0)])
def test_what_no_rig_says_holds_nothing_up_for_good(
    rng: np.random.Generator, forged: tuple[int, int]
) -> None:
    def with_forged() -> Iterator[Block | frictus.Gap]:
        yield from stream(rng, [(0, 1_000)])
        run, first = forged
        yield from stream(rng, [(first, first + 500)], run)
        yield from stream(rng, [(1_000, 40_000)])

    one = [
        Block(1, 1, 0, at, 0, 0, RATE_HZ, Flag(0), np.zeros((1, 10), np.float32))
        for at in range(0, 50_000, 10)
    ]
    parts = list(frictus.align(a=with_forged(), b=iter(one)))
    assert parts[-1].first_sample + parts[-1].data["a"].shape[1] == 40_000
    assert all(part.missing_samples >= 0 for part in parts)


def test_streams_of_two_rigs_are_refused(rng: np.random.Generator) -> None:
    left, right = (stream(rng, [(0, 400_000)], run) for run in (1, 2))
    with pytest.raises(frictus.ArgumentError, match="left and right have no run in common"):
        next(frictus.align(left=left, right=right))
    assert next(left, None) is not None  # long before they end


def test_nothing_to_align_is_refused() -> None:
    with pytest.raises(frictus.ArgumentError, match="name one stream"):
        next(frictus.align())


def test_every_stream_names_its_channels() -> None:
    for number, topic in STREAMS.items():
        if number in CHANNELS:
            assert len(CHANNELS[number]) == topic.message.count(",") + 1
    assert CHANNELS.keys() ^ STREAMS.keys() == {5}, "a rig names its own further channels"

"""Several streams as one: every sample that all have, once, at its place."""

from collections.abc import Iterator
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


def test_a_new_run_begins_anew(rng: np.random.Generator) -> None:
    def both(ends: tuple[int, int], channels: int) -> Iterator[Block | frictus.Gap]:
        yield from stream(rng, [(0, ends[0])], run=1, channels=channels)
        yield from stream(rng, [(0, ends[1])], run=2, channels=channels)

    parts = list(frictus.align(a=both((1_000, 500), 1), b=both((600, 700), 1)))
    samples = {
        run: np.concatenate([part.data["a"][0] for part in parts if part.run == run])
        for run in (1, 2)
    }
    np.testing.assert_array_equal(samples[1], np.arange(600))
    np.testing.assert_array_equal(samples[2], np.arange(500))
    assert all(part.missing_samples == 0 for part in parts)


def test_nothing_to_align_is_refused() -> None:
    with pytest.raises(frictus.ArgumentError, match="name one stream"):
        next(frictus.align())


def test_every_stream_names_its_channels() -> None:
    for number, topic in STREAMS.items():
        if number in CHANNELS:
            assert len(CHANNELS[number]) == topic.message.count(",") + 1
    assert CHANNELS.keys() ^ STREAMS.keys() == {5}, "a rig names its own further channels"

"""Messages of samples, and how blocks become messages."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from frictus.block import Block, Flag
from frictus_service.errors import RecordingError
from frictus_service.recording.samples import HEADER, MESSAGE_S, Coalescer, Samples

RATE_HZ = 20_000.0


def samples_of(data: np.ndarray) -> Samples:
    return Samples(1, 7, 40, 3, 4_000, 10**18, 500, RATE_HZ, Flag.ARMED, data)


def equal(one: Samples, other: Samples) -> bool:
    fields = [name for name in Samples.__slots__ if name != "data"]
    same = all(getattr(one, name) == getattr(other, name) for name in fields)
    return same and np.array_equal(one.data, other.data, equal_nan=True)


@pytest.mark.parametrize("step", [0.0005, 0.04, 1e-6, 3.0])
def test_counts_give_back_every_sample_at_a_quarter_of_double(
    rng: np.random.Generator, step: float
) -> None:
    counts = rng.integers(-32_767, 32_768, (3, 500))
    samples = samples_of((counts * step).astype(np.float32))
    packed = samples.pack(step)
    assert len(packed) == HEADER.size + 2 * counts.size
    assert equal(Samples.unpack(packed), samples)


@pytest.mark.parametrize("odd", [np.nan, np.inf, 40_000 * 0.0005, 0.00025, 1e30])
def test_what_counts_cannot_say_is_kept_as_it_is(rng: np.random.Generator, odd: float) -> None:
    data = (rng.integers(-100, 100, (2, 50)) * 0.0005).astype(np.float32)
    data[1, 7] = odd
    samples = samples_of(data)
    packed = samples.pack(0.0005)
    assert len(packed) == HEADER.size + 4 * data.size
    assert equal(Samples.unpack(packed), samples)


def test_without_a_converter_floats_are_kept(rng: np.random.Generator) -> None:
    samples = samples_of(rng.normal(size=(5, 10)).astype(np.float32))
    assert equal(Samples.unpack(samples.pack(None)), samples)


@given(st.binary(max_size=300), st.integers(0, HEADER.size + 40), st.integers(0, 255))
def test_any_bytes_are_samples_or_an_error(garbage: bytes, place: int, value: int) -> None:
    changed = bytearray(samples_of(np.zeros((1, 10), np.float32)).pack(None))
    changed[place % len(changed)] = value
    for message in (garbage, bytes(changed)):
        try:
            read = Samples.unpack(message)
        except RecordingError:
            continue
        assert read.data.dtype == np.float32


def random_blocks(rng: np.random.Generator, n: int) -> list[Block]:
    """Blocks of a stream in which everything happens that can happen."""
    blocks = []
    run, sequence, sample, utc_ns, flags = 1, 0, 0, 10**18, Flag(0)
    for _ in range(n):
        size = int(rng.choice([50, 100, 100, 100, 3_000]))
        match rng.integers(0, 30):
            case 0:
                run, sequence, sample = run + 1, 0, 0
            case 1:
                sequence, sample = sequence + 3, sample + 300
            case 2:
                sample += 17  # an overrun
            case 3:
                flags ^= Flag.CLIPPED
            case 4:
                utc_ns += 5_000_000_000
        data = rng.normal(size=(2, size)).astype(np.float32)
        blocks.append(Block(1, run, sequence, sample, utc_ns, 9, RATE_HZ, flags, data))
        sequence, sample = sequence + 1, sample + size
        utc_ns += round(1e9 * size / RATE_HZ)
    return blocks


def test_messages_hold_every_block_once_and_nothing_that_differs(
    rng: np.random.Generator,
) -> None:
    blocks = random_blocks(rng, 2_000)
    coalescer = Coalescer()
    messages = [message for block in blocks for message in coalescer.add(block)]
    messages += coalescer.flush()
    assert coalescer.flush() == []
    left = iter(blocks)
    for message in messages:
        held = [next(left) for _ in range(message.blocks)]
        assert np.array_equal(message.data, np.hstack([block.data for block in held]))
        assert message.duration_s <= MESSAGE_S or message.blocks == 1
        for number, block in enumerate(held):
            before = sum(other.data.shape[1] for other in held[:number])
            assert block.run == message.run
            assert block.flags == message.flags
            assert block.sequence == message.first_sequence + number
            assert block.first_sample == message.first_sample + before
            apart_ns = block.utc_ns - message.utc_ns - 1e9 * before / RATE_HZ
            assert abs(apart_ns) < 1_000_000
    assert next(left, None) is None


def test_an_even_stream_gives_ten_messages_a_second() -> None:
    coalescer = Coalescer()
    data = np.zeros((1, 100), np.float32)
    messages = []
    for number in range(200):
        at_ns = 5_000_000 * number
        block = Block(1, 1, number, 100 * number, at_ns, 0, RATE_HZ, Flag(0), data)
        messages += coalescer.add(block)
    assert [message.duration_s for message in messages] == pytest.approx([0.1] * 10)


def test_a_first_sample_beyond_what_counts_hold_is_refused() -> None:
    samples = replace(samples_of(np.zeros((1, 10), np.float32)), first_sample=2**64 - 1)
    with pytest.raises(
        RecordingError, match="first sample 18446744073709551615: no rig counts so"
    ):
        Samples.unpack(samples.pack(None))

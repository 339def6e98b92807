"""Wavelet bands: the transform, the code of its coefficients, blocks in time."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.clients.effect_files.made import band, hjif
from tests.clients.effect_files.spectra import line, strays, times
from tests.clients.effect_files.wavelet_coder import (
    HIGH,
    LOW,
    analysis,
    block_bits,
    stream,
    text_of,
)

from frictus.effect_files import render_effect, wavelets
from frictus.effect_files.spiht import TooManyDecisionsError, decode_block
from frictus.effect_files.wavelets import Budget, synthesis
from frictus.errors import TextureError

RATE_HZ = 8_000
BLOCK = 512
TICKS = 64
"""A block at 8 kHz, in ms."""


def wavelet_band(*streams: str, **more: Any) -> dict[str, Any]:
    """Return a band of blocks that follow one another."""
    effects = [
        {"effect_type": "Basis", "position": TICKS * n, "wavelet_stream": text}
        for n, text in enumerate(streams)
    ]
    made = band("WaveletWave", *effects, block_length=TICKS, upper_frequency_limit=RATE_HZ)
    return made | {"effects": effects} | more


def blocks_of(signal: np.ndarray, count: int = BLOCK) -> list[str]:
    """Return the streams of a signal, block by block."""
    return [stream(signal[n : n + count]) for n in range(0, signal.size, count)]


@pytest.mark.parametrize("count", [16, 64, 1_024])
def test_the_transform_is_undone(count: int, rng: np.random.Generator) -> None:
    signals = rng.standard_normal((3, count))
    coefficients = np.array([analysis(signal) for signal in signals])
    np.testing.assert_allclose(synthesis(coefficients), signals, atol=1e-8)


def test_a_single_coefficient_is_its_basis_function() -> None:
    # Synthesis filters are the other analysis filter with every second sign turned; a cascade
    # of them, from the level of the coefficient to the finest, is the function.
    signs = (-1.0) ** np.arange(9)
    low, high = -HIGH * -signs[:7], LOW * -signs
    for level, number, filters in ((1, 128 + 60, [high]), (2, 64 + 30, [high, low])):
        coefficients = np.zeros((1, 256))
        coefficients[0, number] = 1.0
        function = np.ones(1)
        for step in filters:
            spread = np.zeros(2 * function.size - 1)
            spread[::2] = function
            function = np.convolve(spread, step)
        found = synthesis(coefficients)[0]
        assert np.count_nonzero(np.abs(found) > 1e-9) == function.size
        begin = int(np.nonzero(np.abs(found) > 1e-9)[0][0])
        np.testing.assert_allclose(found[begin : begin + function.size], function, atol=1e-8)
        centre = begin + function.size // 2
        assert centre == (2 * 60 + 1 if level == 1 else 2 * (2 * 30 + 1))


def test_a_constant_is_one_level_of_the_coarsest_band() -> None:
    coefficients = np.zeros((1, 64))
    coefficients[0, :4] = np.sqrt(2.0) ** 4
    np.testing.assert_allclose(synthesis(coefficients), 1.0, atol=1e-9)


@settings(deadline=None, max_examples=40)
@given(st.data(), st.sampled_from([16, 32, 128]), st.integers(0, 15))
def test_whole_coefficients_come_back_exactly(data: Any, count: int, top: int) -> None:
    most = (2 << top) - 1
    sparse = st.one_of(st.just(0), st.integers(-most, most))
    values = data.draw(st.lists(sparse, min_size=count, max_size=count))
    steps, coarse = data.draw(st.tuples(st.integers(0, 127), st.booleans()))
    largest = 1.0 + steps / 8.0 if coarse else steps / 128.0
    bits = bytes(block_bits(values, top, steps, coarse))
    found, decisions = decode_block(bits, count, 10**6)
    np.testing.assert_array_equal(found, np.array(values) * (largest / 2**top))
    with pytest.raises(TooManyDecisionsError):
        decode_block(bits, count, decisions - 1)


@settings(deadline=None)
@given(st.lists(st.integers(0, 1), max_size=300))
def test_any_bits_are_some_block(bits: list[int]) -> None:
    found, _ = decode_block(bytes(bits), 64, 10**5)
    assert np.all(np.abs(found) < 2.0 * (1.0 + 127.0 / 8.0))


def test_a_tone_over_many_blocks_keeps_its_line() -> None:
    time_s = np.arange(8 * BLOCK) / RATE_HZ
    tone = 0.6 * np.sin(2.0 * np.pi * 250.0 * time_s)
    effect = render_effect(hjif(wavelet_band(*blocks_of(tone))), ".hjif")
    assert effect.duration_s == pytest.approx(time_s.size / RATE_HZ)
    assert line(effect, 250.0) == pytest.approx(0.6, rel=0.01)
    assert strays(effect, 0.6 * np.sin(2.0 * np.pi * 250.0 * times(effect))) < 0.01


@pytest.mark.parametrize("rate_hz", [1_000, 8_000, 44_100, 48_000])
def test_blocks_follow_one_another_where_ticks_are_coarser_than_samples(rate_hz: int) -> None:
    count = 256
    ticks = int(1_000 * count / rate_hz)
    begins = np.arange(8) * count
    signals = 0.5 * np.sin(2.0 * np.pi * 200.0 * (begins[:, None] + np.arange(count)) / rate_hz)
    effects = [
        {"position": ticks * n, "wavelet_stream": stream(signal)}
        for n, signal in enumerate(signals)
    ]
    made = band("WaveletWave", *effects, block_length=ticks, upper_frequency_limit=rate_hz)
    effect = render_effect(hjif(made), ".hjif")
    time_s = times(effect)
    # At its ends a tone that breaks off rings at the rate of the band.
    inner = (time_s > 100 / rate_hz) & (time_s < (begins[-1] + count - 100) / rate_hz)
    wanted = 0.5 * np.sin(2.0 * np.pi * 200.0 * time_s)
    assert np.max(np.abs(effect.signal - wanted)[inner]) < 0.005


def test_gaps_empty_blocks_and_other_bands_are_added_up() -> None:
    burst = np.zeros(BLOCK)
    burst[100:400] = 0.4 * np.hanning(300) * np.sin(np.arange(300) / 3.0)
    made = wavelet_band("", stream(burst), "", stream(burst))
    made["effects"][3]["position"] = TICKS * 5
    effect = render_effect(hjif(made, made), ".hjif")
    assert effect.duration_s == pytest.approx(6 * TICKS / 1_000)
    wanted = np.zeros(6 * BLOCK)
    wanted[BLOCK : 2 * BLOCK] = wanted[5 * BLOCK :] = 2.0 * burst
    at_rate = np.fft.irfft(np.fft.rfft(wanted)[: 6 * BLOCK * 3 // 8 + 1], 6 * BLOCK * 3 // 4)
    np.testing.assert_allclose(effect.signal, 0.75 * at_rate, atol=0.002)


def test_a_block_of_the_reference_encoder() -> None:
    # MPEG's reference encoder made it of 64 samples at 8 kHz, 0.5 sin(2 pi 500 Hz t).
    text = (
        "6qzzMABXfbv+ztNS0QBcAsWXyGFrjvnjxzYAAch0IBE5PzZQeCD/tmvdKouIJ4lLRkHdpKDTMNgXPsZMK45DNsSA"
        "AnHUtH/Yu////+V1NIfykCPf7zT/x7bACb/1Z2zEVRf3wBRjMR2cz"
    )
    made = wavelet_band(text, block_length=8)
    decoded = wavelets.wavelet_band(made, "band", 1_000.0, 1.0, Budget())
    assert decoded is not None
    tone = 0.5 * np.sin(2.0 * np.pi * 500.0 * np.arange(64) / RATE_HZ)
    np.testing.assert_allclose(decoded.samples, tone, atol=1e-4)


@pytest.mark.parametrize(
    ("made", "complaint"),
    [
        (wavelet_band("a", block_length=63), r"bands\[0\]: blocks of 63 ticks are 504 samples"),
        (wavelet_band("a", block_length=1), "a power of two from 16 to 32768"),
        (wavelet_band("a", block_length=0.128), r"block_length 0.128; 1 to 1e\+09 accepted"),
        (wavelet_band("a", upper_frequency_limit=0), "upper_frequency_limit 0; 100 to 65535"),
        (wavelet_band("a="), "not Base64 without padding"),
        (wavelet_band("é"), "not Base64"),
        (wavelet_band("a" * 100_001), "100001 characters; at most 100000"),
        (band("WaveletWave", {"keyframes": []}), "drafts from before the standard"),
        (band("WaveletWave", {"effect_type": "Reference"}), "a wavelet band holds Basis alone"),
        (wavelet_band(), "no band to render"),
    ],
)  # fmt: skip
def test_what_cannot_be_decoded_is_refused(made: dict[str, Any], complaint: str) -> None:
    with pytest.raises(TextureError, match=complaint):
        render_effect(hjif(made), ".hjif")


def test_documents_cannot_ask_for_more_than_is_granted(rng: np.random.Generator) -> None:
    noise = wavelet_band(stream(rng.standard_normal(BLOCK)))
    left = Budget(samples=5_000, decisions=30_000)
    wavelets.wavelet_band(noise, "first", 1_000.0, 1.0, left)
    assert left.samples == 5_000 - wavelets.LEAST_SAMPLES
    assert 5_000 < 30_000 - left.decisions < 16 * 2 * BLOCK
    with pytest.raises(
        TextureError, match=r"second.effects\[0\]: more than 6000000 coded deci"
    ):
        wavelets.wavelet_band(noise, "second", 1_000.0, 1.0, Budget(decisions=5_000))
    odd = wavelet_band(
        "", block_length=TICKS * RATE_HZ // 65_521 + 1, upper_frequency_limit=65_521
    )
    with pytest.raises(
        TextureError, match=r"bands\[22\]: more than 3000000 samples of wavelet"
    ):
        render_effect(hjif(*[odd] * 23), ".hjif")
    far = wavelet_band("", "")
    far["effects"][1]["position"] = 150_000
    with pytest.raises(TextureError, match=r"bands\[2\]: more than 3000000 samples of wavelet"):
        render_effect(hjif(*[far] * 3), ".hjif")


def test_text_and_bytes_of_a_stream_are_one() -> None:
    bits = [1, 0, 0, 0, 0, 0, 1, 0, 0, 1, 1]
    assert wavelets.stream_of(bytes([0b01000001, 0b00000110])) == text_of(
        [*bits, 0, 0, 0, 0, 0]
    )

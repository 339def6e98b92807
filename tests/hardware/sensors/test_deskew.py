"""Deskew against analytic signals: error within the stated bound, exact where it says so."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.hardware.sensors.calibration_file import CalibrationFile, gauge_matrix

from frictus_hardware.arrays import FloatArray
from frictus_hardware.errors import ConfigError
from frictus_hardware.sensors.analogue import wrench
from frictus_hardware.sensors.ati import parse_calibration
from frictus_hardware.sensors.timing import Deskew, deskew, turn_offsets_s

RATE_HZ = 20_000.0
OFFSETS_S = turn_offsets_s(10, 200_000.0)


def sines(frequency_hz: float, time_s: FloatArray) -> FloatArray:
    return np.sin(2.0 * np.pi * frequency_hz * time_s + 0.7)


def moved(filter_: Deskew, skewed: FloatArray) -> FloatArray:
    return filter_.run(skewed, filter_.started(skewed[0]))[0]


def error_of(filter_: Deskew, frequency_hz: float) -> float:
    """Largest error over all channels, and the skew that was there before."""
    edges_s = np.arange(400) / RATE_HZ
    out = moved(filter_, sines(frequency_hz, edges_s[:, np.newaxis] + OFFSETS_S))
    ideal = sines(frequency_hz, edges_s - filter_.delay_samples / RATE_HZ)
    settled = filter_.taps.shape[0]
    return float(np.abs(out - ideal[:, np.newaxis])[settled:].max())


def error_bound(filter_: Deskew, frequency_hz: float) -> float:
    """Largest error, as a share of the amplitude: the remainder of interpolation.

    Through L points it is the product of the distances to them, times the L-th derivative of
    the signal, over L!.
    """
    points = filter_.taps.shape[0]
    distances = filter_.delay_samples + RATE_HZ * OFFSETS_S[:, np.newaxis] - np.arange(points)
    turn_rad = 2.0 * np.pi * frequency_hz / RATE_HZ
    product = float(np.abs(np.prod(distances, axis=1)).max())
    return float(product * turn_rad**points / math.factorial(points))


@pytest.mark.parametrize("frequency_hz", [10.0, 100.0, 300.0, 1000.0])
def test_up_to_1_khz_within_the_stated_error(frequency_hz: float) -> None:
    filter_ = deskew(OFFSETS_S, RATE_HZ)
    bound = error_bound(filter_, frequency_hz)
    assert bound <= 1.1e-7
    assert error_of(filter_, frequency_hz) <= bound + 1e-12
    # Untouched, the last channel is 16 degrees late at 1 kHz.
    skew = 2.0 * np.sin(np.pi * 1000.0 * OFFSETS_S[-1])
    assert skew == pytest.approx(0.28, abs=0.01)


@settings(max_examples=30)
@given(st.floats(1.0, 3000.0), st.integers(1, 8))
def test_the_bound_holds_for_any_delay_and_is_not_loose(
    frequency_hz: float, delay_samples: int
) -> None:
    filter_ = deskew(OFFSETS_S, RATE_HZ, delay_samples)
    bound = error_bound(filter_, frequency_hz)
    error = error_of(filter_, frequency_hz)
    assert error <= bound + 1e-12
    if bound > 1e-9 and frequency_hz > 100.0:
        assert error >= 0.3 * bound


def test_polynomials_of_its_order_are_exact() -> None:
    filter_ = deskew(OFFSETS_S, RATE_HZ, 2)
    time = (np.arange(60.0)[:, np.newaxis] + OFFSETS_S * RATE_HZ) / 60.0
    ideal = (np.arange(60.0) - 2.0) / 60.0
    for order in range(6):
        out = moved(filter_, time**order)
        np.testing.assert_allclose(
            out[6:], np.repeat(ideal[6:, np.newaxis] ** order, 10, axis=1), atol=1e-12
        )


def test_a_channel_at_the_edge_is_only_delayed(rng: np.random.Generator) -> None:
    filter_ = deskew([0.0, 1.0 / RATE_HZ], RATE_HZ)
    signal = rng.normal(size=(100, 2))
    out = moved(filter_, signal)
    assert np.array_equal(out[3:, 0], signal[:-3, 0])
    # A channel taken a whole sample late is the next channel taken at the edge.
    np.testing.assert_allclose(out[4:, 1], signal[:-4, 1], atol=1e-12)


@settings(max_examples=30)
@given(st.lists(st.integers(0, 40), max_size=8), st.integers(0, 2**32 - 1))
def test_how_the_stream_is_cut_does_not_show(cuts: list[int], seed: int) -> None:
    signal = np.random.default_rng(seed).normal(size=(sum(cuts) + 5, 10))
    filter_ = deskew(OFFSETS_S, RATE_HZ)
    whole = moved(filter_, signal)
    state = filter_.started(signal[0])
    before = state.copy()
    parts = []
    for part in np.split(signal, np.cumsum(cuts)):
        out, state = filter_.run(part, state)
        parts.append(out)
    assert np.array_equal(np.concatenate(parts), whole)
    assert np.array_equal(filter_.started(signal[0]), before)


def test_a_constant_stays_from_the_first_sample_on() -> None:
    constant = np.tile(np.linspace(-5.0, 5.0, 10), (20, 1))
    np.testing.assert_allclose(
        moved(deskew(OFFSETS_S, RATE_HZ), constant), constant, atol=1e-13
    )


def test_a_gauge_matrix_needs_simultaneous_values() -> None:
    """A side force of 1 N at 1 kHz leaks into the others unless its gauges are deskewed."""
    calibration = parse_calibration(CalibrationFile(gauge_matrix()).text().encode(), "a.cal")
    gains_v = np.linalg.inv(gauge_matrix())[:, 1]
    edges_s = np.arange(400) / RATE_HZ
    offsets_s = OFFSETS_S[4:]
    skewed_v = gains_v * sines(1000.0, edges_s[:, np.newaxis] + offsets_s)
    filter_ = deskew(offsets_s, RATE_HZ)
    ideal_n = np.zeros((400, 6))
    ideal_n[:, 1] = sines(1000.0, edges_s - filter_.delay_samples / RATE_HZ)

    def error(volts: FloatArray) -> float:
        loads = wrench(calibration, volts, np.zeros(6))[filter_.taps.shape[0] :, :3]
        return float(np.abs(loads - ideal_n[filter_.taps.shape[0] :, :3]).max())

    # The gauges at 120 and 240 degrees cancel along x, but are taken 10 µs apart.
    leak_n = np.abs(wrench(calibration, skewed_v, np.zeros(6))[:, 0]).max()
    expected_n = np.sin(np.deg2rad(60.0)) / 3.0 * 2.0 * np.sin(np.pi * 1000.0 * 10e-6)
    assert leak_n == pytest.approx(expected_n, rel=0.01)
    assert error(moved(filter_, skewed_v)) < 1e-6


def test_what_cannot_be_deskewed() -> None:
    with pytest.raises(ConfigError, match="0 to 1 is accepted"):
        deskew(turn_offsets_s(10, 100_000.0), RATE_HZ)
    with pytest.raises(ConfigError, match="0 to 1 is accepted"):
        deskew([np.nan], RATE_HZ)
    with pytest.raises(ConfigError, match="1 to 8"):
        deskew(OFFSETS_S, RATE_HZ, 0)
    for rate_hz in (0.0, np.nan):
        with pytest.raises(ConfigError, match="conversion rate"):
            turn_offsets_s(10, rate_hz)

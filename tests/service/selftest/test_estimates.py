"""The estimates on arrays whose truth is known."""

import numpy as np
import pytest

from frictus_hardware.arrays import FloatArray
from frictus_service.selftest.loop_back import PERIODS, PeriodicTones, compare, tones
from frictus_service.selftest.noise import noise_of
from frictus_service.selftest.playing import PEAK_V
from frictus_service.selftest.report import mean_and_half
from frictus_service.selftest.step import moved_after, staircase

RATE_HZ = 20_000.0


def delayed(excitation: PeriodicTones, samples: float) -> FloatArray:
    """Return the periods that count, a fraction of samples later."""
    size = excitation.period_v.size
    turns = np.exp(-2j * np.pi * np.arange(size // 2 + 1) * samples / size)
    period = np.fft.irfft(np.fft.rfft(excitation.period_v) * turns, size)
    return np.tile(period, PERIODS)


@pytest.mark.parametrize("rate_hz", [1_000.0, 20_000.0, 48_000.0])
def test_the_tones_keep_their_peak_and_stay_off_the_mains(rate_hz: float) -> None:
    excitation = tones(rate_hz)
    assert np.abs(excitation.drive_v).max() == pytest.approx(PEAK_V)
    hz = excitation.bins * rate_hz / excitation.period_v.size
    for mains_hz in (50.0, 60.0):
        assert np.all(np.abs(hz / mains_hz - np.rint(hz / mains_hz)) * mains_hz > 1.0)
    assert hz.max() <= 0.2 * rate_hz
    assert excitation.bins.size >= 4


def test_gain_and_delay_are_found_within_their_intervals(rng: np.random.Generator) -> None:
    excitation = tones(RATE_HZ)
    size = excitation.period_v.size
    hits = np.zeros(2)
    for _ in range(20):
        gain = rng.choice([-1.0, 1.0]) * rng.uniform(0.3, 1.5)
        delay = rng.uniform(0.0, 300.0)
        noise_v = rng.normal(0.0, 0.5, PERIODS * size)
        heard = gain * delayed(excitation, delay) + noise_v + rng.uniform(-1.0, 1.0)
        found = compare(delayed(excitation, 0.0), heard, excitation.bins, size)
        assert found.gain == pytest.approx(gain, abs=0.05)
        assert found.delay_samples == pytest.approx(delay, abs=0.05)
        assert found.residual_v == pytest.approx(0.5, rel=0.05)
        hits += [
            float(abs(found.gain - gain) <= found.gain_half),
            float(abs(found.delay_samples - delay) <= found.delay_half),
        ]
    assert np.all(hits >= 13)  # of 20 at 95 %; fewer come once in 10^5


def test_without_noise_the_loop_back_is_exact() -> None:
    excitation = tones(RATE_HZ)
    heard = delayed(excitation, 0.7)
    found = compare(delayed(excitation, 0.0), heard, excitation.bins, excitation.period_v.size)
    assert found.gain == pytest.approx(1.0, abs=1e-12)
    assert found.delay_samples == pytest.approx(0.7, abs=1e-9)
    assert found.residual_v < 1e-9
    assert found.follows == pytest.approx(1.0)


def test_noise_and_line_are_told_apart(rng: np.random.Generator) -> None:
    time_s = np.arange(80_000) / RATE_HZ
    sigma, line = rng.uniform(0.01, 0.1), rng.uniform(0.05, 0.2)
    hz = rng.choice([50.0, 60.0]) * rng.integers(1, 8) + rng.uniform(-0.3, 0.3)
    hum = line * np.sin(2.0 * np.pi * hz * time_s + rng.uniform(0.0, 6.0))
    drift = 0.5 + 0.2 * time_s
    noise = noise_of(hum + drift + rng.normal(0.0, sigma, time_s.size), RATE_HZ)
    assert noise.found
    assert noise.line_hz == pytest.approx(hz, abs=0.08)
    assert noise.line == pytest.approx(line, abs=0.01 * line + 2.5 * noise.line_half)
    assert noise.rms == pytest.approx(np.hypot(sigma, line / np.sqrt(2.0)), rel=0.05)
    assert noise.mean == pytest.approx(0.9, abs=0.05)


def test_noise_alone_has_no_line(rng: np.random.Generator) -> None:
    draws = [noise_of(rng.normal(0.0, 1.0, 80_000), RATE_HZ) for _ in range(5)]
    assert sum(noise.found for noise in draws) <= 1  # one of two thousand has
    for noise in draws:
        assert noise.rms == pytest.approx(1.0, abs=max(3.0 * noise.rms_half, 0.02))


def test_silence_has_neither() -> None:
    noise = noise_of(np.full(80_000, 0.25), RATE_HZ)
    assert (noise.rms, noise.line, noise.found, noise.mean) == (0.0, 0.0, False, 0.25)


def test_steps_are_found_where_they_are(rng: np.random.Generator) -> None:
    stairs = staircase(RATE_HZ)
    assert np.abs(stairs.drive_v).max() == PEAK_V
    delay = int(rng.integers(0, 200))
    heard = 0.6 * np.concatenate([np.zeros(delay), stairs.drive_v])[: stairs.drive_v.size]
    heard += rng.normal(0.0, 0.1, heard.size)
    moved = moved_after(heard, stairs.steps[:-1], stairs.hold_samples, PEAK_V)
    np.testing.assert_array_equal(moved, delay)
    silent = moved_after(np.zeros(heard.size), stairs.steps[:-1], stairs.hold_samples, PEAK_V)
    assert np.all(np.isnan(silent))


def test_the_interval_of_a_mean_holds_it(rng: np.random.Generator) -> None:
    held = [
        abs(mean) <= half
        for mean, half in (mean_and_half(rng.normal(0.0, 1.0, 8)) for _ in range(1_000))
    ]
    assert np.mean(held) == pytest.approx(0.95, abs=0.035)

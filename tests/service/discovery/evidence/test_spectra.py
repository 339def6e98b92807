"""What is put in besides the tones comes out, and nothing where nothing was put in."""

from dataclasses import replace

import numpy as np
import pytest
from tests.service.identification.trials import (
    RATE_HZ,
    STUDY,
    Made,
    trial,
    true_friction,
)

from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.screen import Screen, screen_voltage
from frictus_service.discovery.evidence.spectra import HarmonicResponse, Stretches
from frictus_service.discovery.evidence.trial_evidence import evidence_of
from frictus_service.study.trial import Trial


def one_tone(
    tones_hz: tuple[float, ...], time_s: FloatArray, rng: np.random.Generator
) -> FloatArray:
    """Return a tone of full modulation."""
    turned = 2.0 * np.pi * tones_hz[0] * time_s + rng.uniform(0.0, 2.0 * np.pi)
    drive: FloatArray = 0.5 + 0.5 * np.cos(turned)
    return drive


def harmonics(measured: Trial) -> HarmonicResponse:
    return evidence_of(measured, STUDY).harmonics


def stretches(measured: Trial) -> Stretches:
    return evidence_of(measured, STUDY).stretches


def with_force(measured: Trial, added: FloatArray) -> Trial:
    force = measured.force_n.copy()
    force[:, 0] += added
    return replace(measured, force_n=force)


def ratio_of_responses(tone_hz: float, order: int) -> complex:
    """Return the answer at a harmonic over that at the tone, the held DAC's size included."""
    at = np.array([tone_hz, order * tone_hz])
    felt = true_friction(at, 60.0) * np.sinc(at / RATE_HZ)
    return complex(felt[1] / felt[0])


@pytest.mark.parametrize("tone", [80.0, 333.0, 900.0])
def test_a_square_and_a_cube(tone: float, rng: np.random.Generator) -> None:
    """m - 4 q m (1 - m) has q of the fundamental at 2f; z + 4 a (z - z^3) has -a / (1 + a)."""
    q, a = 0.01, 0.02
    made = Made((tone,), 60.0)
    square = harmonics(trial(made, rng, one_tone, lambda m: m - 4.0 * q * m * (1.0 - m)))

    def compressed(drive: FloatArray) -> FloatArray:
        z = 2.0 * drive - 1.0
        felt: FloatArray = (z + 4.0 * a * (z - z**3) + 1.0) / 2.0
        return felt

    cube = harmonics(trial(made, rng, one_tone, compressed))
    expected = q * ratio_of_responses(tone, 2)
    np.testing.assert_allclose(square.second, expected, atol=0.02 * q)
    np.testing.assert_allclose(square.third, 0.0, atol=0.02 * q)
    expected = -a / (1.0 + a) * ratio_of_responses(tone, 3)
    np.testing.assert_allclose(cube.third, expected, atol=0.02 * a)
    np.testing.assert_allclose(cube.second, 0.0, atol=0.02 * a)
    np.testing.assert_allclose(square.message_mean, 0.5, atol=2e-3)
    np.testing.assert_allclose(square.message_power, 0.125, rtol=5e-3)


def test_without_harmonics_what_is_found_is_noise(rng: np.random.Generator) -> None:
    found = [
        harmonics(trial(Made((tone,), 80.0, noise_n=0.003), rng))
        for tone in np.geomspace(75.0, 1000.0, 16)
    ]
    for name in ("second", "third"):
        ratio = np.concatenate([getattr(each, name) for each in found])
        variance = np.concatenate([getattr(each, f"{name}_variance") for each in found])
        there = np.isfinite(ratio)
        assert there.sum() > 80
        z = np.concatenate([ratio.real[there], ratio.imag[there]]) / np.tile(
            np.sqrt(variance[there]), 2
        )
        assert abs(z.mean()) < 4.0 / np.sqrt(z.size)
        assert 0.7 < np.mean(z**2) < 1.5


def test_the_carriers_phase_does_not_matter(rng: np.random.Generator) -> None:
    measured = trial(Made((211.0,), 60.0), rng, one_tone)
    assert measured.voltage_v is not None
    drive = one_tone((211.0,), np.arange(measured.voltage_v.size) / RATE_HZ, rng)
    square = 0.99 * drive + 0.01 * drive**2
    for first in (0, 1, 2, 7):
        voltage = screen_voltage(Screen(), drive, first, RATE_HZ)
        added = 0.2 * square
        found = harmonics(with_force(replace(measured, voltage_v=voltage), added))
        if first == 0:
            expected = found
        np.testing.assert_allclose(found.second, expected.second, atol=2e-5)


def test_a_harmonic_of_the_message_is_not_the_fingers(rng: np.random.Generator) -> None:
    def bent(
        tones_hz: tuple[float, ...], time_s: FloatArray, rng: np.random.Generator
    ) -> FloatArray:
        drive = one_tone(tones_hz, time_s, rng)
        return drive - 0.004 * drive * (1.0 - drive)

    found = harmonics(trial(Made((150.0,), 60.0), rng, bent))
    assert np.isnan(found.second).all()
    assert np.isfinite(found.third).all()


def test_missing_samples_do_not_bias(rng: np.random.Generator) -> None:
    whole = trial(
        Made((150.0,), 40.0, noise_n=0.001), rng, one_tone, lambda m: m - 0.04 * m * (1.0 - m)
    )
    assert whole.voltage_v is not None
    voltage, force = whole.voltage_v.copy(), whole.force_n.copy()
    voltage[rng.choice(voltage.size, 300, replace=False)] = np.nan
    force[rng.choice(voltage.size, 1500, replace=False)] = np.nan
    one, other = (
        evidence_of(each, STUDY)
        for each in (whole, replace(whole, voltage_v=voltage, force_n=force))
    )
    np.testing.assert_allclose(other.harmonics.second, one.harmonics.second, atol=1e-3)
    np.testing.assert_allclose(other.harmonics.message_mean, 0.5, atol=3e-3)
    np.testing.assert_allclose(other.stretches.low_n2, one.stretches.low_n2, rtol=0.5)


def blank(rng: np.random.Generator, noise_n: float, seconds: float = 4.0) -> Trial:
    return trial(Made((), 40.0, seconds=seconds, wander_n=0.0, noise_n=noise_n), rng)


def test_a_mains_line_is_found_and_only_where_it_is(rng: np.random.Generator) -> None:
    amplitude, excess, none = 0.004, [], []
    for _ in range(6):
        plain = blank(rng, 0.02)
        time_s = np.arange(plain.force_n.shape[0]) / RATE_HZ
        turned = 2.0 * np.pi * 60.0 * time_s + rng.uniform(0.0, 2.0 * np.pi)
        found = stretches(with_force(plain, amplitude * np.cos(turned)))
        noise = np.sqrt(found.line60_variance)
        # With a line, the noise beats with it.
        error = np.sqrt(noise**2 + amplitude**2 * noise)
        excess.append((found.line60_n2 - amplitude**2 / 2.0) / error)
        none.append(found.line50_n2 / np.sqrt(found.line50_variance))
    for each in (np.concatenate(excess), np.concatenate(none)):
        assert each.size > 30
        assert abs(each.mean()) < 5.0 / np.sqrt(each.size)
        assert 0.3 < each.std() < 2.0


def test_a_line_that_follows_the_path_is_no_mains_line(rng: np.random.Generator) -> None:
    """Of a saw-tooth at whatever speed as much is taken off at 50 Hz as is added."""
    amplitude, plain = 0.01, blank(rng, 1e-4)
    time_s = np.arange(plain.force_n.shape[0]) / RATE_HZ

    def mean_of(line_hz: float) -> float:
        turned = 2.0 * np.pi * line_hz * time_s + rng.uniform(0.0, 2.0 * np.pi)
        found = stretches(with_force(plain, amplitude * np.cos(turned)))
        return float(np.nanmean(found.line50_n2)) / (amplitude**2 / 2.0)

    assert mean_of(50.0) == pytest.approx(1.0, abs=0.02)
    followed = [mean_of(line_hz) for line_hz in np.arange(44.0, 56.0, 0.4)]
    assert max(followed) > 0.5
    assert abs(np.mean(followed)) < 0.03


def test_a_line_beside_a_tone_is_not_told(rng: np.random.Generator) -> None:
    found = stretches(trial(Made((55.0,), 40.0), rng))
    assert np.isnan(found.line50_n2).all()
    assert np.isnan(found.line60_variance).all()


def test_power_at_low_frequencies(rng: np.random.Generator) -> None:
    noise_n = 0.02
    found = [stretches(blank(rng, noise_n)) for _ in range(6)]
    low = np.concatenate([each.low_n2 for each in found])
    variance = np.concatenate([each.low_variance for each in found])
    true = noise_n**2 * 26.0 / (RATE_HZ / 2.0)
    assert low.size > 30
    assert abs(low.mean() - true) < 4.5 * low.std() / np.sqrt(low.size)
    assert 0.5 < low.std() / np.sqrt(variance.mean()) < 1.6


def test_low_power_of_a_line_and_of_a_wandering_force(rng: np.random.Generator) -> None:
    plain = trial(Made((100.0,), 20.0, seconds=3.0, wander_n=0.02), rng)
    time_s = np.arange(plain.force_n.shape[0]) / RATE_HZ
    line = with_force(plain, 0.02 * np.sin(2.0 * np.pi * 10.0 * time_s + 1.0))
    wander, both = stretches(plain).low_n2, stretches(line).low_n2
    assert np.all(wander < 2e-8)
    np.testing.assert_allclose(both, 0.02**2 / 2.0, rtol=0.1)


def test_short_stretches_say_nothing_of_low_frequencies(rng: np.random.Generator) -> None:
    found = stretches(trial(Made((), 100.0), rng))
    assert np.all(found.seconds < 0.35)
    assert np.isnan(found.low_n2).all()
    assert np.isfinite(found.line50_n2[(found.seconds > 0.17) & (found.sweep > 0)]).all()

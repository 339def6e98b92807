"""The scale that errors are told on: third octaves, and the exact target."""

import numpy as np
import pytest
from scipy import signal

from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.linear import Mount, TransferFunction
from frictus_service.fidelity.measure import waveform_error
from frictus_service.fidelity.path import exact_friction
from frictus_service.fidelity.preview import (
    CENTRES_HZ,
    EDGES_HZ,
    FLOOR_DB,
    NOMINAL_HZ,
    band_power,
    error_db,
    rms_db,
    windows,
)
from frictus_service.synthesis.components import Components

pytestmark = pytest.mark.compiled


RATE = 20_000.0


def sinusoid(hz: float, amplitude: float = 1.0, n_samples: int = 40_000) -> FloatArray:
    wave: FloatArray = amplitude * np.cos(2.0 * np.pi * hz * np.arange(n_samples) / RATE + 0.4)
    return wave


def noise(rng: np.random.Generator, n_samples: int = 60_000) -> FloatArray:
    return rng.standard_normal(n_samples)


def test_the_bands_are_third_octaves() -> None:
    np.testing.assert_allclose(CENTRES_HZ, NOMINAL_HZ, rtol=0.02)
    np.testing.assert_allclose(EDGES_HZ[1:] / EDGES_HZ[:-1], 10.0**0.1)
    np.testing.assert_allclose(np.sqrt(EDGES_HZ[1:] * EDGES_HZ[:-1]), CENTRES_HZ)
    assert EDGES_HZ[-1] == pytest.approx(1_122.0, abs=0.1)


@pytest.mark.parametrize("band", range(16))
def test_a_sinusoid_has_half_its_square_in_its_band(band: int) -> None:
    power = band_power(sinusoid(float(CENTRES_HZ[band]), 0.3), RATE, [slice(0, 40_000)])
    assert power[band] == pytest.approx(0.3**2 / 2.0, rel=1e-3)
    assert np.delete(power, band).max() < 1e-6 * power[band]


@pytest.mark.parametrize("hz", [3.0, 1_500.0, 6_000.0])
def test_what_lies_outside_all_bands_is_not_counted(hz: float) -> None:
    power = band_power(sinusoid(hz), RATE, [slice(0, 40_000)])
    assert power.max() < 1e-6


def test_mean_and_trend_are_not_counted() -> None:
    drift = 5.0 + np.linspace(0.0, 3.0, 40_000)
    power = band_power(sinusoid(100.0) + drift, RATE, windows(40_000, 8_192))
    assert power[5] == pytest.approx(0.5, rel=1e-3)
    assert np.delete(power, 5).max() < 1e-4


def test_bands_together_hold_the_power_of_noise(rng: np.random.Generator) -> None:
    n_samples = 240_000  # a band's power scatters by 4 %
    power = band_power(noise(rng, n_samples), RATE, windows(n_samples, 8_192))
    share = np.diff(EDGES_HZ) / (RATE / 2.0)
    assert power.sum() == pytest.approx(share.sum(), rel=0.1)
    np.testing.assert_allclose(power[8:], share[8:], rtol=0.3)


def test_segments_count_by_their_length() -> None:
    loud, soft = sinusoid(250.0, 2.0, 30_000), sinusoid(250.0, 1.0, 10_000)
    both = np.concatenate([loud, soft])
    power = band_power(both, RATE, [slice(0, 30_000), slice(30_000, 40_000)])
    assert power[9] == pytest.approx(0.75 * 2.0 + 0.25 * 0.5, rel=1e-3)


@pytest.mark.parametrize("gain_db", [2.0, -3.5, 0.0])
def test_an_error_in_gain_is_the_error_in_every_band(
    rng: np.random.Generator, gain_db: float
) -> None:
    wave = noise(rng)
    segments = windows(wave.size, 8_192)
    target = band_power(wave, RATE, segments)
    felt = band_power(10.0 ** (gain_db / 20.0) * wave, RATE, segments)
    error = error_db(felt, target)
    np.testing.assert_allclose(error, gain_db, atol=1e-9)
    assert rms_db(error) == pytest.approx(abs(gain_db))


def test_bands_below_the_floor_are_not_judged() -> None:
    target = np.full(16, 1e-2)
    target[3] = 1.0
    target[7] = 1.01 * 10.0 ** (-FLOOR_DB / 10.0)
    target[9] = 0.99 * 10.0 ** (-FLOOR_DB / 10.0)
    target[10] = 0.0
    felt = 10.0 * target
    felt[9] = 1e6
    felt[5] = 0.0
    error = error_db(felt, target)
    assert np.flatnonzero(np.isnan(error)).tolist() == [9, 10]
    assert error[7] == pytest.approx(10.0)
    assert error[5] < -200.0  # nothing felt: as bad as can be, but a number
    assert np.isfinite(rms_db(error))


def test_what_the_samples_have_passed_is_taken_off(rng: np.random.Generator) -> None:
    mount: TransferFunction = Mount().lateral
    hz = np.fft.rfftfreq(40_000, 1.0 / RATE).astype(np.float64)
    wave = noise(rng, 40_000)
    passed = np.multiply(np.fft.rfft(wave), mount.frequency_response(hz))
    through = np.fft.irfft(passed, 40_000)
    segments = windows(40_000, 8_192)
    target = band_power(wave, RATE, segments)
    raw = error_db(band_power(through, RATE, segments), target)
    assert np.abs(raw).max() > 1.0  # 1.16 at rest, and the resonances
    freed = error_db(band_power(through, RATE, segments, mount), target)
    np.testing.assert_allclose(freed, 0.0, atol=0.25)


@pytest.mark.parametrize(
    ("n_samples", "length"), [(8_192, 8_192), (100_000, 8_192), (999, 100)]
)
def test_windows_cover_a_recording(n_samples: int, length: int) -> None:
    cover = np.zeros(n_samples, dtype=int)
    for window in windows(n_samples, length):
        assert window.stop - window.start == length
        cover[window] += 1
    assert window.stop <= n_samples
    assert n_samples - window.stop < length // 2
    inner = cover[length // 2 : window.stop - length // 2]
    assert np.all(inner == 2)
    assert np.all(cover[: window.stop] >= 1)


def test_a_record_that_is_too_short_has_no_window() -> None:
    assert windows(99, 100) == []


def test_the_waveform_error_is_a_share_of_the_target(rng: np.random.Generator) -> None:
    band = signal.butter(4, (30.0, 900.0), "bandpass", fs=RATE, output="sos")
    wave = signal.sosfilt(band, noise(rng))
    segments = [slice(1_000, 30_000), slice(30_000, 60_000)]
    assert waveform_error(wave, wave, RATE, segments) == 0.0
    assert waveform_error(1.03 * wave, wave, RATE, segments) == pytest.approx(0.03)
    assert waveform_error(-wave, wave, RATE, segments) == pytest.approx(2.0)
    beyond = wave + sinusoid(2_500.0, 10.0, 60_000) + 7.0
    assert waveform_error(beyond, wave, RATE, segments) < 1e-3


@pytest.mark.parametrize("spatial", [True, False])
@pytest.mark.parametrize("dense", [True, False])
def test_the_reference_is_the_sum_of_cosines(
    rng: np.random.Generator, spatial: bool, dense: bool
) -> None:
    period = 4.0 if spatial else 0.5
    harmonic = np.arange(1, 40) if dense else np.array([1, 30, 90])
    frequency = harmonic / period
    amplitude, phase = rng.uniform(0.0, 1.0, (2, harmonic.size))
    position = rng.uniform(0.0, 70.0, (1_003, 2))
    first = int(rng.integers(0, 10**6))
    part = Components(frequency, amplitude, phase, spatial, period, 30.0)
    along = position @ np.array([np.cos(np.pi / 6.0), np.sin(np.pi / 6.0)])
    u = along if spatial else (first + np.arange(1_003)) / RATE
    want = np.cos(2.0 * np.pi * np.outer(u, frequency) + phase) @ amplitude
    got = exact_friction([part, part], position, first, RATE)
    np.testing.assert_allclose(got, 2.0 * want, atol=1e-6)

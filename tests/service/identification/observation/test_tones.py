"""Amplitudes are those of a full least squares fit, and their noise is that around the tone."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import signal
from tests.service.identification.trials import PAPER_TONES_HZ, RATE_HZ, message, volts

from frictus_hardware.arrays import FloatArray
from frictus_service.identification.observation.blocks import BLOCK
from frictus_service.identification.observation.response import drive_fraction
from frictus_service.identification.observation.tones import (
    LEAST_BLOCKS,
    MOST_MISSING,
    TREND_HZ,
    Amplitudes,
    Tones,
    fit,
)

pytestmark = pytest.mark.compiled


def fitted(samples: FloatArray, tones_hz: tuple[float, ...]) -> Amplitudes:
    """Fit one channel over its whole length, less a block at each end."""
    tones = Tones(tones_hz, RATE_HZ)
    sums = tones.reduce([samples[:, np.newaxis]])
    return fit(tones, sums, [(1.0,)], 1, sums.n_blocks - 1)


def waves(
    amplitudes: NDArray[np.complex128], tones_hz: tuple[float, ...], count: int
) -> FloatArray:
    turned = np.exp(2j * np.pi * np.multiply.outer(np.arange(count), tones_hz) / RATE_HZ)
    real: FloatArray = (turned @ amplitudes).real
    return real


def draw(rng: np.random.Generator, count: int) -> NDArray[np.complex128]:
    return np.asarray(rng.standard_normal(count) + 1j * rng.standard_normal(count))


def test_exact_at_any_frequency_and_length(rng: np.random.Generator) -> None:
    for _ in range(20):
        tone = (float(rng.uniform(30.0, 3000.0)),)
        true = draw(rng, 1)
        found = fitted(waves(true, tone, int(rng.integers(3000, 20_000))), tone)
        np.testing.assert_allclose(found.amplitude[0], true, rtol=1e-9)


def test_nearest_bin_loses_a_third_where_least_squares_loses_nothing(
    rng: np.random.Generator,
) -> None:
    worst = 0.0
    for tone in PAPER_TONES_HZ:
        true = draw(rng, 1)
        samples = waves(true, (tone,), 4000)
        spectrum = np.fft.rfft(samples) / 2000.0
        nearest = spectrum[round(tone * 4000 / RATE_HZ)]
        worst = max(worst, abs(abs(nearest) / abs(true[0]) - 1.0))
        assert abs(fitted(samples, (tone,)).amplitude[0, 0] / true[0] - 1.0) < 1e-9
    assert worst > 0.25


@pytest.mark.parametrize("rate_hz", [2_000.0, 20_000.0, 500_000.0])
@pytest.mark.parametrize("share", [0.02, 0.1, 0.45])
def test_shortest_segment_tells_a_tone_from_the_trend(
    rate_hz: float, share: float, rng: np.random.Generator
) -> None:
    tones = Tones((share * rate_hz,), rate_hz)
    blocks = int(np.ceil(round(tones.least_s * rate_hz / BLOCK, 6)))
    assert blocks >= LEAST_BLOCKS
    n = np.arange(blocks * BLOCK)
    turned = 2.0 * np.pi * share * n
    trend = np.sin(2.0 * np.pi * TREND_HZ * n / rate_hz + rng.uniform(0.0, 2.0 * np.pi))
    samples = 0.3 + 0.1 * trend + 0.1 * np.cos(turned + 0.3)
    found = fit(tones, tones.reduce([samples[:, np.newaxis]]), [(1.0,)], 0, blocks)
    assert found.amplitude[0, 0] == pytest.approx(0.1 * np.exp(0.3j), rel=1e-3)
    assert np.isfinite(found.variance).all()


@pytest.mark.parametrize("seconds", [0.2, 0.35, 1.0])
def test_wandering_force_is_kept_out(seconds: float, rng: np.random.Generator) -> None:
    count = round(seconds * RATE_HZ)
    time = np.arange(count) / RATE_HZ
    for tone in (30.0, 47.3, 101.0):
        true = 0.1 * np.exp(2j * np.pi * rng.uniform(size=1))
        frequency = rng.uniform(0.1, 2.0, 6)
        phase = rng.uniform(0.0, 2.0 * np.pi, 6)
        wander = np.sin(2.0 * np.pi * np.multiply.outer(time, frequency) + phase).sum(axis=1)
        found = fitted(
            waves(np.asarray(true, np.complex128), (tone,), count) + 0.3 + 0.03 * wander,
            (tone,),
        )
        assert abs(found.amplitude[0, 0] / true[0] - 1.0) < 2e-3


def dense(samples: FloatArray, tones_hz: tuple[float, ...], degree: int) -> FloatArray:
    """Fit by a full matrix, over the same samples, those missing left out."""
    n = np.arange(samples.size)
    scaled = 2.0 * n / samples.size - 1.0
    turned = 2.0 * np.pi * np.multiply.outer(n, tones_hz) / RATE_HZ
    basis = np.column_stack(
        [np.polynomial.legendre.legvander(scaled, degree), np.cos(turned), np.sin(turned)]
    )
    there = np.isfinite(samples)
    solved = np.linalg.lstsq(basis[there], samples[there])[0]
    return np.asarray(solved[degree + 1 :])


@pytest.mark.parametrize("missing", [0.0, 0.1])
def test_agrees_with_a_full_fit(missing: float, rng: np.random.Generator) -> None:
    tones = (37.0, 61.0, 250.0, 1999.0)
    count = 200 * BLOCK
    samples = waves(draw(rng, 4), tones, count) + 0.1 * rng.standard_normal(count)
    samples[rng.uniform(size=count) < missing] = np.nan
    start = int(rng.integers(count // 2))
    samples[start : start + round(missing * 0.5 * count)] = np.nan
    together = Tones(tones, RATE_HZ)
    found = fit(together, together.reduce([samples[:, np.newaxis]]), [(1.0,)], 0, 200)
    degree = int(np.ceil(np.pi * 2.0 * count / RATE_HZ)) + 2
    solved = dense(samples, tones, degree)
    np.testing.assert_allclose(found.amplitude[0], solved[:4] - 1j * solved[4:], atol=2e-6)


def test_missing_samples_leave_no_trace(rng: np.random.Generator) -> None:
    tone, true = (55.0,), draw(rng, 1)
    samples = 2.0 + waves(true, tone, 12_000)
    samples[4000:5500] = np.nan
    found = fitted(samples, tone)
    np.testing.assert_allclose(found.amplitude[0], true, rtol=1e-9)
    assert found.variance[0, 0] < 1e-15


def test_too_many_missing_samples_give_nothing(rng: np.random.Generator) -> None:
    samples = waves(draw(rng, 1), (55.0,), 12_000)
    samples[: round(1.1 * MOST_MISSING * samples.size)] = np.nan
    found = fitted(samples, (55.0,))
    assert np.isnan(found.amplitude).all()
    assert np.isnan(found.variance).all()


def test_tones_of_a_multisine_do_not_disturb_each_other(rng: np.random.Generator) -> None:
    tones = tuple(float(line) * 12.5 for line in range(3, 80, 2))
    true = draw(rng, len(tones))
    count = 8000
    assert count / RATE_HZ > Tones(tones, RATE_HZ).least_s
    found = fitted(waves(true, tones, count), tones)
    np.testing.assert_allclose(found.amplitude[0], true, rtol=1e-8)
    assert np.all(found.variance < 1e-6)


def scatter(noise: FloatArray, tones_hz: tuple[float, ...], count: int) -> FloatArray:
    """Return the mean squared error over the declared variance, per tone."""
    found = [fitted(piece, tones_hz) for piece in noise.reshape(-1, count)]
    error = np.array([each.amplitude[0] for each in found])
    declared = np.array([each.variance[0] for each in found])
    ratio: FloatArray = np.square(np.abs(error)).mean(axis=0) / 2.0 / declared.mean(axis=0)
    return ratio


def test_variance_is_that_of_the_noise_around_the_tone(rng: np.random.Generator) -> None:
    count, repeats = 6000, 300
    white = rng.standard_normal(count * repeats)
    coloured = signal.lfilter([1.0], [1.0, -0.98], white)  # 40 dB between 30 Hz and 2 kHz
    for tone in (40.0, 300.0, 2000.0):
        assert 0.7 < scatter(coloured, (tone,), count)[0] < 1.45
        assert 0.7 < scatter(white, (tone,), count)[0] < 1.45


@pytest.mark.parametrize(
    ("tones_hz", "seconds", "missing"),
    [
        ((50.0, 60.0), 0.7, 0.0),  # the other line lies in one of fourteen bins
        ((20.0, 28.0, 36.0, 44.0, 50.0, 60.0), 0.5, 0.0),  # in up to five of them
        ((50.0, 60.0), 1.0, 0.15),
    ],
)
def test_what_the_fit_took_is_not_counted_as_quiet(
    tones_hz: tuple[float, ...], seconds: float, missing: float, rng: np.random.Generator
) -> None:
    """White noise of variance one: 2 / n, whatever else is fitted, however much is missing."""
    count, declared = round(seconds * RATE_HZ), []
    for _ in range(300):
        noise = rng.standard_normal(count)
        noise[rng.uniform(size=count) < missing] = np.nan
        declared.append(fitted(noise, tones_hz).variance[0])
    # A mean over 300 fits of 14 bins or more each scatters by 1.5 %.
    kept = (count // BLOCK - 2) * BLOCK * (1.0 - missing)
    np.testing.assert_allclose(np.mean(declared, axis=0) * kept / 2.0, 1.0, atol=0.08)


def test_message_is_exact_for_all_tones_of_the_paper(rng: np.random.Generator) -> None:
    """To what the carrier's lines leave in 0.2 s: more at 2 kHz, which is closest to them."""
    time = np.arange(4000) / RATE_HZ
    for tone in PAPER_TONES_HZ:
        drive = message((tone,), time, rng)
        measured = fitted(drive_fraction(volts(drive), 75.0), (tone,)).amplitude[0, 0]
        error = abs(measured / fitted(drive, (tone,)).amplitude[0, 0] - 1.0)
        assert error < (8e-4 if tone < 1999.0 else 1e-3)

"""Excitations stay within the drive and ask for the cutoff."""

import numpy as np
import pytest

from frictus.messages import Excitation
from frictus_hardware.arrays import FloatArray
from frictus_service.calibration import design
from frictus_service.calibration.coordinates import Prior
from frictus_service.errors import ExcitationDesignError

RATE = 20_000.0


def one_period(excitation: Excitation) -> FloatArray:
    assert excitation.period_s is not None
    time_s = np.arange(round(excitation.period_s * RATE)) / RATE
    tones = [
        tone.amplitude * np.cos(2.0 * np.pi * tone.hz * time_s + tone.phase_rad)
        for tone in excitation.tones
    ]
    wave: FloatArray = excitation.bias + np.sum(tones, axis=0)
    return wave


def variance_of_log_cutoff(tone_hz: FloatArray, power: FloatArray, cutoff_hz: float) -> float:
    """Return the bound of Cramér and Rao, by differences of the response itself."""

    def response(log_cutoff: float, log_gain: float, delay_ms: float) -> FloatArray:
        cutoff = np.exp(log_cutoff)
        answer = np.exp(log_gain) / (1.0 + 1j * tone_hz / cutoff)
        answer = answer * np.exp(-2e-3j * np.pi * tone_hz * delay_ms) * np.sqrt(power)
        return np.concatenate([answer.real, answer.imag])

    at = np.array([np.log(cutoff_hz), 0.0, 0.0])
    steps = 1e-5 * np.eye(3)
    gradient = np.array([response(*(at + step)) - response(*(at - step)) for step in steps])
    information = gradient @ gradient.T / (2e-5) ** 2
    return float(np.linalg.inv(information)[0, 0])


def test_a_multisine_fills_the_drive_and_no_more(rng: np.random.Generator) -> None:
    wave = one_period(design.multisine(rng, design.lines(int(rng.integers(3, 20)))))
    assert wave.min() >= 0.0
    assert wave.max() <= 1.0
    assert max(wave.max() - 0.5, 0.5 - wave.min()) == pytest.approx(0.5, abs=1e-6)


def test_a_multisine_has_its_tones_and_nothing_else(rng: np.random.Generator) -> None:
    tones = design.lines(10)
    power = rng.dirichlet(np.ones(10))
    spectrum = np.fft.rfft(one_period(design.multisine(rng, tones, power)))
    harmonic = np.rint(tones / design.BASE_HZ).astype(int)
    others = np.delete(np.abs(spectrum), [0, *harmonic])
    np.testing.assert_allclose(others, 0.0, atol=1e-9)
    shares = np.abs(spectrum[harmonic]) ** 2
    np.testing.assert_allclose(shares / shares.sum(), power, rtol=1e-9)


def test_its_crest_is_below_that_of_random_phases(rng: np.random.Generator) -> None:
    tones = design.lines(12)
    loud = design.multisine(rng, tones).tones[0].amplitude
    time_s = np.arange(2000) / RATE
    peaks = [
        np.abs(
            np.cos(2.0 * np.pi * np.outer(time_s, tones) + rng.uniform(-np.pi, np.pi, 12)).sum(
                axis=1
            )
        ).max()
        for _ in range(50)
    ]
    assert loud > 0.5 / np.median(peaks)


def test_phases_are_new_each_time(rng: np.random.Generator) -> None:
    tones = design.lines(8)
    first, second = (design.multisine(rng, tones) for _ in range(2))
    assert [tone.phase_rad for tone in first.tones] != [tone.phase_rad for tone in second.tones]


@pytest.mark.parametrize("n_tones", [3, 8, 12, 24])
def test_lines_keep_off_mains_and_resonances(n_tones: int) -> None:
    lines = design.lines(n_tones)
    assert lines.size == n_tones
    assert np.all(np.diff(lines) > 0.0)
    np.testing.assert_array_equal(lines / design.BASE_HZ % 2.0, 1.0)
    assert np.all(lines % design.MAINS_HZ != 0.0)
    low, high = design.RESONANCE_HZ
    assert not np.any((lines > low) & (lines < high))
    assert lines[0] >= design.RANGE_HZ[0]
    assert lines[-1] <= design.RANGE_HZ[1]


def test_shared_power_tells_more_than_equal_power() -> None:
    tones = design.lines(12)
    power = design.powers(tones, Prior.weak(), (30.0, 90.0))
    assert power.sum() == pytest.approx(1.0)
    assert np.all(power > 0.0)
    equal = np.full(12, 1.0 / 12.0)
    gains = [
        variance_of_log_cutoff(tones, power, cutoff)
        / variance_of_log_cutoff(tones, equal, cutoff)
        for cutoff in (600.0, 1000.0, 1600.0)
    ]
    assert max(gains) < 1.0
    assert np.prod(gains) ** (1.0 / 3.0) < 0.8


def test_no_other_share_is_better_by_much(rng: np.random.Generator) -> None:
    tones = design.lines(8)
    prior = Prior.weak()
    power = design.powers(tones, prior, (60.0,))
    cutoffs = np.exp(np.log(1214.0) + np.linspace(-2.0, 2.0, 5) * 0.48)

    def cost(shares: FloatArray) -> float:
        return float(
            np.mean([np.log(variance_of_log_cutoff(tones, shares, c)) for c in cutoffs])
        )

    others = [cost(rng.dirichlet(np.ones(8))) for _ in range(300)]
    assert cost(power) < min(others) + 0.2


def test_paper_tones_and_single() -> None:
    tones = design.paper_tones()
    assert (tones.size, tones[0], tones[-1]) == (15, pytest.approx(30.0), pytest.approx(2000.0))
    np.testing.assert_allclose(np.diff(np.log(tones)), np.diff(np.log(tones))[0])
    excitation = design.single(200.0)
    assert sum(tone.amplitude for tone in excitation.tones) <= min(
        excitation.bias, 1.0 - excitation.bias
    )


@pytest.mark.parametrize("tones", [[70.0, 80.0], [70.0, 70.0], [75.0], [5010.0]])
def test_tones_off_the_grid_are_refused(rng: np.random.Generator, tones: list[float]) -> None:
    with pytest.raises(ExcitationDesignError, match="odd multiples of 10 Hz"):
        design.multisine(rng, np.array(tones))


@pytest.mark.parametrize("n_tones", [2, 25])
def test_too_few_or_many_lines_are_refused(n_tones: int) -> None:
    with pytest.raises(ExcitationDesignError, match="3 to 24"):
        design.lines(n_tones)

"""Lines between the tones tell a square from a cube, and both from noise."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy import signal

from frictus.messages import Excitation
from frictus_hardware.arrays import FloatArray
from frictus_service.calibration import design
from frictus_service.calibration.checks import Nonlinearity, nonlinearity
from frictus_service.errors import ExcitationDesignError

RATE = 20_000.0


def drive(excitation: Excitation, seconds: float) -> FloatArray:
    time_s = np.arange(round(seconds * RATE)) / RATE
    tones = [
        tone.amplitude * np.cos(2.0 * np.pi * tone.hz * time_s + tone.phase_rad)
        for tone in excitation.tones
    ]
    wave: FloatArray = np.sum(tones, axis=0)
    return wave


def judge(
    rng: np.random.Generator,
    bend: Callable[[FloatArray], FloatArray],
    noise_n: float = 1e-3,
) -> Nonlinearity:
    excitation = design.multisine(rng, design.lines(12))
    wave = drive(excitation, 1.0)
    stretches = []
    for _ in range(4):
        wander = 1.0 + 0.1 * np.sin(
            2.0 * np.pi * 0.8 * np.arange(wave.size) / RATE + rng.uniform(0.0, 6.0)
        )
        noise = signal.lfilter([1.0], [1.0, -0.97], noise_n * rng.standard_normal(wave.size))
        stretches.append(0.2 + wander * 0.39 * bend(wave) + noise)
    return nonlinearity(stretches, excitation, RATE)


def lag(wave: FloatArray) -> FloatArray:
    filtered: FloatArray = signal.lfilter([0.3], [1.0, -0.7], wave)
    return filtered


def test_a_linear_response_raises_no_alarm(rng: np.random.Generator) -> None:
    found = judge(rng, lag)
    assert found.even.p_value > 1e-5
    assert found.odd.p_value > 1e-5


def test_a_square_stands_at_even_lines(rng: np.random.Generator) -> None:
    found = judge(rng, lambda wave: wave + 0.3 * wave**2, noise_n=1e-5)
    assert found.even.p_value < 1e-6
    assert found.even.level > 3.0 * found.odd.level


def test_a_cube_stands_at_odd_lines(rng: np.random.Generator) -> None:
    found = judge(rng, lambda wave: wave - 0.5 * wave**3, noise_n=1e-5)
    assert found.odd.p_value < 1e-6
    assert found.odd.level > 3.0 * found.even.level


def test_the_level_is_that_of_the_products(rng: np.random.Generator) -> None:
    excitation = design.multisine(rng, design.lines(8))
    wave = drive(excitation, 1.0)
    bent = wave + 0.2 * wave**2
    spectrum = np.abs(np.fft.rfft(bent[: round(0.1 * RATE)])) ** 2
    harmonic = np.rint(design.lines(8) / design.BASE_HZ).astype(int)
    inside = np.arange(harmonic[0], harmonic[-1] + 1)
    even = spectrum[inside[inside % 2 == 0]].sum()
    expected = np.sqrt(even / spectrum[harmonic].sum())
    found = nonlinearity([bent], excitation, RATE)
    assert found.even.level == pytest.approx(expected, rel=1e-3)


def test_what_cannot_be_judged_is_refused(rng: np.random.Generator) -> None:
    with pytest.raises(ExcitationDesignError, match="no period"):
        nonlinearity([np.zeros(20_000)], design.single(200.0), RATE)
    with pytest.raises(ExcitationDesignError, match="5 periods"):
        nonlinearity([np.zeros(9_000)], design.multisine(rng, design.lines(8)), RATE)

"""Sign, delay and damping come out of a mobility, and nothing out of noise."""

import numpy as np
import pytest

from frictus_hardware.arrays import ComplexArray
from frictus_service.identification.plausibility.pool import fit_impedance

TONES_HZ = np.geomspace(30.0, 2000.0, 12)


def mobility(mass_kg: float, damping: float, stiffness: float) -> ComplexArray:
    omega = 2.0 * np.pi * TONES_HZ
    found: ComplexArray = np.reciprocal(
        (damping + 1j * (omega * mass_kg - stiffness / omega)).astype(np.complex128)
    )
    return found


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("delay_s", [0.0, 260e-6, -700e-6])
@pytest.mark.parametrize("skin", [(0.0015, 1.3, 444.0), (0.0002, 0.8, 1500.0)])
def test_exact(sign: float, delay_s: float, skin: tuple[float, float, float]) -> None:
    late = sign * mobility(*skin) * np.exp(-2j * np.pi * TONES_HZ * delay_s)
    found = fit_impedance(TONES_HZ, late, 1e-6 * np.square(np.abs(late)))
    assert sign * found.passivity > 0.3
    assert found.delay_s == pytest.approx(delay_s, abs=1.1e-6)
    assert found.damping_n_s_m == pytest.approx(skin[1], rel=0.01)


def test_repeats_of_a_tone_do_not_outweigh_the_others(rng: np.random.Generator) -> None:
    skin = mobility(0.0015, 1.3, 444.0)
    often = np.repeat(np.arange(TONES_HZ.size), [500, *[1] * (TONES_HZ.size - 1)])
    noise = 0.05 * np.abs(skin[often]) * rng.standard_normal((2, often.size))
    seen = skin[often] + noise[0] + 1j * noise[1]
    found = fit_impedance(TONES_HZ[often], seen, np.square(0.05 * np.abs(skin[often])))
    assert found.passivity > 0.5
    assert found.damping_n_s_m == pytest.approx(1.3, rel=0.2)


def test_noise_is_no_skin(rng: np.random.Generator) -> None:
    for _ in range(20):
        noise = rng.standard_normal(12) + 1j * rng.standard_normal(12)
        found = fit_impedance(TONES_HZ, noise, np.ones(12))
        assert abs(found.passivity) < 0.5


def test_two_tones_do_not_tell(rng: np.random.Generator) -> None:
    two = np.resize(TONES_HZ[:2], 40)
    found = fit_impedance(two, np.exp(1j * rng.uniform(0.0, 6.0, 40)), np.ones(40))
    assert np.isnan(found.passivity)
    nothing = fit_impedance(TONES_HZ, np.full(12, complex(np.nan, np.nan)), np.ones(12))
    assert np.isnan(nothing.passivity)

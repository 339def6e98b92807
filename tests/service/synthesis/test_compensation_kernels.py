"""What undoes effects: exact inverses, whatever the gain, cutoff and block length."""

import numpy as np
import pytest

from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.friction import FrictionLaw
from frictus_service.synthesis import compensator, kernel
from frictus_service.synthesis.compensator import law_tuple
from frictus_service.synthesis.kernel import BlockMotion

pytestmark = pytest.mark.compiled


RATE = 20_000.0
STILL = BlockMotion(0.0, 0.0, 60.0, 0.0, 60.0, 0.0, 60.0, 60.0)
RANGE = (20.0, 100.0)


def test_the_drive_follows_gain_and_cutoff_through_the_block(rng: np.random.Generator) -> None:
    for _ in range(30):
        n_samples = int(rng.integers(1, 300))
        gain_n, cutoff_hz = rng.uniform(0.1, 1.0, 2), rng.uniform(200.0, 3_000.0, 2)
        share = np.arange(n_samples) / n_samples
        gains = gain_n[0] + share * np.diff(gain_n)
        decays = np.exp(-2.0 * np.pi / RATE * (cutoff_hz[0] + share * np.diff(cutoff_hz)))
        drive = rng.uniform(0.0, 1.0, n_samples)
        friction = np.zeros(n_samples + 1)
        for n in range(n_samples):
            friction[n + 1] = decays[n] * friction[n] + (1.0 - decays[n]) * gains[n] * drive[n]
        found = np.empty(n_samples)
        compensator.invert_scheduled(
            tuple(gain_n), tuple(cutoff_hz), STILL, RANGE, RATE, friction, found
        )
        np.testing.assert_allclose(found, drive, atol=1e-9)


def test_a_constant_schedule_is_the_plain_inverse(rng: np.random.Generator) -> None:
    law = FrictionLaw()
    cutoff = law.cutoff_0_hz + 60.0 * law.slope_hz_per_mm_s
    target = 0.15 + 0.01 * rng.standard_normal(301)
    plain, scheduled = np.empty(300), np.empty(300)
    clipped, _ = kernel.invert(law_tuple(law), STILL, RATE, target[:-1], target[-1], plain)
    extrapolated = compensator.invert_scheduled(
        (law.gain_n, law.gain_n), (cutoff, cutoff), STILL, RANGE, RATE, target, scheduled
    )
    assert compensator.bound(scheduled) == clipped
    assert extrapolated == 0
    np.testing.assert_allclose(scheduled, plain, atol=1e-12)


@pytest.mark.parametrize(("speeds", "outside"), [((0.0, 40.0), 50), ((90.0, 110.0), 49)])
def test_samples_beside_the_measured_speeds_are_counted(
    speeds: tuple[float, float], outside: int
) -> None:
    motion = STILL._replace(speed_0=speeds[0], speed_1=speeds[1])
    target, drive = np.full(101, 0.1), np.empty(100)
    found = compensator.invert_scheduled(
        (1.0, 1.0), (500.0, 500.0), motion, RANGE, RATE, target, drive
    )
    assert found == outside


def swapped(
    signal: FloatArray, zeros: FloatArray, poles: FloatArray, cutoff_hz: float, size: int
) -> FloatArray:
    """Run `swap_pairs` in blocks of a size; each overlaps the next by a sample."""
    state, before = np.full((2, zeros.size), signal[0])
    out = np.empty(signal.size - 1)
    for at in range(0, out.size, size):
        block = signal[at : at + size + 1].copy()
        compensator.swap_pairs(zeros, poles, (cutoff_hz,) * 2, RATE, state, before, block)
        out[at : at + size] = block[:-1]
    return out


def test_swapped_pairs_have_the_inverse_response(rng: np.random.Generator) -> None:
    zeros = 2.0 ** rng.uniform(-4.0, 3.0, 6)
    poles = zeros * 2.0 ** rng.uniform(-0.3, 0.3, 6)
    cutoff = float(rng.uniform(400.0, 1_800.0))
    time_s = np.arange(10_001) / RATE
    for tone in (20.0, 100.0, 500.0, 1_000.0):
        wave = np.cos(2.0 * np.pi * tone * time_s)
        felt = swapped(wave, zeros, poles, cutoff, 100)[-4_000:]
        turn = np.exp(-2j * np.pi * tone * time_s[6_000:10_000])
        found = 2.0 * np.mean(felt * turn)
        s = 1j * tone / cutoff
        expected = np.prod((1.0 + s / poles) / (1.0 + s / zeros))
        # A hold runs straight between samples: it takes 1 - sinc² of what is low-passed.
        straight = 1.0 - np.sinc(tone / RATE) ** 2
        limit_db = 1e-3 + 10.8 * straight * np.sum(np.abs(1.0 - zeros / poles))
        assert abs(20.0 * np.log10(abs(found / expected))) < limit_db
        assert abs(np.angle(found / expected, deg=True)) < 0.3


def test_swapped_pairs_do_not_depend_on_how_time_is_split(rng: np.random.Generator) -> None:
    zeros, poles = np.array([0.3, 1.0, 4.0]), np.array([0.35, 1.1, 3.5])
    signal = np.cumsum(rng.standard_normal(1_201))
    whole = swapped(signal, zeros, poles, 900.0, 1_200)
    for size in (1, 25, 100):
        np.testing.assert_allclose(swapped(signal, zeros, poles, 900.0, size), whole, atol=1e-9)
    assert np.ptp(swapped(np.full(501, 0.2), zeros, poles, 900.0, 100)) < 1e-12


def test_what_leaks_away_is_refilled_in_the_tactile_band(rng: np.random.Generator) -> None:
    leak_hz, forget_hz = 2.0, 0.5
    leak, forget = 2.0 * np.pi * leak_hz / RATE, 2.0 * np.pi * forget_hz / RATE
    time_s = np.arange(60_000) / RATE
    for tone in (31.5, 100.0, 1_000.0):
        wave = 0.3 * np.cos(2.0 * np.pi * tone * time_s + rng.uniform(0.0, 6.0))
        drive = 0.5 + wave
        compensator.refill(leak, forget, (0.5, 0.5), np.zeros(2), drive)
        felt = np.empty_like(drive)
        held = 0.5  # the charge that opposes the drive
        for n, given in enumerate(drive):
            felt[n] = given - held
            held += (1.0 - np.exp(-leak)) * felt[n]
        tail = slice(40_000, 60_000)
        turn = np.exp(-2j * np.pi * tone * time_s[tail])
        ratio = np.mean(felt[tail] * turn) / np.mean(wave[tail] * turn)
        assert abs(20.0 * np.log10(abs(ratio))) < 0.02
        assert abs(np.angle(ratio, deg=True)) < 0.2


def test_the_bias_is_not_refilled() -> None:
    drive = np.linspace(0.2, 0.4, 40_000, endpoint=False)
    before = drive.copy()
    compensator.refill(1e-3, 1e-4, (0.2, 0.4), np.zeros(2), drive)
    np.testing.assert_allclose(drive, before, atol=1e-12)


def test_out_of_range_and_nan_are_clipped_and_counted() -> None:
    drive = np.array([-0.1, 0.0, 0.5, 1.0, 1.2, np.nan, np.inf, -np.inf])
    assert compensator.bound(drive) == 5
    np.testing.assert_array_equal(drive, [0.0, 0.0, 0.5, 1.0, 1.0, 0.0, 1.0, 0.0])


def test_a_table_is_read_between_its_points(rng: np.random.Generator) -> None:
    table = np.sort(rng.uniform(0.0, 1.0, 17))
    drive = np.concatenate([[0.0, 1.0], rng.uniform(0.0, 1.0, 50)])
    expected = np.interp(drive, np.linspace(0.0, 1.0, 17), table)
    compensator.look_up(table, drive)
    np.testing.assert_allclose(drive, expected, atol=1e-12)

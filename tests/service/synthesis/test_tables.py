"""Tables: as exact as the sum of cosines, and nothing above the tactile band."""

import numpy as np
import pytest

from frictus.errors import TextureError
from frictus_hardware.arrays import FloatArray
from frictus_service.synthesis import kernel
from frictus_service.synthesis.components import Components
from frictus_service.synthesis.kernel import BlockMotion
from frictus_service.synthesis.layers import single_table
from frictus_service.synthesis.tables import BAND_EDGE_HZ, TOP_HZ, build_table, fitting

pytestmark = pytest.mark.compiled


RATE = 20_000.0


def random_sum(rng: np.random.Generator, spatial: bool, period: float | None) -> Components:
    if period is None:
        frequency = rng.uniform(0.05, 12.0, 40)
    else:
        top = 12 if spatial else 900
        frequency = np.unique(rng.integers(1, round(top * period), 40)) / period
    n = frequency.size
    return Components(
        frequency, rng.uniform(0.0, 1.0, n), rng.uniform(0.0, 6.3, n), spatial, period
    )


def read(
    components: Components, motion: BlockMotion, n_samples: int, first: int = 0
) -> tuple[FloatArray, FloatArray]:
    """What the kernel reads from the table, and what each component would be."""
    table = build_table(components, (-5.0, 75.0))
    out = np.empty(n_samples)
    arrays = single_table(table, components.spatial, components.angle_deg)
    kernel.target_friction(arrays, motion, first, RATE, out)
    t = np.arange(n_samples) / RATE
    u = motion.x_mm + motion.vx_0 * t if components.spatial else first / RATE + t
    waves = components.amplitude_n[:, None] * np.cos(
        2.0 * np.pi * np.outer(components.frequency, u) + components.phase_rad[:, None]
    )
    return out, waves


def at_speed(x_mm: float, speed: float) -> BlockMotion:
    return BlockMotion(x_mm, 17.0, speed, 0.0, speed, 0.0, abs(speed), abs(speed))


@pytest.mark.parametrize("period", [None, 3.7, 200.0])
def test_a_spatial_table_is_the_sum_of_its_cosines(
    rng: np.random.Generator, period: float | None
) -> None:
    components = random_sum(rng, True, period)
    for speed in (31.0, -77.0):  # 12 cycles/mm stay within the band
        got, waves = read(components, at_speed(37.0, speed), 8_000)
        want = waves.sum(axis=0)
        assert np.std(got - want) < 1e-3 * np.std(want)


def test_a_temporal_table_is_the_sum_of_its_cosines(rng: np.random.Generator) -> None:
    components = random_sum(rng, False, 10.0)
    first = int(rng.integers(0, 10**9))
    got, waves = read(components, at_speed(10.0, 0.0), 8_000, first)
    want = waves.sum(axis=0)
    assert np.std(got - want) < 1e-3 * np.std(want)


def weight(cycles_per_mm: float, finest: float, speed: float) -> float:
    """Share of a component that is felt at a speed, next to a much weaker, finer one."""
    frequency = np.array([cycles_per_mm, finest])
    components = Components(frequency, np.array([1.0, 1e-9]), np.zeros(2), True, None)
    n_samples = max(round(20.0 * RATE / (cycles_per_mm * speed)), 2_000)
    got, waves = read(components, at_speed(0.0, speed), min(n_samples, 20_000))
    return float(got @ waves[0] / (waves[0] @ waves[0]))


@pytest.mark.parametrize("finest", [7.3, 20.0, 23.78])
def test_components_fade_between_the_band_edge_and_the_top(finest: float) -> None:
    cycles_per_mm = 7.3
    felt = np.concatenate([np.linspace(200.0, 1_400.0, 49), [BAND_EDGE_HZ, TOP_HZ, 4_000.0]])
    weights = np.array([weight(cycles_per_mm, finest, hz / cycles_per_mm) for hz in felt])
    np.testing.assert_allclose(weights[felt <= BAND_EDGE_HZ], 1.0, atol=2e-3)
    np.testing.assert_allclose(weights[felt >= TOP_HZ], 0.0, atol=1e-6)
    assert TOP_HZ <= 1_260.0
    fading = weights[np.argsort(felt)]
    assert np.all(np.diff(fading) <= 2e-3)  # monotone, but for the interpolation's rounding


def test_nothing_is_rendered_above_the_top(rng: np.random.Generator) -> None:
    frequency = np.geomspace(0.5, 24.0, 60)
    components = Components(frequency, np.ones(60), rng.uniform(0.0, 6.3, 60), True, None)
    for speed in (45.0, 90.0, 180.0, 300.0, 1_000.0):
        n_samples = round(70.0 / speed * RATE)
        got, _ = read(components, at_speed(0.0, speed), n_samples)
        window = np.blackman(n_samples)
        power = np.square(np.abs(np.fft.rfft(got * window)))
        hz = np.fft.rfftfreq(n_samples, 1.0 / RATE)
        lobe = 4.0 * RATE / n_samples
        assert power[hz > TOP_HZ + lobe].sum() < 1e-6 * power.sum()


def test_a_coarse_texture_is_felt_in_full_at_every_speed() -> None:
    assert weight(0.4, 0.4, 1_000.0) == pytest.approx(1.0, abs=1e-3)


def test_temporal_components_above_the_band_are_left_out() -> None:
    components = Components(np.array([100.0, 1_200.0]), np.ones(2), np.zeros(2), False, 10.0)
    got, waves = read(components, at_speed(0.0, 60.0), 4_000)
    np.testing.assert_allclose(got, waves[0], atol=1e-3)
    with pytest.raises(TextureError, match="none is felt"):
        build_table(
            Components(np.array([1_200.0]), np.ones(1), np.zeros(1), False, 10.0), (0.0, 1.0)
        )


@pytest.mark.parametrize(("finest", "period"), [(900.0, None), (1_000.0, 1_000.0)])
def test_a_table_that_is_too_large_is_refused(finest: float, period: float | None) -> None:
    components = Components(np.array([finest]), np.ones(1), np.zeros(1), True, period)
    with pytest.raises(TextureError, match=r"at most 5000000 are kept\. Lower"):
        build_table(components, (-5.0, 75.0))


def recorded(seconds: float, rate_hz: float, rng: np.random.Generator) -> Components:
    """All lines of a recording at 40 mm/s."""
    n = round(seconds * rate_hz / 2.0) - 1
    frequency = np.arange(1, n + 1) / (40.0 * seconds)
    amplitude, phase = rng.uniform(0.0, 1.0, n), rng.uniform(0.0, 6.3, n)
    return Components(frequency, amplitude, phase, True, 40.0 * seconds)


def test_a_long_recording_keeps_what_is_felt_at_speeds_that_are_measured(
    rng: np.random.Generator,
) -> None:
    whole = recorded(rng.uniform(1.0, 2.5), 44_100.0, rng)
    with pytest.raises(TextureError, match="at most"):
        build_table(whole, (-5.0, 75.0))
    left = fitting(whole, (-5.0, 75.0))
    table = build_table(left, (-5.0, 75.0))
    assert 1_000_000 < sum(rows.size for rows in table.octaves) < 5_100_000
    felt = whole.frequency <= BAND_EDGE_HZ / 20.0
    assert np.array_equal(left.frequency[: felt.sum()], whole.frequency[felt])
    slower = BAND_EDGE_HZ / whole.frequency[left.frequency.size]
    gone = whole.frequency.size - left.frequency.size
    (note,) = left.notes
    assert note.startswith(f"{gone} components")
    assert note.endswith(f"below {slower:.2g} mm/s only")


def test_what_fits_is_left_as_it_is(rng: np.random.Generator) -> None:
    for components in (recorded(0.1, 8_000.0, rng), random_sum(rng, False, 10.0)):
        assert fitting(components, (-5.0, 75.0)) is components


def test_a_recording_is_refused_where_too_little_of_it_would_be_left(
    rng: np.random.Generator,
) -> None:
    whole = recorded(9.0, 44_100.0, rng)
    assert fitting(whole, (-5.0, 75.0)) is whole


def test_every_row_is_the_sum_of_what_its_speed_may_hold(rng: np.random.Generator) -> None:
    """Against plain cosines, at the points of each octave, periodic and not."""
    for period in (None, 30.0):
        components = random_sum(rng, True, period)
        table = build_table(components, (-5.0, 75.0))
        assert len(table.octaves) > 2
        for octave, rows in enumerate(table.octaves):
            n_points = table.n_points >> octave
            assert rows.shape[1] == n_points + 3
            x = table.origin + np.arange(n_points) * table.length / n_points
            for row in range(rows.shape[0]):
                kept = np.floor(12.0 * np.log2(table.top / components.frequency) + 1e-9)
                kept = np.minimum(kept, table.n_rows - 1) >= 12 * octave + row
                want = components.amplitude_n[kept] @ np.cos(
                    2.0 * np.pi * np.outer(components.frequency[kept], x)
                    + components.phase_rad[kept, None]
                )
                np.testing.assert_allclose(rows[row, 1:-2], want, atol=1e-9)
                assert rows[row, 0] == rows[row, -3]
                assert np.array_equal(rows[row, -2:], rows[row, 1:3])

"""The reach of a table is what plain sums of cosines reach, and costs little to find."""

import time

import numpy as np
import pytest

from frictus.textures import Component, Profile, Region, Scene, Spectrum
from frictus_hardware.physics.friction import FrictionLaw
from frictus_hardware.physics.screen import Screen
from frictus_service.synthesis.compensability import inverse_of_model, placeholder_model
from frictus_service.synthesis.components import Components
from frictus_service.synthesis.drive_range import _table_reach
from frictus_service.synthesis.estimator import PredictedMotion
from frictus_service.synthesis.kernel import BlockMotion
from frictus_service.synthesis.layers import single_table
from frictus_service.synthesis.renderer import Renderer
from frictus_service.synthesis.scene import compile_scene
from frictus_service.synthesis.tables import BAND_EDGE_HZ, build_table

RATE_HZ = 20_000.0


@pytest.mark.compiled
@pytest.mark.parametrize("period", [None, 0.05, 0.7, 9.0])
def test_the_reach_is_that_of_the_sum_of_cosines(
    rng: np.random.Generator, period: float | None
) -> None:
    if period is None:
        frequency = rng.uniform(0.2, 8.0, 12)
    else:
        frequency = np.unique(rng.integers(1, 12, 12)) / period
    amplitude, phase = rng.uniform(0.1, 1.0, (2, frequency.size))
    components = Components(frequency, amplitude, phase, True, period)
    table = build_table(components, (-5.0, 35.0))
    arrays = single_table(table, True, 0.0)
    speeds = np.array([0.0, 3.0, 40.0, 140.0, 290.0])
    decays = np.array([0.99, 0.9, 0.95, 0.8, 0.97])
    low, high, size = np.zeros((3, speeds.size))
    per_mm = table.n_points / table.length
    _table_reach(
        arrays.points,
        arrays.whole[0],
        speeds / RATE_HZ * per_mm,
        speeds,
        arrays.real[0, 10],
        decays,
        period is not None,
        low,
        high,
        size,
    )
    x = table.origin + np.linspace(0.0, table.length, 40_001)
    for s, (speed, decay) in enumerate(zip(speeds, decays, strict=True)):
        if np.any(frequency * speed > 0.9 * BAND_EDGE_HZ):
            continue  # rows in between fade

        def friction(at: np.ndarray) -> np.ndarray:
            waves = np.cos(2.0 * np.pi * np.outer(frequency, at) + phase[:, None])
            total: np.ndarray = amplitude @ waves
            return total

        here = friction(x)
        drives = [
            (friction(x + way * speed / RATE_HZ) - decay * here) / (1.0 - decay)
            for way in (-1.0, 1.0)
        ]
        most = np.abs(here).max()
        # The seam of a table without a period is beside the screen, and left out.
        # Looked up twice per point, the largest value is missed by no more than the curvature
        # (Bernstein: at most (2 pi f)² times that value) times the spacing squared, over 8.
        turns = 2.0 * np.pi * frequency.max() * table.length
        missed = 0.5 * (turns / (4.0 * table.n_points)) ** 2
        tolerance = missed * most if period is not None else 0.02 * most
        assert low[s] == pytest.approx(min(0.0, np.min(drives)), abs=tolerance / (1.0 - decay))
        assert high[s] == pytest.approx(np.max(drives), abs=tolerance / (1.0 - decay))
        assert size[s] == pytest.approx(most, abs=tolerance)


def test_an_oblique_stroke_fits_where_the_cutoff_falls_with_the_speed() -> None:
    """The cutoff follows the whole speed, a texture only what of it is along its direction."""
    falling = FrictionLaw(0.39, 900.0, -5.0, (20.0, 100.0))
    lines = Spectrum(components=[Component(amplitude_n=1.0, cycles_per_mm=50.0)])
    scene = compile_scene(Scene(regions=[Region(texture=lines)]), falling, Screen(), RATE_HZ)
    renderer = Renderer(falling, Screen(), RATE_HZ, 100, scene)
    vx, vy = 20.0, 98.0  # 1000 Hz, at a cutoff of 400 Hz
    clipped = 0
    for block in range(40):
        t = block * 100 / RATE_HZ
        motion = BlockMotion(5.0 + vx * t, 5.0 + vy * t, vx, vy, vx, vy, 100.0, 100.0)
        rendered = renderer.render(block * 100, PredictedMotion(motion), allow=True)
        clipped += rendered.clipped_samples
    assert scene.applied.scaled
    assert clipped == 0
    assert float(np.ptp(rendered.drive)) == pytest.approx(0.868, abs=0.01)


@pytest.mark.parametrize("cycles_per_mm", [1e-3, 5e-3, 0.0125])
@pytest.mark.parametrize("crest_mm", [2.0, 68.0])
def test_a_texture_longer_than_the_screen_fits_all_over_it(
    cycles_per_mm: float, crest_mm: float
) -> None:
    """The jump at the end of its table lay on the screen: it was rendered, and left out."""
    phase_rad = -2.0 * np.pi * cycles_per_mm * crest_mm
    line = Component(amplitude_n=1.0, cycles_per_mm=cycles_per_mm, phase_rad=phase_rad)
    region = Region(texture=Spectrum(components=[line]))
    law = FrictionLaw()
    scene = compile_scene(Scene(regions=[region]), law, Screen(), RATE_HZ)
    renderer = Renderer(law, Screen(), RATE_HZ, 100, scene)
    speed = 100.0
    clipped, targets = 0, []
    for block in range(136):  # 68 mm
        x_mm = 1.0 + speed * block * 100 / RATE_HZ
        motion = BlockMotion(x_mm, 10.0, speed, 0.0, speed, 0.0, speed, speed)
        rendered = renderer.render(block * 100, PredictedMotion(motion), allow=True)
        clipped += rendered.clipped_samples
        targets.append(rendered.target_n.copy())
    assert clipped == 0
    at_mm = 1.0 + speed * np.arange(13_600) / RATE_HZ
    wanted = np.cos(2.0 * np.pi * cycles_per_mm * (at_mm - crest_mm))
    felt = (np.concatenate(targets) - scene.applied.bias_n) / scene.applied.gain
    np.testing.assert_allclose(felt, wanted, atol=1e-4)


def test_a_recording_is_compiled_in_a_few_times_one_fourier_transform(
    rng: np.random.Generator,
) -> None:
    count, rate_hz, speed_mm_s = 65_536, 44_100.0, 80.0
    hz = np.fft.rfftfreq(count, 1.0 / rate_hz)
    noise = np.fft.rfft(rng.normal(size=count)) / (1.0 + np.square(hz / 300.0))
    friction = np.fft.irfft(noise)
    texture = Profile(
        friction_n=(0.1 * friction / np.abs(friction).max()).tolist(),
        period_mm=speed_mm_s * count / rate_hz,
    )
    scene = Scene(regions=[Region(texture=texture)])
    law = inverse_of_model(placeholder_model(), Screen())
    long = rng.normal(size=2**20)

    def taken_s(what: str) -> float:
        began_s = time.thread_time()
        if what == "scene":
            compile_scene(scene, law, Screen(), RATE_HZ)
        else:
            np.fft.rfft(long)
        return time.thread_time() - began_s

    taken_s("scene")  # compiled
    scene_s, transform_s = (min(taken_s(w) for _ in range(5)) for w in ("scene", "transform"))
    assert scene_s < 12.0 * transform_s

"""Streams: one bias and gain for all updates, and none of them clips."""

import numpy as np
import pytest

from frictus.errors import TextureError
from frictus.stream import StreamFrame
from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.friction import FrictionLaw
from frictus_hardware.physics.screen import Screen
from frictus_service.synthesis.estimator import PredictedMotion
from frictus_service.synthesis.kernel import BlockMotion
from frictus_service.synthesis.renderer import Renderer
from frictus_service.synthesis.scene import CompiledScene, StreamBudget

RATE = 20_000.0
BLOCK = 100
LAW = FrictionLaw()
SCREEN = Screen()


def frame(
    friction_n: FloatArray, period: float = 20.0, spatial: bool = True, angle_deg: float = 0.0
) -> StreamFrame:
    return StreamFrame(
        1, 0, 0, 1_000, period, spatial, angle_deg, friction_n.astype(np.float32)
    )


def random_update(rng: np.random.Generator, budget: StreamBudget) -> CompiledScene:
    """An update as strong as the budget allows at every band limit."""
    spatial = bool(rng.random() < 0.7)
    period = float(rng.uniform(2.0, 60.0) if spatial else rng.uniform(0.02, 1.0))
    n_samples = int(rng.integers(2, 2_000))
    kind = rng.integers(0, 3)
    if kind == 0:
        friction = rng.standard_normal(n_samples)
    elif kind == 1:
        friction = np.sign(rng.standard_normal(n_samples)) + 0.0
        friction[0] = -friction[-1]
    else:
        cycles = int(rng.integers(1, max(n_samples // 2, 2)))
        friction = np.cos(2.0 * np.pi * cycles * np.arange(n_samples) / n_samples + 0.3)
    friction *= budget.peak_n / np.abs(friction - friction.mean()).max()
    angle = float(rng.uniform(-180.0, 180.0))
    while True:
        try:
            return budget.compile(frame(friction, period, spatial, angle))
        except TextureError as error:
            if "the stream declared" not in str(error):
                return budget.quiet  # finer than a table holds, or than a finger feels
            friction *= 0.9


@pytest.mark.parametrize("peak_n", [0.005, 0.05, 0.4])
@pytest.mark.parametrize("factor", [0.5, 1.0, 2.0])
def test_updates_within_the_peak_never_clip_at_any_speed(
    rng: np.random.Generator, peak_n: float, factor: float
) -> None:
    law = FrictionLaw(LAW.gain_n, factor * LAW.cutoff_0_hz, factor * LAW.slope_hz_per_mm_s)
    budget = StreamBudget.open(peak_n, law)
    renderer = Renderer(law, SCREEN, RATE, BLOCK, budget.quiet)
    first = int(rng.integers(0, 10**8))
    for _ in range(12):
        renderer.set_scene(random_update(rng, budget))
        for _ in range(6):  # the fade takes one block
            speed = float(rng.uniform(0.0, (300.0, 20.0)[int(rng.random() < 0.3)]))
            x, y = rng.uniform(0.0, 70.0), rng.uniform(0.0, 35.0)
            angle = rng.uniform(0.0, 2.0 * np.pi)
            vx, vy = speed * np.cos(angle), speed * np.sin(angle)
            motion = BlockMotion(x, y, vx, vy, vx, vy, speed, speed)
            rendered = renderer.render(first, PredictedMotion(motion), allow=True)
            assert rendered.clipped_samples == 0
            first += BLOCK


def test_gain_and_bias_are_the_same_for_all_updates(rng: np.random.Generator) -> None:
    budget = StreamBudget.open(0.1, LAW)
    for _ in range(10):
        update = random_update(rng, budget)
        assert update.applied == budget.applied
        assert update.arrays.bias_n == budget.quiet.arrays.bias_n
        assert update.source == "stream"
    assert budget.applied.scaled
    assert budget.applied.bias == pytest.approx(0.5, abs=1e-9)
    weak = StreamBudget.open(0.001, LAW).applied
    assert weak.gain == 1.0
    assert not weak.scaled


def test_before_the_first_update_only_the_bias_is_felt() -> None:
    budget = StreamBudget.open(0.1, LAW)
    renderer = Renderer(LAW, SCREEN, RATE, BLOCK, budget.quiet)
    course = PredictedMotion(BlockMotion(10.0, 10.0, 60.0, 0.0, 60.0, 0.0, 60.0, 60.0))
    rendered = renderer.render(0, course, allow=True)
    np.testing.assert_allclose(rendered.target_n, budget.applied.bias_n, atol=1e-9)


def test_a_sinusoid_is_felt_with_its_amplitude_and_without_its_mean() -> None:
    budget = StreamBudget.open(0.1, LAW)
    wave = 3.0 + 0.1 * np.cos(2.0 * np.pi * np.arange(64) / 64)
    renderer = Renderer(LAW, SCREEN, RATE, 2_000, budget.compile(frame(wave, 2.0)))
    course = PredictedMotion(BlockMotion(10.0, 10.0, 60.0, 0.0, 60.0, 0.0, 60.0, 60.0))
    rendered = renderer.render(0, course, allow=True)
    x = 10.0 + 60.0 * np.arange(2_000) / RATE
    want = budget.applied.gain * 0.1 * np.cos(np.pi * x)
    np.testing.assert_allclose(
        rendered.target_n - budget.applied.bias_n, want, atol=1e-3 * budget.applied.gain * 0.1
    )


def test_an_update_beyond_the_declared_peak_is_refused_with_both_numbers() -> None:
    budget = StreamBudget.open(0.05, LAW)
    wave = np.cos(2.0 * np.pi * np.arange(64) / 64)
    budget.compile(frame(0.05 * wave))
    with pytest.raises(
        TextureError,
        match=r"friction reaches 0\.06 N between its samples, the stream declared 0\.05 N; "
        "open it with a larger peak",
    ):
        budget.compile(frame(0.06 * wave))


def test_what_a_wave_reaches_between_its_samples_counts() -> None:
    budget = StreamBudget.open(0.05, LAW)
    # cos(2 pi 8 n / 32 + pi / 4): the samples lie at 0.71 of its peak.
    wave = np.cos(2.0 * np.pi * 8 * np.arange(32) / 32 + np.pi / 4.0)
    assert np.abs(wave).max() == pytest.approx(np.sqrt(0.5))
    with pytest.raises(TextureError, match=r"reaches 0\.06\d* N"):
        budget.compile(frame(0.06 * wave))
    budget.compile(frame(0.0495 * wave))


def test_an_update_that_only_its_mean_brings_beyond_the_peak_is_told_so() -> None:
    budget = StreamBudget.open(0.05, LAW)
    pulse = np.where(np.arange(64) < 8, 0.05, -0.05)  # 0.0875 N about its mean
    with pytest.raises(TextureError, match=r"reaches 0\.\d+ N less its mean, the stream decl"):
        budget.compile(frame(pulse))


def test_a_mean_costs_nothing_and_constant_friction_is_silence() -> None:
    budget = StreamBudget.open(0.05, LAW)
    wave = np.cos(2.0 * np.pi * np.arange(64) / 64)
    budget.compile(frame(5.0 + 0.0499 * wave))
    for level in (0.0, 0.3, -10.0):
        assert budget.compile(frame(np.full(64, level))) is budget.quiet


def test_an_update_that_cannot_be_felt_is_refused() -> None:
    budget = StreamBudget.open(0.05, LAW)
    wave = 0.04 * np.cos(np.pi * np.arange(16))
    with pytest.raises(TextureError, match="none is felt"):
        budget.compile(frame(wave, 0.005, spatial=False))

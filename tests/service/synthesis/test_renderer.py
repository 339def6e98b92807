"""The renderer's state: fades between scenes, the envelope, and when the law may change."""

from itertools import pairwise, permutations

import numpy as np
import pytest

from frictus.stream import StreamFrame
from frictus.textures import Component, Region, Scene, Spectrum
from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.friction import FrictionLaw, cutoff_hz
from frictus_hardware.physics.screen import Screen
from frictus_service.synthesis import kernel
from frictus_service.synthesis.estimator import PredictedMotion
from frictus_service.synthesis.kernel import BlockMotion
from frictus_service.synthesis.renderer import Rendered, Renderer
from frictus_service.synthesis.scene import CompiledScene, StreamBudget, compile_scene

pytestmark = pytest.mark.compiled


RATE = 20_000.0
BLOCK = 100
LAW = FrictionLaw()
SCREEN = Screen()


def grating(amplitude_n: float, cycles_per_mm: float) -> CompiledScene:
    texture = Spectrum(
        components=[Component(amplitude_n=amplitude_n, cycles_per_mm=cycles_per_mm)]
    )
    scene = Scene(regions=[Region(texture=texture)])
    return compile_scene(scene, LAW, SCREEN, RATE)


SMOOTH = compile_scene(Scene(), LAW, SCREEN, RATE)
WEAK, STRONG, FINE = grating(0.001, 0.5), grating(10.0, 0.5), grating(10.0, 15.0)


class Stroke:
    """Renders block after block along one stroke at a steady speed."""

    def __init__(self, scene: CompiledScene, speed: float = 60.0, block: int = BLOCK) -> None:
        self.renderer = Renderer(LAW, SCREEN, RATE, block, scene)
        self.block = block
        self.speed = speed
        self.sample = 0

    def go(self, allow: bool = True) -> Rendered:
        x, v = 5.0 + self.speed * self.sample / RATE, self.speed
        motion = BlockMotion(x, 17.0, v, 0.0, v, 0.0, v, v)
        rendered = self.renderer.render(self.sample, PredictedMotion(motion), allow)
        self.sample += self.block
        return rendered

    def target(self, n_blocks: int) -> FloatArray:
        return np.concatenate([self.go().target_n.copy() for _ in range(n_blocks)])


def blocks_until(scene: CompiledScene, stroke: Stroke) -> int:
    """Blocks until nothing but a scene is felt."""
    for number in range(20):
        alone = Stroke(scene, stroke.speed, stroke.block)
        alone.sample = stroke.sample
        if np.array_equal(stroke.go().target_n, alone.go().target_n):
            return number
    raise AssertionError("the fade does not end")


@pytest.mark.parametrize("speed", [20.0, 60.0, 75.0, 200.0])
@pytest.mark.parametrize(("before", "after"), list(permutations([WEAK, STRONG, FINE], 2)))
def test_a_cross_fade_neither_clips_nor_jumps(
    rng: np.random.Generator, before: CompiledScene, after: CompiledScene, speed: float
) -> None:
    stroke = Stroke(before, speed)
    stroke.sample = int(rng.integers(0, 10_000))
    stroke.target(6)
    stroke.renderer.set_scene(after)
    x, parts = stroke.sample, []
    for _ in range(8):
        rendered = stroke.go()
        assert rendered.clipped_samples == 0
        parts.append(rendered.target_n.copy())
    target = np.concatenate(parts)
    alone = []
    for scene in (before, after):
        single = Stroke(scene, speed)
        single.sample = x
        alone.append(single.target(8))
    d = np.clip(np.arange(target.size) / 400.0, 0.0, 1.0)
    share = d * d * (3.0 - 2.0 * d)
    np.testing.assert_allclose(target, (1.0 - share) * alone[0] + share * alone[1], atol=1e-9)
    own = max(float(np.abs(np.diff(part)).max()) for part in alone)
    apart = float(np.abs(alone[0] - alone[1]).max())
    assert np.abs(np.diff(target)).max() <= own + 1.5 / 400.0 * apart + 1e-12


def test_fading_to_a_smooth_screen_asks_for_nothing_that_could_be_felt() -> None:
    """Friction dies away no faster than its cutoff, and so lags at the very end of a fade."""
    stroke = Stroke(STRONG, 20.0)
    stroke.target(6)
    stroke.renderer.set_scene(SMOOTH)
    target = stroke.target(8)
    decay = np.exp(-2.0 * np.pi * float(cutoff_hz(LAW, 20.0)) / RATE)
    asked = (target[1:] - decay * target[:-1]) / ((1.0 - decay) * LAW.gain_n)
    assert asked.min() > -1e-3
    assert target[-1] == 0.0


@pytest.mark.parametrize(("block", "most"), [(100, 4), (64, 7), (400, 1)])
def test_a_scene_fades_for_20_ms(block: int, most: int) -> None:
    stroke = Stroke(STRONG, block=block)
    stroke.target(3)
    stroke.renderer.set_scene(FINE)
    assert blocks_until(FINE, stroke) == most


def stream_updates() -> tuple[CompiledScene, CompiledScene]:
    budget = StreamBudget.open(0.1, LAW)
    wave = np.arange(200) / 200 * 2.0 * np.pi
    first, second = (
        budget.compile(StreamFrame(1, 0, 0, 1, 4.0, True, 0.0, (0.08 * f).astype(np.float32)))
        for f in (np.cos(wave), np.sin(3 * wave))
    )
    return first, second


def test_an_update_of_a_stream_fades_for_5_ms_and_a_new_stream_for_20() -> None:
    first, second = stream_updates()
    stroke = Stroke(first)
    stroke.target(3)
    stroke.renderer.set_scene(second)
    assert blocks_until(second, stroke) == 1
    stroke.renderer.set_scene(STRONG)
    assert blocks_until(STRONG, stroke) == 4
    stroke.renderer.set_scene(first)
    assert blocks_until(first, stroke) == 4


def test_of_scenes_that_wait_the_newest_wins(rng: np.random.Generator) -> None:
    stroke = Stroke(SMOOTH)
    renderer = stroke.renderer
    assert renderer.scene is SMOOTH
    renderer.set_scene(STRONG)
    assert renderer.scene is STRONG
    parts = [stroke.go()]
    for scene in (SMOOTH, WEAK, FINE):
        renderer.set_scene(scene)
        assert renderer.scene is scene
    jumps = []
    last = float(parts[0].target_n[-1])
    for _ in range(12):
        target = stroke.go().target_n
        jumps.append(np.abs(np.diff(np.concatenate([[last], target]))).max())
        last = float(target[-1])
    assert blocks_until(FINE, stroke) == 0
    # Fine, at 60 mm/s, turns by 2 pi 900 / 20000 a sample; nothing is quicker than that.
    swing = float(np.ptp(Stroke(FINE).target(8)))
    assert (
        max(jumps) < 2.0 * np.pi * 900.0 / RATE * swing / 2.0 * 1.2 + 1.5 / 400.0 * LAW.gain_n
    )


def test_output_comes_and_goes_within_20_ms() -> None:
    stroke = Stroke(STRONG)
    levels = [stroke.go().level for _ in range(6)]
    np.testing.assert_allclose(levels, [0.25, 0.5, 0.75, 1.0, 1.0, 1.0], rtol=1e-6)
    levels = [stroke.go(allow=False).level for _ in range(5)]
    np.testing.assert_allclose(levels, [0.75, 0.5, 0.25, 0.0, 0.0], atol=1e-6)
    assert levels[3] == 0.0
    assert not np.any(stroke.go(allow=False).voltage_v)


def test_nothing_is_rendered_while_there_is_no_output(monkeypatch: pytest.MonkeyPatch) -> None:
    stroke = Stroke(STRONG)
    stroke.target(6)
    while stroke.go(allow=False).level > 0.0:
        pass
    for name in ("target_friction", "invert", "envelope", "modulate"):
        monkeypatch.delattr(kernel, name)
    for _ in range(3):
        quiet = stroke.go(allow=False)
        assert quiet.level == 0.0
        assert not np.any(quiet.voltage_v)
        assert not np.any(quiet.drive)
    with pytest.raises(AttributeError):
        stroke.go()


@pytest.mark.parametrize("quiet_blocks", [1, 3, 4, 9])
def test_a_scene_that_comes_while_there_is_no_output_fades_in_all_the_same(
    quiet_blocks: int,
) -> None:
    quiet, heard = Stroke(STRONG), Stroke(STRONG)
    for stroke in (quiet, heard):
        stroke.renderer.set_scene(WEAK)
        stroke.renderer.set_scene(FINE)
    for _ in range(quiet_blocks):
        quiet.go(allow=False)
        heard.go()
    for _ in range(6):
        np.testing.assert_array_equal(quiet.go().target_n, heard.go().target_n)
    assert quiet.renderer.scene is FINE


def test_output_begins_with_what_belongs_to_its_sample() -> None:
    before, anew = Stroke(STRONG), Stroke(STRONG)
    before.target(5)
    while before.go(allow=False).level > 0.0:
        pass
    for _ in range(7):
        before.go(allow=False)
    anew.sample = before.sample
    for _ in range(6):
        np.testing.assert_array_equal(before.go().voltage_v, anew.go().voltage_v)


def test_nothing_is_counted_while_there_is_no_output() -> None:
    stroke = Stroke(STRONG, speed=10.0)  # below the law's range
    quiet = stroke.go(allow=False)
    assert (quiet.clipped_samples, quiet.extrapolated_samples) == (0, 0)
    assert stroke.go().extrapolated_samples == BLOCK


def test_blocks_follow_one_another_without_a_jump_when_a_motion_is_left() -> None:
    stroke = Stroke(STRONG)
    stroke.target(5)
    x, v = 5.0 + 60.0 * stroke.sample / RATE, 60.0
    left = BlockMotion(x, 17.0, v, 0.0, v, 0.0, v, v)
    moved = left._replace(x_mm=x + 0.7)
    rest = moved._replace(x_mm=x + 0.7 + v * BLOCK / RATE)
    before = stroke.renderer.render(
        stroke.sample - BLOCK, PredictedMotion(left._replace(x_mm=x - 0.3)), True
    )
    parts = [before.target_n.copy()]
    for number, course in enumerate((PredictedMotion(moved, left), PredictedMotion(rest))):
        rendered = stroke.renderer.render(stroke.sample + number * BLOCK, course, allow=True)
        parts.append(rendered.target_n.copy())
    inside = max(float(np.abs(np.diff(part)).max()) for part in parts)
    for ended, begun in pairwise(parts):
        assert abs(begun[0] - ended[-1]) <= 1.2 * inside

"""A model that changes while it is felt: one cross-fade, exact at both ends, never a step."""

from collections.abc import Callable

import numpy as np
import pytest

from frictus.messages import Excitation, Tone
from frictus.model import Compensation
from frictus.stream import StreamFrame
from frictus.textures import Component, Region, Scene, Spectrum
from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.friction import FrictionLaw
from frictus_hardware.physics.screen import Screen
from frictus_service.synthesis.compensability import inverse_of
from frictus_service.synthesis.compensation import Inverse, inverse_in_mode
from frictus_service.synthesis.estimator import PredictedMotion
from frictus_service.synthesis.kernel import BlockMotion
from frictus_service.synthesis.renderer import FADE_S, Playable, Rendered, Renderer
from frictus_service.synthesis.scene import StreamBudget, compile_excitation, compile_scene

pytestmark = pytest.mark.compiled

RATE = 20_000.0
BLOCK = 100
FADE = round(FADE_S * RATE)
SCREEN = Screen()
EFFECTS = [
    ("fractional_rolloff", {"excess_order": 0.1}),
    ("charge_leakage", {"corner_hz": 1.0}),
]
BEFORE, AFTER = FrictionLaw(), FrictionLaw(0.6, 250.0, 8.0)
PAIRS = {
    "laws": (Inverse(BEFORE), Inverse(AFTER)),
    "effects": (inverse_of(BEFORE, EFFECTS), inverse_of(AFTER, EFFECTS)),
}
SMOOTHNESS = 1.5 / FADE
"""Largest slope of a fade, per sample."""


def tones(*hz: float, amplitude_n: float = 5.0) -> Scene:
    components = [Component(amplitude_n=amplitude_n, hz=f) for f in hz]
    return Scene(regions=[Region(texture=Spectrum(components=components))])


TEXTURE, OTHER = tones(90.0, 310.0, 770.0), tones(150.0, 500.0)


def compiled(scene: Scene, inverse: Inverse) -> Playable:
    return compile_scene(scene, inverse, SCREEN, RATE)


class Stroke:
    """Renders block after block of one stroke at a steady speed."""

    def __init__(self, inverse: Inverse, scene: Playable, speed: float = 40.0) -> None:
        self.renderer = Renderer(inverse, SCREEN, RATE, BLOCK, scene)
        self.speed = speed
        self.sample = 0
        self.target = np.zeros(0)

    def go(self, allow: bool = True) -> Rendered:
        x, v = 5.0 + self.speed * self.sample / RATE, self.speed
        motion = BlockMotion(x, 17.0, v, 0.0, v, 0.0, v, v)
        rendered = self.renderer.render(self.sample, PredictedMotion(motion), allow)
        self.sample += BLOCK
        return rendered

    def drive(self, n_blocks: int) -> FloatArray:
        """What is played; the target beside it is kept."""
        parts = [
            (rendered.drive.copy(), rendered.target_n.copy())
            for rendered in (self.go() for _ in range(n_blocks))
        ]
        self.target = np.concatenate([target for _, target in parts])
        return np.concatenate([drive for drive, _ in parts])


def assert_no_step(found: FloatArray, *alone: FloatArray) -> None:
    """No step beyond the larger of the signals' own and what the fade's slope adds."""
    own = max(float(np.abs(np.diff(part)).max()) for part in alone)
    apart = max(float(np.ptp(part)) for part in (np.stack(alone).T))
    assert np.abs(np.diff(found)).max() <= own + SMOOTHNESS * apart + 1e-9
    assert found.min() >= 0.0
    assert found.max() <= 1.0


def faded(one: FloatArray, other: FloatArray) -> FloatArray:
    share = np.clip(np.arange(one.size) / FADE, 0.0, 1.0)
    return one + share * share * (3.0 - 2.0 * share) * (other - one)


@pytest.mark.parametrize("pair", PAIRS.values(), ids=PAIRS)
@pytest.mark.parametrize("texture", [TEXTURE, OTHER, Scene()], ids=["three", "two", "none"])
def test_a_model_and_its_scene_fade_in_together(
    rng: np.random.Generator, pair: tuple[Inverse, Inverse], texture: Scene
) -> None:
    before, after = pair
    speed = float(rng.uniform(20.0, 100.0))
    changing, old, new = (
        Stroke(inverse, compiled(texture, inverse), speed)
        for inverse in (before, before, after)
    )
    for stroke in (changing, old, new):
        stroke.drive(20)
    changing.renderer.set_model(after, compiled(texture, after), 0.0)
    assert changing.renderer.inverse is after
    found, one, other = (stroke.drive(80) for stroke in (changing, old, new))
    assert found[0] == one[0], "it begins where it was"
    np.testing.assert_allclose(changing.target, faded(old.target, new.target), atol=1e-12)
    if before.plain:
        np.testing.assert_allclose(found, faded(one, other), atol=1e-12)
        np.testing.assert_array_equal(found[FADE:], other[FADE:])
    else:  # what its filters hold has been forgotten by then
        np.testing.assert_allclose(found[-BLOCK:], other[-BLOCK:], atol=1e-3)
    assert_no_step(found[: 2 * FADE], one[: 2 * FADE], other[: 2 * FADE])


def test_a_fade_that_is_under_way_ends_first() -> None:
    before, after = PAIRS["laws"]
    first, second = compiled(TEXTURE, before), compiled(OTHER, before)
    stroke = Stroke(before, first)
    alone = [
        Stroke(before, first),
        Stroke(before, second),
        Stroke(after, compiled(OTHER, after)),
    ]
    for each in (stroke, *alone):
        each.drive(6)
    stroke.renderer.set_scene(second)
    found = [stroke.drive(1)]
    stroke.renderer.set_model(after, compiled(OTHER, after), 0.0)
    found.append(stroke.drive(11))
    one, other, last = (each.drive(12) for each in alone)
    np.testing.assert_allclose(
        np.concatenate(found)[FADE:], faded(other[FADE:], last[FADE:]), atol=1e-12
    )
    assert_no_step(np.concatenate(found), one, other, last)


def test_of_what_comes_during_a_fade_the_newest_scene_and_inverse_stay() -> None:
    before, after = PAIRS["laws"]
    stroke = Stroke(before, compiled(TEXTURE, before))
    stroke.drive(6)
    scene = compiled(OTHER, after)
    changes: list[Callable[[], None]] = [
        lambda: stroke.renderer.set_scene(compiled(OTHER, before)),
        lambda: stroke.renderer.set_model(after, compiled(TEXTURE, after), 0.0),
        lambda: stroke.renderer.set_inverse(inverse_in_mode(after, Compensation(mode="none"))),
        lambda: stroke.renderer.set_inverse(after),
        lambda: stroke.renderer.set_scene(scene),
    ]
    for change in changes:
        change()
        stroke.go()
    assert (stroke.renderer.inverse, stroke.renderer.scene) == (after, scene)
    stroke.drive(3 * FADE // BLOCK)
    alone = Stroke(after, scene)
    alone.sample = stroke.sample - 6 * BLOCK
    alone.drive(6)
    np.testing.assert_array_equal(stroke.drive(3), alone.drive(3))


def test_a_stream_goes_on_under_another_model() -> None:
    before, after = PAIRS["laws"]
    wave = 0.08 * np.sin(2.0 * np.pi * np.arange(200) / 200.0)
    frame = StreamFrame(1, 0, 0, 1, 4.0, True, 0.0, wave.astype(np.float32))
    budgets = [StreamBudget.open(0.1, inverse) for inverse in (before, after)]
    old, new = (budget.compile(frame) for budget in budgets)
    changing, one, other = Stroke(before, old), Stroke(before, old), Stroke(after, new)
    for stroke in (changing, one, other):
        stroke.drive(6)
    changing.renderer.set_model(after, new, 0.0)
    found, left, right = (stroke.drive(8) for stroke in (changing, one, other))
    np.testing.assert_allclose(found, faded(left, right), atol=1e-12)
    changing.renderer.set_scene(budgets[1].quiet)
    other.renderer.set_scene(budgets[1].quiet)
    np.testing.assert_array_equal(changing.drive(2), other.drive(2))
    quiet = Stroke(after, budgets[1].quiet)
    quiet.sample = other.sample - 6 * BLOCK
    quiet.drive(6)
    np.testing.assert_array_equal(changing.drive(1), quiet.drive(1))


@pytest.mark.parametrize("pair", PAIRS.values(), ids=PAIRS)
def test_a_block_that_was_not_played_is_faded_again(pair: tuple[Inverse, Inverse]) -> None:
    before, after = pair
    strokes = [Stroke(before, compiled(TEXTURE, before)) for _ in range(2)]
    for stroke in strokes:
        stroke.drive(6)
        stroke.renderer.set_model(after, compiled(TEXTURE, after), 0.0)
    refused = strokes[0]
    for _ in range(3):
        refused.go()
        refused.renderer.take_back()
        refused.sample -= BLOCK
    found, wanted = (stroke.drive(8) for stroke in strokes)
    if before.plain:
        np.testing.assert_array_equal(found, wanted)
    # Filters settle anew, as wherever a block is missing.
    np.testing.assert_array_equal(refused.target, strokes[1].target)
    assert refused.renderer.inverse is after


def test_an_excitation_gives_way_to_a_model_without_a_step() -> None:
    before, after = PAIRS["laws"]
    excited = compile_excitation(
        Excitation(tones=[Tone(hz=100.0, amplitude=0.4)]), before.law, RATE
    )
    scene = compiled(TEXTURE, after)
    changing, one, other = (
        Stroke(before, excited),
        Stroke(before, excited),
        Stroke(after, scene),
    )
    for stroke in (changing, one, other):
        stroke.drive(6)
    changing.renderer.set_model(after, scene, 0.0)
    found, left, right = (stroke.drive(8) for stroke in (changing, one, other))
    np.testing.assert_allclose(found, faded(left, right), atol=1e-12)
    assert np.all(np.isnan(changing.target[:FADE])), "an excitation has no target"
    np.testing.assert_array_equal(changing.target[FADE:], other.target[FADE:])


def test_without_output_the_model_is_there_after_the_same_time() -> None:
    before, after = PAIRS["laws"]
    scene = compiled(TEXTURE, after)
    stroke, alone = Stroke(before, compiled(TEXTURE, before)), Stroke(after, scene)
    stroke.renderer.set_model(after, scene, 0.0)
    for each in (stroke, alone):
        for _ in range(FADE // BLOCK):
            each.go(allow=False)
    np.testing.assert_array_equal(stroke.drive(4), alone.drive(4))


def test_extrapolated_samples_are_counted_once() -> None:
    before, after = PAIRS["laws"]
    stroke = Stroke(before, compiled(TEXTURE, before), speed=10.0)  # below both ranges
    stroke.drive(6)
    stroke.renderer.set_model(after, compiled(TEXTURE, after), 0.0)
    assert [stroke.go().extrapolated_samples for _ in range(6)] == 6 * [BLOCK]

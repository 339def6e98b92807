"""Compensation modes: what is inverted in each, and that a switch is never a step."""

import numpy as np
import pytest

from frictus.errors import ArgumentError
from frictus.messages import Excitation, Tone
from frictus.model import BY_MODEL, Compensation
from frictus.textures import Component, Region, Scene, Spectrum
from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.friction import FrictionLaw
from frictus_hardware.physics.schedule import SlidingConditions
from frictus_hardware.physics.screen import Screen
from frictus_service.synthesis.compensability import inverse_of
from frictus_service.synthesis.compensation import (
    Inverse,
    fixed_at,
    inverse_in_mode,
    uncompensated,
)
from frictus_service.synthesis.estimator import PredictedMotion
from frictus_service.synthesis.kernel import BlockMotion
from frictus_service.synthesis.renderer import FADE_S, Rendered, Renderer
from frictus_service.synthesis.scene import compile_excitation, compile_scene

pytestmark = pytest.mark.compiled

RATE = 20_000.0
BLOCK = 100
FADE = round(FADE_S * RATE)
LAW = FrictionLaw()
SCREEN = Screen()
FIXED = Compensation(mode="fixed", speed_mm_s=60.0)
NONE = Compensation(mode="none")
MODES = (BY_MODEL, FIXED, NONE)
EFFECTS = inverse_of(
    LAW,
    [
        ("speed_dependent_gain", {"exponent": 0.2}),
        ("force_dependent_cutoff", {"exponent": 0.2}),
        ("fractional_rolloff", {"excess_order": 0.1}),
        ("charge_leakage", {"corner_hz": 1.0}),
    ],
)
GRATING = Scene(
    regions=[
        Region(
            texture=Spectrum(
                components=[Component(amplitude_n=5.0, hz=f) for f in (90.0, 310.0, 770.0)]
            )
        )
    ]
)


class Stroke:
    """Renders block after block of one stroke at a steady speed."""

    def __init__(self, inverse: Inverse, speed: float = 25.0) -> None:
        scene = compile_scene(GRATING, inverse, SCREEN, RATE)
        self.renderer = Renderer(inverse, SCREEN, RATE, BLOCK, scene)
        self.inverse = inverse
        self.speed = speed
        self.sample = 0

    def switch(self, mode: Compensation) -> None:
        self.renderer.set_inverse(inverse_in_mode(self.inverse, mode))

    def go(self, allow: bool = True) -> Rendered:
        x, v = 5.0 + self.speed * self.sample / RATE, self.speed
        motion = BlockMotion(x, 17.0, v, 0.0, v, 0.0, v, v)
        rendered = self.renderer.render(self.sample, PredictedMotion(motion), allow)
        self.sample += BLOCK
        return rendered

    def drive(self, n_blocks: int) -> FloatArray:
        return np.concatenate([self.go().drive.copy() for _ in range(n_blocks)])


def test_the_model_is_inverted_as_it_is() -> None:
    assert inverse_in_mode(EFFECTS, BY_MODEL) is EFFECTS


def test_a_law_alone_is_inverted_as_fidelity_is_measured() -> None:
    inverse = Inverse(LAW)
    assert inverse_in_mode(inverse, FIXED).law == fixed_at(LAW, 60.0)
    assert inverse_in_mode(EFFECTS, NONE).law == uncompensated(LAW)
    assert inverse_in_mode(EFFECTS, NONE).plain


def sliding(speed_mm_s: FloatArray, force_n: float) -> SlidingConditions:
    """To the right in the middle of the screen, at the beginning of a session."""
    return SlidingConditions(
        speed_mm_s=speed_mm_s,
        normal_force_n=np.array(force_n),
        position_mm=np.array(35.0),
        direction=np.array(1.0),
        minutes=np.array(0.0),
    )


def test_a_fixed_speed_is_taken_for_the_fingers_and_nothing_else_is_fixed() -> None:
    fixed = inverse_in_mode(EFFECTS, FIXED)
    speeds = np.array([20.0, 35.0, 60.0, 100.0])
    for force_n in (0.2, 0.45):
        at_60 = EFFECTS.along(sliding(np.array(60.0), force_n))
        for found, wanted in zip(fixed.along(sliding(speeds, force_n)), at_60, strict=True):
            np.testing.assert_allclose(found, wanted, rtol=1e-12)
    soft, firm = (fixed.along(sliding(np.array(30.0), force_n)) for force_n in (0.2, 0.45))
    assert soft[1] != firm[1]


@pytest.mark.parametrize("speed", [0.0, 19.9, 100.1, -60.0, np.nan, np.inf, None])
def test_a_speed_for_which_the_model_does_not_hold_is_refused(speed: float | None) -> None:
    asked = Compensation.model_construct(mode="fixed", speed_mm_s=speed)
    with pytest.raises(ArgumentError, match="20 to 100 mm/s: fix a speed within"):
        inverse_in_mode(EFFECTS, asked)


@pytest.mark.parametrize("inverse", [Inverse(LAW), EFFECTS], ids=["law", "effects"])
def test_at_the_fixed_speed_fixed_is_the_model(inverse: Inverse) -> None:
    model, fixed = Stroke(inverse, 60.0), Stroke(inverse, 60.0)
    fixed.switch(FIXED)
    np.testing.assert_allclose(fixed.drive(20)[FADE:], model.drive(20)[FADE:], atol=1e-9)


def test_without_compensation_the_drive_is_the_target_over_the_gain() -> None:
    stroke = Stroke(EFFECTS)
    stroke.drive(6)
    stroke.switch(NONE)
    stroke.drive(FADE // BLOCK)
    rendered = stroke.go()
    later = np.append(rendered.target_n[1:], np.nan)[:-1] / LAW.gain_n
    np.testing.assert_allclose(rendered.drive[:-1], later, atol=1e-9)


@pytest.mark.parametrize("inverse", [Inverse(LAW), EFFECTS], ids=["law", "effects"])
@pytest.mark.parametrize("before", MODES, ids=str)
@pytest.mark.parametrize("after", MODES, ids=str)
def test_a_switch_fades_over_20_ms_and_never_jumps(
    rng: np.random.Generator, inverse: Inverse, before: Compensation, after: Compensation
) -> None:
    speed = float(rng.uniform(20.0, 100.0))
    strokes = [Stroke(inverse, speed) for _ in range(3)]
    for stroke, mode in zip(strokes, (before, before, after), strict=True):
        stroke.switch(mode)
        stroke.drive(20)  # what states hold is forgotten
    strokes[0].switch(after)
    found, one, other = (stroke.drive(12) for stroke in strokes)
    share = np.arange(FADE) / FADE
    share = share * share * (3.0 - 2.0 * share)
    assert found[0] == one[0], "it begins where it was"
    if inverse.plain:
        mixed = one[:FADE] + share * (other[:FADE] - one[:FADE])
        np.testing.assert_allclose(found[:FADE], mixed, atol=1e-12)
        np.testing.assert_array_equal(found[FADE:], other[FADE:])
    own = max(float(np.abs(np.diff(part)).max()) for part in (one, other))
    apart = float(np.abs(one - other).max())
    assert np.abs(np.diff(found)).max() <= 1.1 * (own + 1.5 / FADE * apart) + 1e-9
    assert found.min() >= 0.0
    assert found.max() <= 1.0


def test_of_modes_that_come_before_one_block_the_newest_wins() -> None:
    stroke, alone = Stroke(Inverse(LAW)), Stroke(Inverse(LAW))
    for one in (stroke, alone):
        one.drive(6)
    stroke.switch(FIXED)
    stroke.switch(NONE)
    alone.switch(NONE)
    np.testing.assert_array_equal(stroke.drive(3), alone.drive(3))


def test_a_block_that_was_not_played_is_faded_again() -> None:
    stroke, alone = Stroke(Inverse(LAW)), Stroke(Inverse(LAW))
    for one in (stroke, alone):
        one.drive(6)
        one.switch(NONE)
    stroke.go()
    stroke.renderer.take_back()
    stroke.sample -= BLOCK
    np.testing.assert_array_equal(stroke.drive(3), alone.drive(3))


def test_without_output_the_mode_is_there_at_once() -> None:
    stroke, alone = Stroke(Inverse(LAW)), Stroke(inverse_in_mode(Inverse(LAW), NONE))
    alone.renderer.set_scene(stroke.renderer.scene)
    stroke.switch(NONE)
    for one in (stroke, alone):
        for _ in range(6):
            one.go(allow=False)
    np.testing.assert_array_equal(stroke.drive(3), alone.drive(3))


def test_an_excitation_is_the_same_in_all_modes() -> None:
    asked = Excitation(tones=[Tone(hz=100.0, amplitude=0.5)])
    drives = []
    for mode in MODES:
        stroke = Stroke(EFFECTS)
        stroke.renderer.set_scene(compile_excitation(asked, LAW, RATE))
        stroke.drive(6)
        stroke.switch(mode)
        drives.append(stroke.drive(4))
    for other in drives[1:]:
        np.testing.assert_array_equal(drives[0], other)

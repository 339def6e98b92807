"""Rendering with effects: what is played makes friction follow the target."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from frictus.messages import Excitation, Tone
from frictus.textures import Component, Region, Scene, Spectrum
from frictus_hardware.arrays import FloatArray
from frictus_hardware.base import TouchReport
from frictus_hardware.physics.friction import FrictionLaw
from frictus_hardware.physics.schedule import SlidingConditions
from frictus_hardware.physics.screen import Screen
from frictus_service.synthesis.compensability import inverse_of
from frictus_service.synthesis.compensation import Inverse
from frictus_service.synthesis.estimator import FingerEstimator, PredictedMotion
from frictus_service.synthesis.kernel import BlockMotion
from frictus_service.synthesis.renderer import Renderer
from frictus_service.synthesis.scene import StreamBudget, compile_excitation, compile_scene

RATE = 20_000.0
LAW = FrictionLaw()
SCREEN = Screen()
EVERYTHING = [
    ("speed_dependent_gain", {"exponent": 0.2}),
    ("direction_asymmetry", {"share": 0.05}),
    ("position_dependent_gain", {"per_mm": 0.004}),
    ("gain_drift", {"per_minute": -0.01}),
    ("force_dependent_cutoff", {"exponent": 0.2}),
    ("fractional_rolloff", {"excess_order": 0.1}),
    ("charge_leakage", {"corner_hz": 1.0}),
    ("residual_quadratic", {"share": 0.02}),
]
GRATING = Scene(
    regions=[
        Region(
            texture=Spectrum(
                components=[
                    Component(amplitude_n=5.0, cycles_per_mm=k, phase_rad=k)
                    for k in (0.7, 3.1, 11.0)
                ]
            )
        )
    ]
)


ALL_UNDONE = inverse_of(LAW, EVERYTHING)
ALL_SCENE = compile_scene(GRATING, ALL_UNDONE, SCREEN, RATE)


def played(
    renderer: Renderer, n_samples: int, size: int, speed: float = 60.0, first: int = 0
) -> tuple[FloatArray, FloatArray, int]:
    """Drive, target and clipped samples of a stroke at a steady speed, all ramps over."""
    drives, targets, clipped = [], [], 0
    for at in range(first, first + n_samples, size):
        x = (5.0 if speed > 0.0 else 60.0) + speed * at / RATE
        motion = BlockMotion(x, 17.0, speed, 0.0, speed, 0.0, abs(speed), abs(speed))
        rendered = renderer.render(at, PredictedMotion(motion), allow=True)
        drives.append(rendered.drive.copy())
        targets.append(rendered.target_n.copy())
        clipped += rendered.clipped_samples
    return np.concatenate(drives), np.concatenate(targets), clipped


@pytest.mark.parametrize("speed", [60.0, -60.0])
def test_friction_follows_where_gain_varies(speed: float) -> None:
    effects = [
        ("direction_asymmetry", {"share": 0.2}),
        ("position_dependent_gain", {"per_mm": -0.02}),
        ("gain_drift", {"per_minute": 0.3}),
    ]
    inverse = inverse_of(LAW, effects)
    began = -3.0 * 60.0 * RATE
    scene = compile_scene(GRATING, inverse, SCREEN, RATE)
    renderer = Renderer(inverse, SCREEN, RATE, 100, scene, began)
    drive, target, clipped = played(renderer, 10_000, 100, speed)
    sample = np.arange(10_000, dtype=float)
    x = (5.0 if speed > 0.0 else 60.0) + speed * sample / RATE
    gain_n, cutoff_hz = inverse.along(
        SlidingConditions(
            np.full(10_000, abs(speed), dtype=float),
            np.array(0.4),
            x,
            np.array(np.sign(speed)),
            (sample - began) / (60.0 * RATE),
        )
    )
    assert clipped == 0
    decay = np.exp(-2.0 * np.pi * cutoff_hz / RATE)
    friction = target.copy()
    for n in range(1_000, 9_999):
        friction[n + 1] = decay[n] * friction[n] + (1.0 - decay[n]) * gain_n[n] * drive[n]
    assert np.abs(friction - target)[1_000:].max() < 1e-4 * np.ptp(target)


def test_volts_do_not_depend_on_how_time_is_split() -> None:
    drives = {
        size: played(Renderer(ALL_UNDONE, SCREEN, RATE, size, ALL_SCENE), 8_000, size)[0]
        for size in (50, 100, 400)
    }
    # The gain runs straight through a block of any length; it bends by little.
    for size in (50, 400):
        np.testing.assert_allclose(drives[size], drives[100], atol=2e-4)


@pytest.mark.parametrize("speed", [20.0, 60.0, 100.0, -60.0])
def test_a_scene_fits_the_drive_with_all_effects(speed: float) -> None:
    drive, _, clipped = played(
        Renderer(ALL_UNDONE, SCREEN, RATE, 100, ALL_SCENE), 10_000, 100, speed
    )
    assert clipped == 0
    assert 0.0 < drive[1_000:].min() < drive.max() < 1.0


def test_a_stream_fits_the_drive_too() -> None:
    plain, extended = StreamBudget.open(0.1, LAW), StreamBudget.open(0.1, ALL_UNDONE)
    assert 0.0 < extended.applied.gain < plain.applied.gain


def test_a_plain_inverse_renders_as_its_law_bit_by_bit() -> None:
    scene = compile_scene(GRATING, LAW, SCREEN, RATE)
    by_law, _, _ = played(Renderer(LAW, SCREEN, RATE, 100, scene), 4_000, 100)
    again = compile_scene(GRATING, Inverse(LAW), SCREEN, RATE)
    by_inverse, _, _ = played(Renderer(Inverse(LAW), SCREEN, RATE, 100, again), 4_000, 100)
    np.testing.assert_array_equal(by_law, by_inverse)


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(*[st.floats() | st.floats(-400.0, 400.0)] * 8), max_size=4))
def test_the_output_is_bounded_whatever_the_motion(blocks: list[tuple[float, ...]]) -> None:
    renderer = Renderer(ALL_UNDONE, SCREEN, RATE, 100, ALL_SCENE)
    for number, motion in enumerate(blocks):
        rendered = renderer.render(
            100 * number, PredictedMotion(BlockMotion(*motion)), allow=True
        )
        assert np.all((rendered.drive >= 0.0) & (rendered.drive <= 1.0))  # False for NaN


def test_what_is_not_finite_is_forgotten() -> None:
    renderer = Renderer(ALL_UNDONE, SCREEN, RATE, 100, ALL_SCENE)
    played(renderer, 1_000, 100)
    broken = BlockMotion(np.nan, 17.0, 60.0, 0.0, 60.0, 0.0, 60.0, 60.0)
    assert renderer.render(1_000, PredictedMotion(broken), allow=True).clipped_samples > 0
    drive, _, clipped = played(renderer, 2_000, 100, first=1_100)
    assert clipped == 0
    assert np.all(np.isfinite(drive))
    assert drive.min() > 0.0


def test_after_an_excitation_the_inverse_begins_anew() -> None:
    tone = compile_excitation(Excitation(tones=[Tone(hz=100.0, amplitude=0.5)]), LAW, RATE)
    renderer = Renderer(ALL_UNDONE, SCREEN, RATE, 100, ALL_SCENE)
    played(renderer, 1_000, 100)
    renderer.set_scene(tone)
    played(renderer, 1_000, 100, first=1_000)
    renderer.set_scene(ALL_SCENE)
    drive, _, clipped = played(renderer, 4_000, 100, first=2_000)
    assert clipped == 0
    fresh = Renderer(ALL_UNDONE, SCREEN, RATE, 100, ALL_SCENE)
    alone, _, _ = played(fresh, 4_000, 100, first=2_000)
    np.testing.assert_allclose(drive[1_000:], alone[1_000:], atol=1e-3)


def test_fading_between_scenes_does_not_excite_the_leak() -> None:
    inverse = inverse_of(LAW, [("charge_leakage", {"corner_hz": 2.0})])
    scene = compile_scene(GRATING, inverse, SCREEN, RATE)
    smooth = compile_scene(Scene(), inverse, SCREEN, RATE)
    renderer = Renderer(inverse, SCREEN, RATE, 100, smooth)
    played(renderer, 1_000, 100)
    renderer.set_scene(scene)
    drive, _, clipped = played(renderer, 8_000, 100, first=1_000)
    assert clipped == 0
    assert abs(drive[4_000:].mean() - scene.applied.bias) < 0.03


def test_the_estimator_tells_the_force_of_a_finger_on_the_screen() -> None:
    estimator = FingerEstimator(RATE)
    blocks = 0

    def press(normal_force_n: float) -> None:
        nonlocal blocks
        force = np.zeros((100, 3))
        force[:, 2] = normal_force_n
        estimator.sense(100 * blocks, force, np.zeros((100, 3)))
        blocks += 1

    press(0.1)  # nothing touches
    assert estimator.predict(0, 100).normal_force_n == (0.4, 0.4)
    estimator.observe(TouchReport(0.0, 20.0, 17.0, in_contact=True))
    for bad in (np.nan, 0.0, -1.0, np.inf):
        press(bad)
    assert estimator.predict(100, 100).normal_force_n == (0.4, 0.4)
    press(0.55)
    assert estimator.predict(200, 100).normal_force_n == pytest.approx((0.4, 0.55))
    assert estimator.predict(300, 100).normal_force_n == pytest.approx((0.55, 0.55))

"""The compiled kernels beside themselves as plain Python, over all that may reach them."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.plain import Compared, compared, few, plain
from tests.service.synthesis.strategies import reals, region

from frictus.errors import TextureError
from frictus.messages import Excitation, Tone
from frictus.model import Effect, Model
from frictus.textures import Region, Scene
from frictus_hardware.base import TouchReport
from frictus_hardware.physics.effects import EFFECTS
from frictus_hardware.physics.screen import Screen
from frictus_service.synthesis import (
    compensator,
    drive_range,
    estimator,
    kernel,
    tables,
)
from frictus_service.synthesis.compensability import inverse_of_model, placeholder_model
from frictus_service.synthesis.estimator import FingerEstimator, PredictedMotion
from frictus_service.synthesis.finger_motion import (
    inertial_filter,
    interacting_models,
    nail_acceleration,
    skin_fit,
    touch_filter,
)
from frictus_service.synthesis.kernel import BlockMotion
from frictus_service.synthesis.renderer import Renderer
from frictus_service.synthesis.scene import compile_excitation, compile_scene

pytestmark = pytest.mark.compiled

RATE_HZ, BLOCK = 20_000.0, 20
SCREEN = Screen()
FEW = settings(max_examples=few(5))  # as plain Python takes long
coordinate = reals(-1e3, 1e3)
motion = st.tuples(reals(0.0, 70.0), reals(0.0, 35.0), *[coordinate] * 4)
effect = st.sampled_from(sorted(EFFECTS)).flatmap(
    lambda name: st.builds(
        lambda values: Effect(id=name, parameters=values),
        st.fixed_dictionaries(
            {each.name: reals(each.low, each.high) for each in EFFECTS[name].parameters}
        ),
    )
)
models = st.builds(
    lambda effects: placeholder_model().model_copy(update={"effects": effects}),
    st.lists(effect, max_size=3, unique_by=lambda each: each.id),
)


def called(watched: Mapping[str, Compared]) -> set[str]:
    return {name for name, each in watched.items() if each.calls}


@FEW
@given(region, models, motion, st.integers(0, 2**53))
def test_what_is_rendered(
    region: Region, model: Model, motion: tuple[float, ...], first_sample: int
) -> None:
    try:
        inverse = inverse_of_model(model, SCREEN)
        scene = compile_scene(Scene(regions=[region]), inverse, SCREEN, RATE_HZ)
    except TextureError:
        return
    course = PredictedMotion(BlockMotion._make((*motion, abs(motion[2]), abs(motion[4]))))
    with compared(kernel, compensator) as watched:
        renderer = Renderer(inverse, SCREEN, RATE_HZ, BLOCK, scene)
        for block in range(3):
            renderer.render(first_sample + block * BLOCK, course, True)
    assert "modulate" in called(watched)


@FEW
@given(
    st.lists(
        st.builds(
            lambda hz, phase_rad: Tone(hz=hz, amplitude=0.05, phase_rad=phase_rad),
            reals(0.01, 5e3),
            reals(-1e4, 1e4),
        ),
        max_size=8,
    ),
    st.none() | reals(0.01, 10.0),
    st.integers(0, 2**53),
)
def test_what_is_excited(tones: list[Tone], period_s: float | None, first_sample: int) -> None:
    law = inverse_of_model(placeholder_model(), SCREEN)
    try:
        excitation = Excitation(tones=tones, bias=0.5, period_s=period_s)
        playable = compile_excitation(excitation, law.law, RATE_HZ)
    except (ValueError, TextureError):
        return
    course = PredictedMotion(BlockMotion(5.0, 17.0, 60.0, 0.0, 60.0, 0.0, 60.0, 60.0))
    with compared(kernel, compensator) as watched:
        renderer = Renderer(law, SCREEN, RATE_HZ, BLOCK, playable)
        for block in range(3):
            renderer.render(first_sample + block * BLOCK, course, True)
    assert "modulate" in called(watched)


reports = st.lists(
    st.tuples(reals(1e-3, 1e5), coordinate, coordinate, st.booleans()), min_size=2, max_size=30
)


@FEW
@given(reports)
def test_what_is_estimated(reports: list[tuple[float, float, float, bool]]) -> None:
    fusing, sample = FingerEstimator(RATE_HZ), 0.0
    with compared(estimator, touch_filter) as watched:
        for later, x_mm, y_mm, in_contact in reports:
            sample += later
            fusing.observe(TouchReport(sample, x_mm, y_mm, in_contact))
            fusing.predict(int(sample) + 400, 100)
    assert "_predict" in called(watched)


@pytest.mark.long
@FEW
@given(
    st.lists(
        st.tuples(reals(-1e4, 1e4), reals(-20.0, 20.0), coordinate), min_size=4, max_size=12
    )
)
def test_what_is_fused(blocks: list[tuple[float, float, float]]) -> None:
    fusing = FingerEstimator(RATE_HZ)
    wave = np.sin(np.arange(40))[:, np.newaxis]
    fused = (estimator, skin_fit, inertial_filter, interacting_models, nail_acceleration)
    with compared(*fused) as watched:
        for k, (accel, force, x_mm) in enumerate(blocks):
            fusing.sense(40 * k, (force * wave + 0.4) * np.ones(3), accel * wave * np.ones(3))
            fusing.observe(TouchReport(40.0 * k - 10.0, x_mm, 17.0, True))
            fusing.predict(40 * k + 400, 40)
    assert {"_alive", "_follow_blocks", "_predict"} <= called(watched)


@FEW
@given(st.integers(0, 2**32 - 1), st.booleans())
def test_which_average_of_the_nail_is_used(seed: int, wide: bool) -> None:
    rng = np.random.default_rng(seed)
    ended = rng.standard_normal((2, skin_fit.SUMS))
    variances, wider_noise = rng.exponential(size=(2, 4)), rng.exponential(size=2)
    averages, out = rng.standard_normal((6, 2)), np.zeros((2, 2))
    with compared(nail_acceleration) as watched:
        watched["_take_average"](0.1, ended, variances, averages, wider_noise, wide, out)
    assert out[1].min() > 0.0


@FEW
@given(st.integers(1, 6), st.integers(0, 40), st.integers(1, 6), st.integers(0, 2**32 - 1))
def test_rows_of_a_table(terms: int, size: int, n_rows: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    step_rad, amplitude, phase = rng.uniform(-4.0, 4.0, (3, terms))
    row = rng.integers(0, n_rows, terms)
    made = [np.zeros((n_rows, size + 3)) for _ in range(2)]
    tables._sum_rows(step_rad, amplitude, phase, row, made[0])
    plain(tables._sum_rows)(step_rad, amplitude, phase, row, made[1])
    np.testing.assert_allclose(made[0], made[1], rtol=1e-9, atol=1e-12)


@FEW
@given(region)
def test_how_far_a_table_reaches(region: Region) -> None:
    law: Any = inverse_of_model(placeholder_model(), SCREEN)
    with compared(drive_range, most_items=20_000):
        try:
            compile_scene(Scene(regions=[region]), law, SCREEN, RATE_HZ)
        except TextureError:
            return

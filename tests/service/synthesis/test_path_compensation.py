"""Paths of the drive are undone: what comes along them was taken away before."""

from dataclasses import replace

import numpy as np
import pytest
from tests.service.synthesis.test_compensator import GRATING, LAW, SCREEN, played

from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.effects import FORMS, extended
from frictus_hardware.physics.forms import band_names
from frictus_hardware.physics.linear import sample
from frictus_hardware.physics.paths import MEASURED, DelayLine, FilterBank, ParallelPath
from frictus_hardware.physics.schedule import SlidingConditions
from frictus_hardware.physics.simulator import Simulator
from frictus_service.synthesis.compensability import NO_PATH, inverse_of
from frictus_service.synthesis.compensation import Ranges
from frictus_service.synthesis.path_compensation import LEAST_FACTOR, PathInverse
from frictus_service.synthesis.renderer import Renderer
from frictus_service.synthesis.scene import compile_scene

RATE = 20_000.0
EXAMPLES = {
    "extra_resonance": {"depth": 0.3, "frequency_hz": 182.0, "by_speed": 0.5},
    "echo": {"share": -0.2, "delay_s": 0.0011234},
    "pole_zero_pair": {"share": 0.4, "corner_hz": 300.0},
    "empirical": {"strength": 1.0, **dict.fromkeys(band_names(), 0.05)},
}


def along(path: ParallelPath, dose: float, drive: FloatArray) -> FloatArray:
    """What a path makes of a drive that was never other than its first."""
    x, branch = drive - drive[0], path.branch
    if isinstance(branch, DelayLine):
        delay = branch.delay_s * RATE
        index = np.arange(x.size)
        late = np.interp(index - delay, index, x, left=0.0)
        echoed: FloatArray = drive + dose * (late + drive[0])
        return echoed
    parts = branch.parts if isinstance(branch, FilterBank) else ((1.0, branch),)
    passed = np.zeros(x.size)
    for weight, part in parts:
        filtered = sample(part, RATE)
        passed += weight * filtered.run(x[:, np.newaxis], filtered.at_rest(1))[0][:, 0]
    return drive + dose * passed


@pytest.mark.parametrize("id_", EXAMPLES)
def test_what_a_path_adds_is_taken_away(id_: str, rng: np.random.Generator) -> None:
    (path,) = extended(Simulator(), [(id_, EXAMPLES[id_])]).paths
    one = np.ones(2)
    around = SlidingConditions(80.0 * one, 0.5 * one, 35.0 * one, one, 5.0 * one)
    dose = tuple(path.dose.at(around).tolist())
    wanted = 0.5 + 0.1 * np.cumsum(rng.normal(size=900)) / 30.0
    wanted[0] = 0.5
    drive, inverse, bias = wanted.copy(), PathInverse(path, RATE), (0.5, 0.5)
    for part in np.split(drive, 9):  # as blocks come
        inverse.undo(dose, bias, part)
    assert np.allclose(along(path, dose[0], drive), wanted, atol=1e-9)
    assert inverse.finite


CANCELLING = {
    "wide": ("extra_resonance", {"depth": -0.6, "frequency_hz": 200.0, "by_speed": 1.0}),
    "narrow": (
        "extra_resonance",
        {"depth": -0.9, "frequency_hz": 203.3, "damping": 0.005, "by_speed": 1.0},
    ),
    "a zero beyond 10 kHz": (
        "pole_zero_pair",
        {"share": 1.0, "corner_hz": 5000.0, "by_speed": 0.1},
    ),
    "an echo within a sample": ("echo", {"share": 0.9, "delay_s": 2e-5, "by_speed": 2.0}),
}


@pytest.mark.parametrize("case", CANCELLING)
def test_a_path_that_cancels_the_drive_is_left_and_said(case: str) -> None:
    id_, values = CANCELLING[case]
    inverse = inverse_of(LAW, [(id_, values)])
    assert inverse.paths == ()
    assert inverse.not_rendered == {id_: NO_PATH}


def test_a_path_is_left_that_cancels_the_drive_where_the_law_was_not_measured() -> None:
    law = replace(LAW, speed_range_mm_s=(20.0, 40.0))
    values = {"depth": -0.6, "frequency_hz": 200.0, "by_speed": 1.0}
    assert inverse_of(law, [("extra_resonance", values)]).paths == ()


def test_what_undoes_a_path_is_stable(rng: np.random.Generator) -> None:
    ids = [id_ for id_ in FORMS if id_ in EXAMPLES or id_.startswith("empirical")]
    undone, pulse = 0, np.zeros(4000)
    pulse[0] = 1.0
    for _ in range(150):
        id_ = str(rng.choice(ids))
        values = {
            each.name: float(
                rng.choice([each.low, each.high, rng.uniform(each.low, each.high)])
            )
            for each in FORMS[id_].parameters
        }
        for path in inverse_of(LAW, [(id_, values)]).paths:
            undone += 1
            dose = path.dose.at(Ranges().everywhere(MEASURED["speed_mm_s"]))
            for end in (float(dose.min()), float(dose.max())):
                drive = pulse.copy()
                PathInverse(path, RATE).undo((end, end), (0.0, 0.0), drive)
                assert np.sum(np.square(drive)) <= 1.001 / LEAST_FACTOR**2, (id_, values)
    assert undone > 10


def test_many_effects_together_leave_a_gain_and_a_drive() -> None:
    knee = [("gain_knee_above_speed", {"exponent": -4.0, "threshold_mm_s": 5.0})] * 40
    bend = [("cutoff_knee_above_speed", {"exponent": 4.0, "threshold_mm_s": 5.0})] * 64
    for effects in (knee, [(id_, {**v, "exponent": 4.0}) for id_, v in knee], bend):
        inverse = inverse_of(LAW, effects)
        renderer = Renderer(inverse, SCREEN, RATE, 100)
        renderer.set_scene(compile_scene(GRATING, inverse, SCREEN, RATE))
        drive, _, _ = played(renderer, 2_000, 100)
        assert 0.0 <= drive.min() <= drive.max() <= 1.0


@pytest.mark.parametrize("id_", EXAMPLES)
def test_a_scene_is_scaled_so_that_what_undoes_a_path_fits(id_: str) -> None:
    inverse = inverse_of(LAW, [(id_, EXAMPLES[id_])])
    assert inverse.not_rendered == {}
    renderer = Renderer(inverse, SCREEN, RATE, 100)
    renderer.set_scene(compile_scene(GRATING, inverse, SCREEN, RATE))
    played(renderer, 1_000, 100)  # the scene is faded in
    drive, _, clipped = played(renderer, 9_000, 100, first=1_000)
    assert clipped == 0
    assert 0.0 <= drive.min() < drive.max() <= 1.0

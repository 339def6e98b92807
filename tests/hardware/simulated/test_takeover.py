"""A finger that strokes by itself until it is taken over."""

import numpy as np
import pytest

from frictus_hardware import SimulatedConfig
from frictus_hardware.errors import ConfigError
from frictus_hardware.simulated.motion import FingerMotion
from frictus_hardware.simulated.rig import SimulatedRig
from frictus_hardware.simulated.strokes import SteadyStrokes
from frictus_hardware.simulated.takeover import (
    FORGOTTEN_S,
    LAND_S,
    LIFT_S,
    RESTED_S,
    SILENT_S,
    TakeoverFinger,
    TakeoverStrokes,
)

SCREEN_MM = (70.0, 35.0)
STROKES = SteadyStrokes(speed_mm_s=25.0)
STEP_S = 1e-3


@pytest.fixture
def finger(rng: np.random.Generator) -> TakeoverFinger:
    return TakeoverStrokes(strokes=STROKES).start(SCREEN_MM, rng)


def moved(finger: TakeoverFinger, begin_s: float, end_s: float) -> FingerMotion:
    """Let it move in blocks of 5 ms."""
    blocks = np.arange(round(begin_s / STEP_S), round(end_s / STEP_S)).reshape(-1, 5) * STEP_S
    motions = [finger.at(block) for block in blocks]
    return FingerMotion(
        *(
            np.concatenate([getattr(motion, name) for motion in motions])
            for name in FingerMotion.__dataclass_fields__
        )
    )


def test_it_strokes_by_itself(finger: TakeoverFinger) -> None:
    motion = moved(finger, 0.0, 5.0)
    alone = STROKES.start(SCREEN_MM, np.random.default_rng(0)).at(STEP_S * np.arange(5_000.0))
    np.testing.assert_allclose(motion.position_mm, alone.position_mm)
    assert np.all(motion.in_contact)


def test_taken_over_it_lifts_and_lands_where_the_client_is(finger: TakeoverFinger) -> None:
    moved(finger, 0.0, 1.0)
    finger.push(10.0, 5.0, True, 0.6)
    motion = moved(finger, 1.0, 2.0)
    lifted = round(LIFT_S / STEP_S)
    assert not np.any(motion.in_contact[:lifted])
    assert not np.any(motion.normal_force_n[:lifted])
    assert not np.any(motion.velocity_mm_s[:lifted])
    assert np.all(motion.in_contact[lifted + 1 :])
    np.testing.assert_allclose(motion.position_mm, [[10.0, 5.0]] * 1_000)
    assert motion.normal_force_n[-1] == pytest.approx(0.6, rel=1e-6)
    assert np.max(np.diff(motion.normal_force_n)) < 2.0 * 0.6 * STEP_S / LAND_S


def test_let_go_of_it_goes_on_with_its_stroke_where_it_stopped(finger: TakeoverFinger) -> None:
    before = moved(finger, 0.0, 1.0)
    for again in range(3):
        begin_s = 1.0 + 2.0 * again
        finger.push(10.0 + 20.0 * again, 5.0, True, 0.6)
        taken = moved(finger, begin_s, begin_s + 1.0)
        np.testing.assert_allclose(taken.position_mm, [[10.0 + 20.0 * again, 5.0]] * 1_000)
        finger.push(10.0, 5.0, False, 0.6)
        after = moved(finger, begin_s + 1.0, begin_s + 2.0)
        assert not after.in_contact[0]
        step_mm = STROKES.speed_mm_s * STEP_S
        np.testing.assert_allclose(
            after.position_mm[0], before.position_mm[-1], atol=1.01 * step_mm
        )
        lifted = round(LIFT_S / STEP_S)
        np.testing.assert_allclose(after.position_mm[:lifted], [after.position_mm[0]] * lifted)
        assert np.all(after.in_contact[lifted + 1 :])
        before = after


def test_a_client_that_falls_silent_has_let_go(finger: TakeoverFinger) -> None:
    finger.push(10.0, 5.0, True, 0.6)
    motion = moved(finger, 0.0, SILENT_S + 1.0)
    np.testing.assert_allclose(
        motion.position_mm[: round(SILENT_S / STEP_S)], [[10.0, 5.0]] * round(SILENT_S / STEP_S)
    )
    assert motion.position_mm[-1, 1] == SCREEN_MM[1] / 2.0
    finger.push(60.0, 30.0, True, 0.6)
    again = moved(finger, SILENT_S + 1.0, SILENT_S + 2.0)
    np.testing.assert_allclose(again.position_mm, [[60.0, 30.0]] * 1_000)


def test_guided_it_strokes_as_a_participant_and_goes_on_with_its_own_strokes_after(
    finger: TakeoverFinger,
) -> None:
    before = moved(finger, 0.0, 1.0)
    finger.guide(80.0, 0.6, (5.0, 65.0))
    guided = moved(finger, 1.0, 5.0)
    lifted = round(LIFT_S / STEP_S)
    assert not np.any(guided.in_contact[:lifted])
    assert np.median(np.abs(guided.velocity_mm_s[2_000:, 0])) == pytest.approx(80.0, rel=0.15)
    assert np.mean(guided.normal_force_n[2_000:]) == pytest.approx(0.6, rel=0.15)
    finger.guide(0.0, 0.6, (5.0, 65.0))
    rests = moved(finger, 5.0, 5.0 + RESTED_S)
    assert np.all(rests.in_contact)
    assert not np.any(rests.velocity_mm_s[-1_000:])
    moved(finger, 5.0 + RESTED_S, 5.02 + RESTED_S)
    after = moved(finger, 5.02 + RESTED_S, 8.02 + RESTED_S)
    assert not np.any(after.in_contact[: lifted // 2])
    np.testing.assert_allclose(
        after.position_mm[0], before.position_mm[-1], atol=STROKES.speed_mm_s * 0.01
    )
    assert np.median(np.abs(after.velocity_mm_s[500:, 0])) == pytest.approx(25.0)


def test_a_client_takes_it_from_guidance_too(finger: TakeoverFinger) -> None:
    finger.guide(80.0, 0.6, (5.0, 65.0))
    moved(finger, 0.0, 2.0)
    finger.push(10.0, 5.0, True, 0.6)
    taken = moved(finger, 2.0, 3.0)
    np.testing.assert_allclose(taken.position_mm, [[10.0, 5.0]] * 1_000)
    finger.push(10.0, 5.0, False, 0.6)
    again = moved(finger, 3.0, 6.0)
    assert np.median(np.abs(again.velocity_mm_s[1_000:, 0])) == pytest.approx(80.0, rel=0.15)


def test_guidance_whose_calibration_has_died_is_forgotten(finger: TakeoverFinger) -> None:
    finger.guide(80.0, 0.6, (5.0, 65.0))
    moved(finger, 0.0, FORGOTTEN_S + 1.0)
    own = moved(finger, FORGOTTEN_S + 1.0, FORGOTTEN_S + 2.0)
    assert np.median(np.abs(own.velocity_mm_s[:, 0])) == pytest.approx(25.0)


def test_that_nothing_is_asked_for_takes_it_from_nobody(finger: TakeoverFinger) -> None:
    finger.guide(0.0, 0.6, (5.0, 65.0))
    assert np.all(moved(finger, 0.0, 1.0).in_contact)


def test_a_rig_says_that_its_finger_can_be_taken_over() -> None:
    with SimulatedRig(SimulatedConfig(clock="virtual", finger=TakeoverStrokes())) as rig:
        assert (rig.info.finger_source, rig.info.finger_takeover) == ("simulated", True)
        assert rig.follows_guidance
        rig.guide_finger(80.0, 0.6, (5.0, 65.0))
        rig.move_finger(20.0, 10.0, in_contact=True)
        got = [rig.exchange(np.zeros(2_000)) for _ in range(3)][-1]
        assert [(r.x_mm, r.y_mm, r.in_contact) for r in got.touches][-1] == (20.0, 10.0, True)
        with pytest.raises(ConfigError, match="finite"):
            rig.move_finger(np.nan, 10.0, in_contact=True)

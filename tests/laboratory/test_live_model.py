"""Sessions in which what is rendered depends on what was learned."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from frictus.aligned import AlignedSamples
from frictus.block import Flag
from frictus.recordings import texture_of
from frictus_hardware.simulated.config import SimulatedConfig, SimulatedParticipant
from frictus_hardware.simulated.strokes import SteadyStrokes
from frictus_laboratory.live_model.closed_loop import ClosedLoop
from frictus_laboratory.live_model.discovered import discovered
from frictus_laboratory.live_model.disturbances import (
    FAULTS,
    Disturbance,
    Faulty,
    Later,
    NewFinger,
    SessionSpan,
    WithEffect,
    WithinPerson,
    drift,
    gain_step,
    scaled,
)
from frictus_laboratory.live_model.laws import error_db, model_of
from frictus_laboratory.live_model.motion import KnownMotion, PredictedPath, rendered_rows
from frictus_laboratory.live_model.session_plan import SessionPlan, config_of, motion_of
from frictus_service.calibration import coordinates
from frictus_service.library import SHIPPED
from frictus_service.synthesis.compensability import placeholder_model
from frictus_service.tracking.evidence.watch import INSTRUMENT

FLAT = texture_of((SHIPPED / "flat.json").read_text(encoding="utf-8"))
PERSON = scaled(SimulatedParticipant(), 1.4, 1.5)
PLAN = SessionPlan(PERSON, FLAT, 12.0, 5, placeholder_model(), "adapt", known_motion=True)
SPAN = SessionSpan(10.0, 1, 1, 60.0, 0.4)


@pytest.mark.compiled
def test_a_finger_is_followed_where_it_may_be_and_left_where_not() -> None:
    adapt, observe = (
        ClosedLoop(replace(PLAN, policy=policy)) for policy in ("adapt", "observe")
    )
    last, unchanged = list(adapt)[-1], list(observe)[-1]
    assert adapt.changes
    assert last.in_force_db < 0.2 < last.first_db
    assert not observe.changes
    assert unchanged.in_force_db == unchanged.first_db == last.first_db
    # What was rendered since depends on the estimate, and the estimate on what was rendered.
    assert not np.array_equal(adapt.tracker.estimate.mean, observe.tracker.estimate.mean)
    assert adapt.arithmetic_s > 0.0


@pytest.mark.long
def test_a_finger_that_keeps_to_one_speed_tells_no_slope() -> None:
    """Errors of its speed were taken for other speeds: its law was flat."""
    plan = replace(PLAN, seconds=24.0, policy="observe", first=model_of(PERSON))
    config = SimulatedConfig(
        seed=plan.seed, finger=SteadyStrokes(speed_mm_s=33.0), participant=PERSON
    )
    loop = ClosedLoop(plan, PredictedPath(config, plan.seconds))
    assert list(loop)
    estimate = loop.tracker.estimate
    truth = coordinates.from_law(
        PERSON.gain_n, PERSON.cutoff_0_hz, PERSON.slope_hz_per_mm_s, 0.0
    )
    assert np.all(np.abs(estimate.mean - truth)[:2] < 1.5 * estimate.half_width[:2])
    # Far from its own speed no more is known than that of people, however long it slides.
    assert estimate.half_width[1] > 0.33
    assert "speed_dependent_cutoff" not in loop.named


def test_a_finger_that_changes_without_notice_is_noticed() -> None:
    other = scaled(PERSON, 0.5, 0.6)
    plan = replace(
        PLAN, seconds=14.0, first=model_of(PERSON), disturbance=NewFinger(other, 8.0)
    )
    loop = ClosedLoop(plan)
    moments = list(loop)
    assert loop.new_fingers
    assert 8.0 < loop.new_fingers[0]
    assert moments[70].in_force_db < 0.05 < moments[100].in_force_db


def test_a_finger_that_changes_brings_back_the_model_that_was_set() -> None:
    """Somebody else's finger is followed until the one comes back whose model was set."""
    plan = replace(
        PLAN,
        seconds=24.0,
        first=model_of(PERSON),
        disturbance=NewFinger(scaled(PERSON, 0.5, 0.6), 0.0, 12.0),
    )
    loop = ClosedLoop(plan)
    moments = list(loop)
    followed = next(moment.at_s for moment in moments if moment.changed)
    back = next(moment for moment in moments if moment.at_s > 12.0 and moment.changed)
    assert followed < 12.0
    assert moments[110].in_force_db < 0.2
    assert back.in_force_db == back.first_db == 0.0
    assert back.at_s < loop.new_fingers[-1]  # long before it is sure


def test_what_is_predicted_is_close_to_what_is_known() -> None:
    config = config_of(PLAN)
    known, predicted = KnownMotion(config), PredictedPath(config, 2.0)
    for motion in (known, predicted):
        piece = motion.piece(20_000, 2_000)
        rows = rendered_rows(piece.courses, config.sample_rate_hz)
        assert rows.shape == (3, 2_000)
        assert np.abs(rows[:2].T - piece.position_mm).max() < 2.0
        assert np.abs(rows[2] - np.hypot(*piece.velocity_mm_s.T)).max() < 25.0
    np.testing.assert_allclose(
        known.piece(20_000, 2_000).position_mm, predicted.piece(20_000, 2_000).position_mm
    )
    assert predicted.piece(0, 2_000).courses[0] is None


def test_a_plan_chooses_its_motion() -> None:
    assert isinstance(motion_of(PLAN), KnownMotion)
    assert isinstance(motion_of(replace(PLAN, known_motion=False, seconds=0.1)), PredictedPath)


def test_the_right_law_has_no_error() -> None:
    at = np.array([6.5, 7.4, -1.0, 0.0])
    assert error_db(at, at) == 0.0
    gain = at + np.array([0.0, 0.0, 0.1, 1e-4])
    assert error_db(gain, at) == pytest.approx(0.1 * 20.0 / np.log(10.0))


def test_gain_and_cutoff_change_as_asked() -> None:
    later = SPAN._replace(at_s=60.0)
    person = drift(0.02).person(PERSON, later)
    assert person.gain_n / PERSON.gain_n == pytest.approx(np.exp(0.02))
    halfway = gain_step(0.8, 9.5, 1.0).person(PERSON, SPAN)
    assert halfway.gain_n / PERSON.gain_n == pytest.approx(np.sqrt(0.8))
    scatter = WithinPerson(3)
    assert scatter.person(PERSON, SPAN) == scatter.person(PERSON, later)
    touched = scatter.person(PERSON, SPAN._replace(contact=2))
    assert touched.gain_n != scatter.person(PERSON, SPAN).gain_n
    assert touched.cutoff_0_hz == scatter.person(PERSON, SPAN).cutoff_0_hz
    assert Disturbance().person(PERSON, SPAN) == PERSON


def test_a_rig_becomes_wrong_later() -> None:
    wrong = WithEffect("channel_delay", {"delay_s": 1e-4})
    later = Later(wrong, 12.0)
    assert later.simulator(PERSON, SPAN) == Disturbance().simulator(PERSON, SPAN)
    after = SPAN._replace(at_s=12.0)
    assert later.simulator(PERSON, after) == wrong.simulator(PERSON, after)


def test_a_moment_of_sliding_is_too_little_for_discover() -> None:
    kept: list[AlignedSamples] = []
    loop = ClosedLoop(replace(PLAN, seconds=1.0), keep=kept.append)
    assert len(list(loop)) == len(kept) == 10
    assert discovered(kept, model_of(PERSON), loop.screen.peak_v) is None


@pytest.mark.parametrize(
    ("fault", "largest_n"),
    [("force dead", 0.0), ("force saturated", 18.0), ("force clipped", 0.35)],
)
def test_a_fault_begins_when_it_is_asked_for(fault: str, largest_n: float) -> None:
    force = np.tile(np.float32(0.5), (3, 2_000))
    part = AlignedSamples(1, 0, 0, 20_000.0, 0, Flag(0), {"force": force})
    assert Faulty(fault, 20.0).sensed(part, SPAN) is part
    faulty = Faulty(fault, 5.0).sensed(part, SPAN)
    assert np.abs(faulty.data["force"][:2]).max() == pytest.approx(largest_n)


REASONS = {
    "force dead": "no finger presses",
    "force stuck": "the force stands still, or at an end of its range",
    "force saturated": "no finger presses",  # from rail to rail: not in each tenth of a window
    "force clipped": "the force stands still, or at an end of its range",
    "force loose": "no finger presses",  # it rattles about zero
    "gaps": "samples are missing",
    "underruns": "the drive came too late",
    "touch frozen": "slower than 10 or faster than 150 mm/s",
    "clock stepped": "",  # windows go by the device's samples: nothing is lost
}


@pytest.mark.long
@pytest.mark.parametrize("fault", sorted(REASONS))
def test_a_fault_changes_no_model_and_says_why(fault: str) -> None:
    assert {*REASONS, "touch scaled"} == {*FAULTS}
    plan = replace(PLAN, first=model_of(PERSON), disturbance=Faulty(fault, 6.0))
    loop = ClosedLoop(plan)
    moments, refused, windows = [], Counter[str](), 0
    for moment in loop:
        if moment.at_s <= 6.0:
            refused = Counter(loop.tracker.state(0).refused)
            windows = loop.tracker.estimate.windows
        moments.append(moment)
    assert loop.changes == loop.new_fingers == []
    assert all(moment.in_force_db == 0.0 for moment in moments)
    assert not INSTRUMENT & loop.named.keys()
    later = Counter(loop.tracker.state(0).refused) - refused
    if REASONS[fault]:
        assert later[REASONS[fault]] > 0
        # Some were under way, and between gaps the finger is still felt.
        assert loop.tracker.estimate.windows - windows <= 30
    else:
        assert moments[-1].newest_db < 0.1


@pytest.mark.long
def test_a_touch_sensor_that_lies_is_followed_and_not_made_worse() -> None:
    """It scales the speed by which the law is looked up: another law is the right one then."""
    disturbance = Faulty("touch scaled", 6.0)
    plan = replace(PLAN, seconds=40.0, first=model_of(PERSON), disturbance=disturbance)
    loop = ClosedLoop(plan)
    moments = list(loop)
    assert max(each.in_force_db - each.first_db for each in moments) < 0.1
    assert not INSTRUMENT & loop.named.keys()

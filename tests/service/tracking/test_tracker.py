"""A finger with twice the cutoff, on the twin: followed from samples to what is published."""

from dataclasses import replace

import numpy as np
import pytest
from tests.service.tracking.played import PERSON, RATE_HZ, lift, parts, played, tracker

from frictus.block import Flag
from frictus.model import MassSpringDamper, Model
from frictus_hardware.physics.linear import Mount
from frictus_hardware.physics.twin import Signals
from frictus_hardware.simulated.config import ParticipantEffect, SimulatedParticipant
from frictus_service.calibration import coordinates
from frictus_service.calibration.coordinates import Prior
from frictus_service.synthesis.compensability import placeholder_model
from frictus_service.tracking.estimation.law_estimate import of_another_finger
from frictus_service.tracking.evidence.watch import INSTRUMENT
from frictus_service.tracking.model_in_force import ModelInForce
from frictus_service.tracking.policy import (
    WATCHED_WINDOWS,
    loosest_half_width,
)
from frictus_service.tracking.windows import WindowCutter


def test_the_law_is_found_from_a_texture_under_free_strokes(felt: Signals) -> None:
    found = tracker()
    updates = sum(found.take(part) for part in parts(felt))
    state = found.state(1)
    assert updates > 3
    law = PERSON.law
    true = coordinates.from_law(law.gain_n, law.cutoff_0_hz, law.slope_hz_per_mm_s, 0.0)
    assert np.all(np.abs(found.estimate.mean - true)[:3] < [0.08, 0.08, 0.01])
    assert state.law is not None
    assert state.law.cutoff_20_hz.low < 2 * 661.9 < state.law.cutoff_20_hz.high
    assert abs(state.law.delay_us.value) < 2.0
    # The model in force is wrong, by name; the estimate predicts what it has not seen.
    assert state.alarms == ("cutoff",)
    assert state.error_db["newest"] < 0.15 < state.error_db["in_force"]
    assert {band.centre_hz for band in state.bands} <= set(found._cutter.bands.centre_hz)
    assert len(state.to_json()) < 32_000
    assert "calibrate again" in state.advice["cutoff"]
    # What is predicted before it is used is far more probable under the estimate.
    assert state.gain_nats["newest"] > 20.0
    assert state.gain_nats["in_force"] == 0.0
    assert state.in_force is not None
    assert state.in_force.gain_n == pytest.approx(0.39)


def test_points_are_the_law_within_their_intervals(felt: Signals) -> None:
    found = tracker()
    for part in parts(felt):
        found.take(part)
    points = found.state(1).points
    assert len({point.speed_mm_s for point in points}) > 1
    law = PERSON.law
    inside = []
    for point in points:
        cutoff = law.cutoff_0_hz + law.slope_hz_per_mm_s * point.speed_mm_s
        true = law.gain_n / np.hypot(1.0, point.centre_hz / cutoff)
        off_db = 20.0 * np.log10(point.gain_n / true)
        inside.append(abs(off_db) < point.half_width_db + 0.1)
        assert abs(point.phase_deg + np.degrees(np.arctan(point.centre_hz / cutoff))) < 10.0
    assert np.mean(inside) > 0.8


@pytest.mark.long
@pytest.mark.parametrize(
    ("effect", "parameters"),
    [
        ("direction_asymmetry", {"share": 0.15}),
        ("channel_delay", {"delay_s": 80e-6}),
    ],
)
def test_an_effect_in_the_twin_is_named_and_has_advice(
    effect: str, parameters: dict[str, float], seed: int
) -> None:
    one = ParticipantEffect(id=effect, parameters=parameters)
    found = tracker()
    for part in parts(played(SimulatedParticipant(effects=(one,)), 20.0, seed)):
        found.take(part)
    state = found.state(1)
    cause = "delay" if effect == "channel_delay" else effect
    assert state.alarms == (cause,)
    assert set(state.advice) == {cause}
    assert len(state.evidence) <= 64
    assert np.all(np.isfinite(list(state.evidence.values())))
    if cause in INSTRUMENT:
        assert "not the finger" in state.advice[cause]


def test_a_force_of_the_wrong_sign_is_no_finger_of_no_gain(felt: Signals) -> None:
    """The gain became 1e-5 N, of which nothing that came later was seen to be off."""
    reason = "friction falls where the drive has it rise"
    turned = np.array([[-1.0], [-1.0], [1.0]], dtype=np.float32)
    found, begun = tracker(), tracker()
    for part in parts(felt):
        found.take(part)
    found.rest()
    known = found.estimate
    for part in parts(felt):
        wrong = {**part.data, "force": turned * part.data["force"]}
        found.take(replace(part, run=2, data=wrong))
        begun.take(replace(part, data=wrong))
    assert found.state(1).refused[reason] > 50
    assert found.new_fingers == 0
    np.testing.assert_array_equal(found.estimate.mean, known.mean)
    assert begun.estimate.windows == 0


def test_another_finger_keeps_what_is_known_of_the_delay(felt: Signals) -> None:
    found = tracker()
    for part in parts(felt):
        found.take(part)
    known = found.estimate
    new = of_another_finger(Prior.weak(), known)
    assert new.mean[3] == pytest.approx(known.mean[3], rel=1e-12)
    assert new.covariance[3, 3] == pytest.approx(known.covariance[3, 3], rel=1e-12)
    assert new.mean[:3] == pytest.approx(Prior.weak().mean[:3])
    assert new.covariance[3, 0] == pytest.approx(0.0, abs=1e-20)


@pytest.mark.long
def test_who_moves_to_another_rig_brings_the_finger_and_not_the_delay(
    felt: Signals, seed: int
) -> None:
    here = tracker()
    for part in parts(felt):
        here.take(part)
    own = here.state(0).model
    assert own is not None
    late = ParticipantEffect(id="channel_delay", parameters={"delay_s": 60e-6})
    there = tracker()
    there.begin_anew(Prior.of_person(own, Prior.weak()), "P07")
    there.put_in_force(ModelInForce.of("own", own))
    begun = loosest_half_width(there.estimate, (20.0, 100.0))
    assert begun < 0.5 * loosest_half_width(tracker().estimate, (20.0, 100.0))
    for part in parts(played(PERSON.model_copy(update={"effects": (late,)}), 8.0, seed)):
        there.take(part)
    law = PERSON.law
    true = coordinates.from_law(law.gain_n, law.cutoff_0_hz, law.slope_hz_per_mm_s, 60e-6)
    found = there.estimate
    assert np.all(np.abs(found.mean - true) < [0.1, 0.1, 0.02, 5e-6])
    assert found.half_width[3] < 10e-6
    assert there.new_fingers == 0


def test_samples_may_come_in_any_portions(felt: Signals) -> None:
    states = []
    for samples in (100, 1777):
        found = tracker()
        for part in parts(felt, samples):
            found.take(part)
        states.append(found.state(1))
    assert states[0] == states[1]


def test_the_model_says_where_it_comes_from_and_puts_an_end_to_the_alarm(felt: Signals) -> None:
    found = tracker()
    for part in parts(felt):
        found.take(part)
    model = found.state(0).model
    assert model is not None
    assert (model.participant, model.placeholder) == (None, False)
    assert (model.provenance["source"], model.provenance["rig"]) == ("live", "rig1")
    assert model.validity.speed_mm_s[0] >= 20.0
    found.put_in_force(ModelInForce.of("other", model))
    assert found.state(1).alarms == ()
    for part in parts(felt):
        found.take(part)
    after = found.state(1)
    assert after.alarms == ()
    assert after.error_db["in_force"] < 0.15 < after.error_db["first"]


def test_a_gap_a_restart_and_dead_sensors_are_left_out_and_counted(felt: Signals) -> None:
    found = tracker()
    for number, part in enumerate(parts(felt)):
        if number == 1000:
            part = replace(part, missing_samples=100)
        if number == 1200:
            part = replace(part, run=2)
        if 1400 <= number < 1500:
            part = replace(part, flags=Flag.UNDERRUN)
        if 1600 <= number < 1700:
            dead = np.full_like(part.data["force"], np.nan)
            part = replace(part, data={**part.data, "force": dead})
        if 1800 <= number < 1900:
            deaf = part.data["force"] * np.array([[0.0], [0.0], [1.0]], np.float32)
            part = replace(part, data={**part.data, "force": deaf})
        found.take(part)
    refused = found.state(1).refused
    assert {"samples are missing", "the drive came too late", "samples are not numbers"} <= set(
        refused
    )
    law = PERSON.law
    true = coordinates.from_law(law.gain_n, law.cutoff_0_hz, law.slope_hz_per_mm_s, 0.0)
    assert np.all(np.abs(found.estimate.mean - true)[:3] < [0.1, 0.1, 0.02])
    assert found.new_fingers == 0


def test_where_a_contact_ends_the_next_one_is_expected(felt: Signals) -> None:
    found = tracker()
    on_screen = list(parts(felt))
    for part in on_screen:
        found.take(part)
    assert not found.lifted
    assert found.expected is found.estimate
    lift(found, felt)
    assert found.lifted
    np.testing.assert_allclose(found.expected.mean, found.estimate.person[0])
    before, after = (each.covariance[2, 2] for each in (found.estimate, found.expected))
    assert after > 10.0 * before


def test_another_person_begins_from_what_is_known_of_them(felt: Signals) -> None:
    found = tracker()
    for part in list(parts(felt))[:1200]:
        found.take(part)
    own = found.state(0).model
    assert own is not None
    weak = Prior.weak()
    prior = Prior.of_person(own, weak)
    # Theirs, a little wider than it was known; the delay is the rig's and not carried over.
    mean, covariance = found.estimate.person
    np.testing.assert_allclose(prior.mean[:3], mean[:3], rtol=1e-9)
    assert np.all(np.diag(prior.covariance)[:3] > np.diag(covariance)[:3])
    assert prior.covariance[3, 3] == weak.covariance[3, 3]
    assert np.all(prior.covariance[3, :3] == 0.0)
    found.begin_anew(prior, "P07")
    assert (found.state(0).participant, found.state(0).windows) == ("P07", 0)
    assert found.state(0).law is None
    assert Prior.of_person(placeholder_model(), weak) is weak


def test_nothing_is_said_of_a_finger_that_felt_nothing() -> None:
    found = tracker()
    state = found.state(1)
    assert (state.law, state.windows, state.error_db, state.alarms) == (None, 0, {}, ())
    assert state.model is None


def test_a_model_without_a_law_of_friction_is_not_compared_with(felt: Signals) -> None:
    found = tracker()
    skin = MassSpringDamper(mass_kg=1e-3, damping_n_s_m=1.0, stiffness_n_m=400.0)
    found.put_in_force(ModelInForce.of("skin", Model(response="mobility", base=skin)))
    for part in list(parts(felt))[:1200]:
        found.take(part)
    state = found.state(1)
    assert "in_force" not in state.error_db
    assert "newest" in state.error_db


def test_a_corrected_prediction_is_no_turn(felt: Signals) -> None:
    """The rendered position jumps back by 0.4 mm four times a second; the finger does not."""
    straight, jumping = tracker(), tracker()
    for number, part in enumerate(parts(felt)):
        straight.take(part)
        behind = np.float32(0.4 * (number // 50 % 2))
        render = part.data["render"] - np.array([[behind], [0.0], [0.0]], np.float32)
        jumping.take(replace(part, data={**part.data, "render": render}))
    lost = straight.estimate.windows - jumping.estimate.windows
    assert lost < 0.1 * straight.estimate.windows


@pytest.mark.parametrize("fault", ["clipped", "stuck"])
def test_a_force_at_an_end_of_its_range_teaches_nothing(felt: Signals, fault: str) -> None:
    found = tracker()
    for part in parts(felt):
        force = part.data["force"].copy()
        if fault == "clipped":
            force[:2] = np.clip(force[:2], -0.35, 0.35)
        else:
            force[:] = np.array([[0.21], [0.0], [0.4]], np.float32)
        found.take(replace(part, data={**part.data, "force": force}))
    assert found.state(1).refused["the force stands still, or at an end of its range"] > 50
    assert found.estimate.windows < 20


def test_no_window_of_a_sound_sensor_is_taken_for_clipped(felt: Signals) -> None:
    found = tracker()
    for part in parts(felt):
        steps = np.rint(part.data["force"] / 0.0005) * np.float32(0.0005)
        found.take(replace(part, data={**part.data, "force": steps}))
    assert "the force stands still, or at an end of its range" not in found.state(1).refused


@pytest.mark.parametrize("known", [False, True])
def test_no_estimate_begins_from_one_window(felt: Signals, known: bool) -> None:
    """It has no noise beside its own response: what it said would be believed for ever."""
    found = tracker()
    cut = WindowCutter(RATE_HZ, 75.0, Mount().lateral)
    windows = [window for part in parts(felt) for window in cut.take(part)]
    found.take(next(parts(felt)))
    if known:
        found._waiting = windows[:10]
        assert found._update()
    before = found.estimate
    for window in windows[10:20]:
        other = replace(window, contact=99, cross=3.0 * window.cross)
        found._waiting = [replace(other, friction_power=9.0 * window.friction_power)]
        assert not found._update()
    assert found.estimate is before
    assert found.new_fingers == 0


def test_nothing_is_watched_against_a_model_of_another_law(felt: Signals) -> None:
    found = tracker()
    found.put_in_force(ModelInForce("skin", None))
    for part in parts(felt):
        found.take(part)
    assert found.estimate.windows > WATCHED_WINDOWS
    found.begin_anew(Prior.weak())
    assert not found.watched_before


def test_a_new_finger_is_known_where_it_was_felt_itself(felt: Signals) -> None:
    found = tracker()
    for part in parts(felt):
        found.take(part)
    before = found.state(0).model
    assert not found.doubted
    doubted = 0
    for part in parts(felt):
        other = 3.0 * part.data["force"]
        found.take(replace(part, data={**part.data, "force": other}))
        doubted += found.doubted and not found.new_fingers
    assert doubted  # before it is sure
    after = found.state(0).model
    assert found.new_fingers == 1
    assert found.doubted  # until a model is put in force that knows of it
    found.put_in_force(ModelInForce("adapted", found.estimate.mean))
    assert not found.doubted
    assert before is not None
    assert after is not None
    assert after.validity.normal_force_n[0] > 2.0 * before.validity.normal_force_n[0]


def test_the_same_strokes_say_more_of_a_finger_that_is_known_beforehand(felt: Signals) -> None:
    """What they add to is at least what was known, and at least what they say alone."""
    learned = tracker()
    for part in parts(felt):
        learned.take(part)
    document = learned.document()
    assert document is not None
    person = Prior.of_person(document, Prior.weak())
    beforehand, weak = tracker(), tracker()
    beforehand.begin_anew(person, "P07")
    for part in parts(felt):
        weak.take(part)
        if beforehand.take(part):
            break
    known = np.diag(beforehand.estimate.covariance)[:3]
    assert np.all(known < np.diag(person.covariance)[:3])
    assert np.all(known < np.diag(weak.estimate.covariance)[:3])

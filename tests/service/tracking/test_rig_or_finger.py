"""What is the rig's outlasts a finger; what was seen of a finger says nothing of the rig."""

from dataclasses import replace

import numpy as np
import pytest
from tests.service.tracking.played import lift, parts, played, tracker

from frictus_hardware.physics.twin import Signals
from frictus_hardware.simulated.config import ParticipantEffect, SimulatedParticipant
from frictus_service.calibration.coordinates import Prior
from frictus_service.synthesis.compensability import placeholder_model
from frictus_service.tracking.carried import carried
from frictus_service.tracking.evidence.advice import later
from frictus_service.tracking.evidence.watch import CAUSES, INSTRUMENT, SUSPECTED
from frictus_service.tracking.model_in_force import ModelInForce
from frictus_service.tracking.policy import (
    WATCHED_WINDOWS,
    Circumstances,
    adapted,
    follows_a_contact,
    held_back,
)
from frictus_service.tracking.tracker import Tracker


def test_a_rig_that_was_watched_with_one_finger_is_known_with_the_next(felt: Signals) -> None:
    found = tracker()
    for part in parts(felt):
        found.take(part)
    assert found.estimate.windows > WATCHED_WINDOWS
    assert not found.watched_before
    found.begin_anew(Prior.weak())
    assert found.watched_before
    assert found.watched == 0
    found.take(replace(next(parts(felt)), run=2))  # another start of the device, or its mount
    assert not found.watched_before


def test_a_rig_that_was_found_wrong_was_not_watched(felt: Signals) -> None:
    found = tracker()
    for part in parts(felt):
        found.take(part)
    found._watch = replace(found._watch, raised=("delay",))
    found.begin_anew(Prior.weak())
    assert not found.watched_before


def test_a_rig_that_starts_anew_is_watched_anew(felt: Signals) -> None:
    """An estimate of many windows says nothing of what became of the rig meanwhile."""
    found = tracker()
    for part in parts(felt):
        found.take(part)
    assert found.watched == found.estimate.windows > WATCHED_WINDOWS
    for part in list(parts(felt))[:900]:
        found.take(replace(part, run=2))
    assert 0 < found.watched < WATCHED_WINDOWS < found.estimate.windows
    anew = Circumstances(watched=found.watched, watched_before=found.watched_before)
    why = held_back(found.estimate, found.in_force, Prior.weak(), found.speeds_mm_s, (), anew)
    assert f"{found.watched} windows were felt" in why


LATE = ParticipantEffect(id="channel_delay", parameters={"delay_s": 80e-6})


def until_another_finger(found: Tracker, felt: Signals) -> None:
    """Let a finger be felt that is thrice as strong, until it is noticed."""
    for part in parts(felt):
        other = 3.0 * part.data["force"]
        found.take(replace(part, data={**part.data, "force": other}))
        if found.new_fingers:
            return
    raise AssertionError("another finger was not noticed")


@pytest.mark.parametrize("noticed", [False, True])
def test_another_finger_does_not_mend_the_rig(noticed: bool, seed: int) -> None:
    late = played(SimulatedParticipant(effects=(LATE,)), 12.0, seed)
    found = tracker()
    for part in parts(late):
        found.take(part)
    assert found.state(1).alarms == ("delay",)
    if noticed:
        until_another_finger(found, late)
    else:
        other = placeholder_model().model_copy(update={"participant": "P07"})
        found.begin_anew(Prior.weak(), "P07")
        found.put_in_force(ModelInForce.of("other", other))
    assert found.estimate.windows <= 10
    assert found.state(1).alarms == ("delay",)
    assert found.suspected == ("delay",)
    assert "not the finger" in found.state(1).advice["delay"]
    # Who mends a rig starts it anew.
    found.take(replace(next(parts(late)), run=2))
    mended = found.state(1)
    assert mended.alarms == ()
    assert len(found.suspected) == 0


def test_another_finger_is_no_evidence_against_the_rig(felt: Signals) -> None:
    found = tracker()
    for part in parts(felt):
        found.take(part)
    until_another_finger(found, felt)
    assert found.suspected == ()
    assert not INSTRUMENT.intersection(found.state(1).alarms)


@pytest.mark.parametrize(
    ("cause", "waited_for"),
    [("mount_resonance_shift", True), ("fractional_rolloff", True), ("gain", False)],
)
def test_half_of_an_alarm_is_waited_for_where_it_may_be_the_rig(
    felt: Signals, cause: str, waited_for: bool
) -> None:
    found = tracker()
    for part in parts(felt):
        found.take(part)
    evidence = np.zeros(len(CAUSES))
    evidence[CAUSES.index(cause)] = SUSPECTED
    found._watch = replace(found._watch, log_evidence=evidence)
    assert found.suspected == ((cause,) if waited_for else ())


def test_a_model_says_whether_it_is_a_contacts_or_the_persons(felt: Signals) -> None:
    found = tracker()
    for part in parts(felt):
        found.take(part)
    model = placeholder_model()
    assert not follows_a_contact(model)
    of_contact = adapted(model, found.expected, found.provenance)
    assert follows_a_contact(of_contact)
    lift(found, felt)
    # What is put in force between contacts is the person's, and need not return there again.
    assert not follows_a_contact(adapted(of_contact, found.expected, found.provenance))
    own = found.state(0).model
    assert own is not None
    assert not follows_a_contact(own)


@pytest.mark.parametrize("place", ["lab/here", "elsewhere/there", "lab/there"])
def test_a_model_from_another_rig_does_not_tell_this_ones_delay(
    felt: Signals, place: str
) -> None:
    there = placeholder_model().model_copy(
        update={"skew_s": 150e-6, "provenance": {"source": "live", "rig": "lab/there"}}
    )
    found = tracker()
    found.put_in_force(ModelInForce.of("brought", carried(there, place)))
    for part in parts(felt):
        found.take(part)
    assert ("delay" in found.state(1).alarms) is (place == "lab/there")


def test_a_delay_of_this_rig_or_of_an_unknown_one_is_kept() -> None:
    model = placeholder_model().model_copy(update={"skew_s": 150e-6})
    for rig in (None, "there", "lab/there"):
        told = model.model_copy(update={"provenance": {"rig": rig}})
        assert carried(told, "lab/there") is told
    assert carried(model, "lab/there") is model


def test_a_delay_is_told_with_its_sign_in_words() -> None:
    """ "-15 us later" was said."""
    assert later(8.4e-5) == "84 us later"
    assert later(-1.5e-5) == "15 us earlier"

"""What a design is said to show: orders, levels, people, and what is added."""

import re
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from frictus_hardware.physics.effects import EFFECTS
from frictus_hardware.physics.linear import Mount
from frictus_service.discovery.catalogue.causes import cause_of
from frictus_service.discovery.inference.significance import PRIOR_DEGREES
from frictus_service.discovery.plan.ability import Ability, ability_of
from frictus_service.discovery.plan.assumptions import assumed
from frictus_service.discovery.plan.documents import (
    WANTED,
    FactorialDesign,
    Plan,
    PlannedEffect,
    PlannedPair,
    Setup,
    wanted_sizes,
)
from frictus_service.discovery.plan.plan import plan
from frictus_service.discovery.plan.programme import Programme, programme_of
from frictus_service.discovery.plan.search import EXTRAS
from frictus_service.discovery.problem.base_models import ResponseName, base_model, simulator_of
from frictus_service.discovery.problem.candidates import candidates_of

pytestmark = pytest.mark.long

SPEED_EFFECTS = {"speed_dependent_cutoff", "speed_dependent_gain"}
FORCE_EFFECTS = {"force_dependent_cutoff", "force_dependent_gain"}
OF_CONTACT = {*SPEED_EFFECTS, "force_dependent_gain", "gain_drift"}
"""Of which contacts and people scatter more than measuring is accurate to."""


def design(**changes: Any) -> FactorialDesign:
    usual = {
        "participants": 8,
        "tones_hz": (54.0, 177.5, 429.2, 741.9, 1654.2),
        "speeds_mm_s": (20.0, 45.0, 75.0, 100.0),
        "forces_n": (0.2, 0.6),
        "seconds": 2.0,
    }
    return FactorialDesign.model_validate(usual | changes)


def setup_of(response: ResponseName = "friction") -> Setup:
    mount = Mount().lateral
    base = simulator_of(base_model("paper", response), mount)
    return Setup(base, mount, response, tuple(candidates_of(response)))


def shown_by(one: Programme, seed: int) -> Ability:
    setup = setup_of()
    with threadpool_limits(limits=1):
        found = ability_of(one, setup, assumed("friction", setup.candidates), seed)
    assert found is not None
    return found


def planned(one: FactorialDesign, seed: int, response: ResponseName = "friction") -> Plan:
    setup = setup_of(response)
    programme = programme_of(one, np.random.default_rng(seed))
    with threadpool_limits(limits=1):
        return plan(
            programme,
            setup,
            assumed(response, setup.candidates),
            wanted_sizes({}),
            "a design",
            seed=seed,
        )


def effect(found: Plan, id_: str) -> PlannedEffect:
    return next(one for one in found.effects if one.id == id_)


def pair(found: Plan, *ids: str) -> PlannedPair | None:
    return next((one for one in found.pairs if set(one.between) == set(ids)), None)


def test_blocked_speeds_are_not_told_from_time_and_random_ones_are(seed: int) -> None:
    blocked = planned(design(order="speed blocks"), seed)
    drift = pair(blocked, "gain_drift", "speed_dependent_gain")
    assert drift is not None
    assert drift.separable == "no"
    assert drift.cheapest is not None
    assert drift.cheapest.additions == ("all trials in random order",)
    assert drift.cheapest.finger_s == 0.0
    assert abs(drift.cheapest.reaches) < 0.6
    assert "andom" in drift.separating_experiment
    names = [each.effect for each in setup_of().candidates]
    random = shown_by(programme_of(design(), np.random.default_rng(seed)), seed)
    assert (
        abs(random.cosine[names.index(drift.between[0]), names.index(drift.between[1])]) < 0.7
    )


def test_what_one_level_cannot_show_is_said_and_what_would_show_it(seed: int) -> None:
    found = planned(design(speeds_mm_s=(47.0,), forces_n=(0.3,)), seed)
    for id_ in SPEED_EFFECTS | FORCE_EFFECTS:
        one = effect(found, id_)
        assert one.shown == "no"
        assert one.detectable is None
        assert one.needs == cause_of(id_).visible_with
    for name in ("speed", "force"):
        assert any(f"one target {name}" in note for note in found.notes)
    helped = effect(found, "force_dependent_gain").cheapest
    assert helped is not None
    assert any("0.2 and at 0.6 N" in words for words in helped.additions)
    assert helped.reaches < WANTED["force_dependent_gain"]
    assert effect(found, "direction_asymmetry").shown == "yes"


def test_a_design_of_one_tone_shows_no_effect_of_the_skin_and_says_so(seed: int) -> None:
    one = design(tones_hz=(100.0,), speeds_mm_s=(60.0,), forces_n=(0.4,))
    found = planned(one, seed, "mobility")
    assert found.critical_t is None
    assert all(each.shown == "no" and each.needs for each in found.effects)
    assert any("shows none of the effects" in note for note in found.notes)


def test_sizes_fall_with_the_root_of_the_participants(seed: int) -> None:
    once = programme_of(design(participants=8), np.random.default_rng(seed))
    few, many = shown_by(once, seed), shown_by(replace(once, participants=32), seed)
    ratio = few.standard_error / many.standard_error
    effects = [each.effect for each in setup_of().candidates]
    people = [k for k, each in enumerate(effects) if each in OF_CONTACT]
    np.testing.assert_allclose(ratio[people], 2.0, rtol=0.02)  # the same three stand for all
    # Of the others people agree within what measuring is accurate to. The variance that this
    # alone would give counts as four people do: it has less weight among many.
    most = np.sqrt(4.0 * (PRIOR_DEGREES + 31.0) / (PRIOR_DEGREES + 7.0))
    assert np.all((ratio > 2.0 * 0.98) & (ratio < most * 1.02))
    assert np.all(many.detectable < few.detectable)
    # By chance the largest |t| of a few people is larger, too.
    assert many.critical < few.critical


def test_people_differ_and_no_number_of_trials_helps_that(seed: int) -> None:
    rng = np.random.default_rng(seed)
    once = shown_by(programme_of(design(), rng), seed)
    thrice = shown_by(programme_of(design(repeats=3), rng), seed)
    names = [each.effect for each in setup_of().candidates]
    gain, slope = names.index("gain_drift"), names.index("speed_dependent_cutoff")
    assert thrice.standard_error[slope] > 0.85 * once.standard_error[slope]
    assert thrice.standard_error[gain] < 0.85 * once.standard_error[gain]


def test_few_participants_are_compared_by_blocks_or_not_at_all(seed: int) -> None:
    found = planned(design(participants=2), seed)
    assert (found.compared, found.units) == ("blocks", 8)
    assert any("2 participants, below 6" in note for note in found.notes)
    assert found.critical_t is not None
    one = planned(design(participants=1, tones_hz=(200.0,), forces_n=(0.4,)), seed)
    assert one.critical_t is None
    assert one.pairs == ()
    assert {each.shown for each in one.effects} == {"no"}
    assert any("Nothing can be tested" in note for note in one.notes)


def test_additions_keep_what_they_promise_at_the_cost_they_say(seed: int) -> None:
    found = planned(design(tones_hz=(150.0, 400.0, 900.0)), seed)
    helped = [one for one in found.pairs if one.cheapest is not None]
    assert helped
    for one in helped:
        assert abs(one.cheapest.reaches) < 0.9 < abs(one.cosine)  # type: ignore[union-attr]
    for each in found.effects:
        if each.cheapest is not None:
            assert each.cheapest.reaches < each.wanted
            assert each.detectable is None or each.cheapest.reaches < each.detectable
    delay = pair(found, "channel_delay", "fractional_rolloff")
    assert delay is not None
    assert delay.separable == "no"


@pytest.mark.parametrize("done", [False, True])
def test_additions_leave_what_is_there_and_are_paid_for(done: bool, seed: int) -> None:
    rng = np.random.default_rng(seed)
    blocked = design(order="speed blocks", speeds_mm_s=(60.0, 20.0), tones_hz=(100.0, 500.0))
    before = replace(programme_of(blocked, rng), done=done)
    for extra in EXTRAS:
        after = extra.change(before, rng)
        if after is None:
            continue
        paid = after.finger_s - before.finger_s
        assert (paid > 0.0) == (extra.id != "random_order")
        assert after.participants >= before.participants
        for old, new in zip(before.people, after.people, strict=False):
            here = [replace(trial, minutes=0.0) for trial in new]
            for trial in old:
                here.remove(replace(trial, minutes=0.0))
            if extra.id not in ("random_order", "people"):
                assert here
            if done:
                assert new[: len(old)] == old
            else:
                assert all(a.minutes < b.minutes for a, b in pairwise(new))


def test_weaker_drive_and_shorter_trials_show_less(seed: int) -> None:
    rng = np.random.default_rng(seed)
    usual = shown_by(programme_of(design(), rng), seed)
    weak = shown_by(programme_of(design(drive_vpp=(30.0,)), rng), seed)
    names = [each.effect for each in setup_of().candidates]
    for id_ in ("channel_delay", "residual_quadratic", "direction_asymmetry"):
        k = names.index(id_)
        assert weak.standard_error[k] > 1.5 * usual.standard_error[k]


def test_trials_without_drive_show_stick_slip(seed: int) -> None:
    rng = np.random.default_rng(seed)
    names = [each.effect for each in setup_of().candidates]
    slip = names.index("stick_slip")
    usual = shown_by(programme_of(design(), rng), seed)
    blank = shown_by(programme_of(design(blanks=2), rng), seed)
    assert blank.standard_error[slip] < usual.standard_error[slip]


def test_trials_too_short_for_their_tones_are_said(seed: int) -> None:
    found = planned(design(tones_hz=(2.0, 600.0, 900.0)), seed)
    note = next(note for note in found.notes if "long enough" in note)
    assert "2 Hz at 100 mm/s" in note


def test_the_mobility_is_planned_too(seed: int) -> None:
    found = planned(design(), seed, "mobility")
    ids = {one.id for one in found.effects}
    assert ids == {id_ for id_, each in EFFECTS.items() if each.response != "friction"}
    assert effect(found, "speed_dependent_mass").shown == "yes"
    assert len([one for one in found.effects if one.id == "second_mode"]) > 3


def test_the_documented_design_is_one() -> None:
    text = (Path(__file__).parents[4] / "docs" / "plan.md").read_text(encoding="utf-8")
    example = re.search(r"```json\n(.*?)```", text, re.DOTALL)
    assert example is not None
    assert FactorialDesign.model_validate_json(example[1]).order == "speed blocks"


def test_every_effect_has_a_size_to_be_shown() -> None:
    assert set(WANTED) == set(EFFECTS)
    for id_, size in WANTED.items():
        assert 0.0 < size <= EFFECTS[id_].parameters[0].high

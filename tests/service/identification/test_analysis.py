"""The whole identification, from observations to its document."""

import json
from dataclasses import replace

import numpy as np
import pytest
from tests.service.identification.observed import Bench, Finger, observations

from frictus_service.errors import Exclusion, NothingToIdentifyError
from frictus_service.identification.analysis import identify
from frictus_service.identification.documents import Identification, Settings
from frictus_service.identification.observation.response import TrialObservations

SMALL = Bench(
    tones_hz=(30.0, 90.0, 220.0, 450.0, 700.0, 2000.0),
    speeds=(20.0, 60.0, 100.0),
    forces=(0.3, 0.5),
    seconds=3.0,
)
QUICK = Settings(mixed_models=False, sweeps=False)


def people(n: int, rng: np.random.Generator) -> list[Finger]:
    return [
        Finger(
            gain_n=0.39 * np.exp(0.2 * rng.standard_normal()),
            cutoff_0_hz=386.0 + 60.0 * rng.standard_normal(),
            slope=13.8 + 1.5 * rng.standard_normal(),
            mass_slope=3.5e-5 * rng.uniform(0.8, 1.2),
            stiffness_slope=4.0 * rng.uniform(0.8, 1.2),
            delay_s=100e-6,
        )
        for _ in range(n)
    ]


@pytest.fixture
def seen(rng: np.random.Generator) -> list[TrialObservations]:
    return observations(people(6, rng), SMALL, rng)


def test_the_document_is_json_and_comes_back(seen: list[TrialObservations]) -> None:
    found = identify(seen, path="a.h5", sha256="0" * 64)
    text = found.to_json()
    json.loads(text, parse_constant=lambda name: pytest.fail(f"{name} in the document"))
    assert Identification.model_validate_json(text) == found
    assert json.loads(text)["schema"] == "identification/1"


def test_people_are_told_apart_from_effects(seen: list[TrialObservations]) -> None:
    found = identify(seen, settings=QUICK)
    by = {(test.parameter, test.effect): test for test in found.effects}
    assert len(by) == 15
    for name in ("cutoff", "mass", "stiffness"):
        assert by[name, "speed"].p_sign_flip == pytest.approx(2 / 2**6)
        p = by[name, "speed"].p
        assert p is not None
        assert p < 0.01
    assert found.population is not None
    means = {value.name: value.mean.value for value in found.population.values}
    assert means["slope_hz_per_mm_s"] == pytest.approx(
        by["cutoff", "speed"].value.value, rel=0.05
    )
    assert means["skew_s"] == pytest.approx(100e-6, abs=5e-6)
    assert {test.parameter for test in found.spreads} == {
        "gain",
        "cutoff",
        "mass",
        "damping",
        "stiffness",
    }


def test_relabelling_people_and_shuffling_trials_changes_nothing(
    seen: list[TrialObservations], rng: np.random.Generator
) -> None:
    names = sorted({item.info.participant for item in seen})
    others = dict(
        zip(names, rng.permutation([f"x{i}" for i in range(6)]).tolist(), strict=True)
    )
    moved = [
        replace(item, info=replace(item.info, participant=others[item.info.participant]))
        for item in rng.permutation(np.array(seen, dtype=object))
    ]
    one, two = identify(seen, settings=QUICK), identify(moved, settings=QUICK)
    assert one.population is not None
    assert two.population is not None
    for a, b in zip(one.population.values, two.population.values, strict=True):
        assert b.mean.value == pytest.approx(a.mean.value, rel=1e-6, abs=1e-12)
    for s, t in zip(one.effects, two.effects, strict=True):
        assert t.p == pytest.approx(s.p, rel=1e-3)


def test_only_effects_that_the_design_can_show_are_tested(rng: np.random.Generator) -> None:
    bench = replace(SMALL, speeds=(60.0,), forces=(0.3, 0.4, 0.5))
    found = identify(observations(people(6, rng), bench, rng), settings=QUICK)
    assert {test.effect for test in found.effects} == {"force"}
    assert not found.pairs


def test_one_speed_is_said_and_gain_and_cutoff_stay(rng: np.random.Generator) -> None:
    found = identify(observations(people(2, rng), replace(SMALL, speeds=(60.0,)), rng))
    assert "no speed law" in found.notes[0]
    for person in found.participants:
        assert person.friction is not None
        assert person.friction.law is None
        assert person.friction.without_law is not None
        ((speed, cutoff),) = person.friction.cutoff_at
        slid = [
            one.measured_speed_mm_s
            for one in found.conditions
            if one.participant == person.participant
        ]
        assert speed == pytest.approx(np.mean(slid))
        assert cutoff.value == pytest.approx(1214.0, rel=0.4)


def test_a_law_through_two_conditions_says_that_its_intervals_are_of_noise_alone(
    rng: np.random.Generator,
) -> None:
    two = replace(SMALL, speeds=(20.0, 100.0), forces=(0.4,))
    found = identify(observations(people(2, rng), two, rng), settings=QUICK)
    (said,) = [note for note in found.notes if "line through two conditions" in note]
    assert "P01, P02" in said
    more = identify(observations(people(2, rng), SMALL, rng), settings=QUICK)
    assert not any("line through two conditions" in note for note in more.notes)


def test_one_participant_has_intervals_but_no_population(rng: np.random.Generator) -> None:
    found = identify(observations([Finger()], SMALL, rng))
    assert found.population is None
    assert any("One participant" in note for note in found.notes)
    (person,) = found.participants
    assert person.friction is not None
    assert person.friction.law is not None
    assert person.friction.law.slope_hz_per_mm_s.ci95 is not None
    assert all(test.p is None for test in found.effects)


def test_few_participants_get_no_sign_flips(rng: np.random.Generator) -> None:
    found = identify(observations(people(5, rng), SMALL, rng), settings=QUICK)
    assert any("1/16" in note for note in found.notes)
    assert all(t.p is not None and t.p_sign_flip is None for t in found.effects)
    assert not found.pairs


def test_nothing_valid_is_a_clear_error(seen: list[TrialObservations]) -> None:
    bad = [replace(item, valid=False, reasons=("the finger rested",)) for item in seen]
    with pytest.raises(NothingToIdentifyError, match=r"none of 216 trials .* finger rested"):
        identify(bad)
    with pytest.raises(NothingToIdentifyError, match="no trial"):
        identify([])


def test_invalid_trials_are_listed_and_not_used(
    seen: list[TrialObservations], rng: np.random.Generator
) -> None:
    spoiled = list(seen)
    for at in rng.choice(len(seen), 10, replace=False):
        rows = seen[at].rows
        rows = replace(rows, friction_response=rows.friction_response * 100.0)
        spoiled[at] = replace(seen[at], valid=False, reasons=("too fast",), rows=rows)
    unreadable = [Exclusion("t1", "force_n", "is missing")]
    found = identify(spoiled, settings=QUICK, unreadable=unreadable)
    assert found.study.trials_used == len(seen) - 10
    assert found.study.trials == len(seen) + 1
    assert len(found.study.excluded) == 11
    assert found.study.excluded[0].reasons == ("force_n: is missing",)
    assert sum(count.used for count in found.study.counts) == len(seen) - 10


def test_what_lacks_normal_force_does_not_end_the_identification(
    seen: list[TrialObservations],
) -> None:
    """Neither a third of a sweep, nor a whole condition: that is left out, and said."""
    one = without_force(seen[0], slice(2))
    whole = identify(seen, settings=QUICK)
    found = identify([one, *seen[1:]], settings=QUICK)
    assert found.study.trials_used == whole.study.trials_used
    for test, other in zip(found.effects, whole.effects, strict=True):
        assert test.value.value == pytest.approx(other.value.value, rel=0.02)
    info = seen[0].info
    there = [
        (each.info.participant, each.info.speed_mm_s, each.info.force_n)
        == (info.participant, info.speed_mm_s, info.force_n)
        for each in seen
    ]
    less = [
        without_force(each, slice(None)) if lacks else each
        for each, lacks in zip(seen, there, strict=True)
    ]
    found = identify(less, settings=QUICK)
    assert len(found.conditions) == len(whole.conditions) - 1
    assert len(found.study.excluded) == sum(there)
    assert all("normal force" in each.reasons[0] for each in found.study.excluded)


def without_force(one: TrialObservations, rows: slice) -> TrialObservations:
    force = one.rows.normal_force_n.copy()
    force[rows] = np.nan
    return replace(one, rows=replace(one.rows, normal_force_n=force))


def test_an_outlier_is_named_kept_and_left_out_beside(rng: np.random.Generator) -> None:
    bench = replace(SMALL, forces=(0.2, 0.3, 0.4, 0.5), trial_gain=0.03)
    spoiled = []
    # Straight in the logarithm of the cutoff, too, which is what outliers are told by.
    flat = [Finger(cutoff_0_hz=1000.0, slope=3.0, delay_s=100e-6)] * 2
    for item in observations(flat, bench, rng):
        rows, info = item.rows, item.info
        if (info.participant, info.speed_mm_s, info.force_n) == ("P01", 60.0, 0.4):
            low = 1.0 / (1.0 + 1j * rows.tone_hz / 200.0)
            rows = replace(rows, friction_response=rows.friction_response * low)
        spoiled.append(replace(item, rows=rows))
    found = identify(spoiled, settings=QUICK)
    far = [c for c in found.conditions if "cutoff" in c.outlier]
    # Four deviations from the median are now and then reached by chance, too.
    assert ("P01", 60.0, 0.4) in [(c.participant, c.speed_mm_s, c.force_n) for c in far]
    assert len(far) <= 6
    friction = found.participants[0].friction
    assert friction is not None
    assert friction.law is not None
    assert friction.law_without_outliers is not None
    assert friction.law_without_outliers.gain_n != friction.law.gain_n
    assert any("far from" in note for note in found.notes)


def test_too_few_tones_are_listed_with_the_reason(seen: list[TrialObservations]) -> None:
    key = ("P01", 20.0, 0.3)
    kept = [
        item
        for item in seen
        if (item.info.participant, item.info.speed_mm_s, item.info.force_n) != key
        or item.info.tones_hz[0] < 100.0
    ]
    found = identify(kept, settings=QUICK)
    (short,) = (c for c in found.conditions if c.missing)
    assert (short.participant, short.speed_mm_s, short.force_n) == key
    assert short.friction is None
    assert short.missing[0] == "friction: 2 tones; accepted: 3 at least"


def test_no_skin_channel_is_friction_alone(seen: list[TrialObservations]) -> None:
    nothing = [
        replace(
            item,
            rows=replace(
                item.rows,
                mobility=np.full_like(item.rows.mobility, np.nan),
                mobility_variance=np.full_like(item.rows.mobility_variance, np.nan),
            ),
        )
        for item in seen
    ]
    found = identify(nothing, settings=QUICK)
    assert all(c.mobility is None for c in found.conditions)
    assert {test.parameter for test in found.effects} == {"gain", "cutoff"}
    assert not found.correlations
    assert any("No mobility" in note for note in found.notes)


def test_sweeps_are_fitted_by_direction(seen: list[TrialObservations]) -> None:
    found = identify(seen, settings=Settings(mixed_models=False))
    assert found.sweeps
    whole = {(c.participant, c.speed_mm_s, c.force_n): c.friction for c in found.conditions}
    for sweep in found.sweeps:
        assert sweep.direction == (1 if sweep.sweep % 2 == 0 else -1)
        friction = whole[sweep.participant, sweep.speed_mm_s, sweep.force_n]
        assert friction is not None
        assert sweep.cutoff_hz.value == pytest.approx(friction.cutoff_hz.value, rel=0.2)


def test_correlations_say_what_makes_them_weak(seen: list[TrialObservations]) -> None:
    found = identify(seen, settings=QUICK)
    assert len(found.correlations) == 6
    one = next(c for c in found.correlations if (c.first, c.second) == ("cutoff", "stiffness"))
    # Both follow the speed; what is left at equal speed is chance, among six people.
    assert one.pooled.r > 0.5
    assert one.pooled.p < 1e-3
    assert one.at_equal_speed is not None
    assert abs(one.at_equal_speed.r) < one.pooled.r
    assert len(one.per_participant) == 6
    text = " ".join(one.cautions)
    for reason in ("not independent", "Speed drives both", "common error", "6 participants"):
        assert reason in text

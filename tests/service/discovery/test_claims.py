"""A report claims no more than the data hold, and says what it could not do."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from tests.service.discovery.made import (
    MOUNT,
    PAPER_SKIN,
    Design,
    cause_in,
    found_in,
    made,
    named,
)

from frictus_service.discovery.evidence.spectra import NO_HARMONICS
from frictus_service.discovery.evidence.trial_evidence import TrialEvidence
from frictus_service.discovery.problem.base_models import base_model, simulator_of
from frictus_service.discovery.report.findings import verdict_sentence
from frictus_service.identification.observation.response import ResponseRows

pytestmark = pytest.mark.long

Factor = Callable[[ResponseRows], NDArray[Any]]


def changed(evidence: list[TrialEvidence], factor: Factor) -> list[TrialEvidence]:
    """Return evidence with friction responses multiplied."""
    found = []
    for one in evidence:
        rows = one.observed.rows
        rows = replace(rows, friction_response=rows.friction_response * factor(rows))
        found.append(replace(one, observed=replace(one.observed, rows=rows)))
    return found


def undriven(one: TrialEvidence) -> TrialEvidence:
    """Return a trial as it is without drive."""
    rows = one.observed.rows
    none = replace(
        rows, **{name: getattr(rows, name)[:0] for name in rows.__dataclass_fields__}
    )
    info = replace(one.observed.info, tones_hz=())
    return replace(
        one, observed=replace(one.observed, info=info, rows=none), harmonics=NO_HARMONICS
    )


def test_what_the_base_model_leaves_is_with_gain_and_cutoff_fitted(
    rng: np.random.Generator,
) -> None:
    """At 20 to 40 mm/s a constant cutoff, fitted there, is not far off: about 1.1 dB, not 2."""
    design = Design(speeds_mm_s=(20.0, 30.0, 40.0))
    found = found_in(made(rng, design=design), base=base_model("constant-cutoff", "friction"))
    assert "speed_dependent_cutoff" in named(found)
    assert found.gain is not None
    before, after = found.gain.residual_db
    assert 0.0 < before - after < 0.5
    before, after = found.gain.residual_deg
    assert 1.0 < before - after < 3.0


@pytest.mark.parametrize("people", [6, 7])
def test_six_people_are_enough_to_see_what_nothing_explains(
    people: int, rng: np.random.Generator
) -> None:
    evidence = changed(
        made(rng, design=Design(people)),
        lambda rows: np.where((rows.tone_hz == 217.0) & (rows.position_mm < 20.0), 1.3, 1.0),
    )
    found = found_in(evidence)
    assert all(cause.p_value <= 0.05 for cause in found.causes)
    assert found.verdict == "unexplained"
    assert {one.covariate for one in found.unexplained} == {"position"}


def test_a_cause_of_another_shape_claims_no_size_and_no_gain(rng: np.random.Generator) -> None:
    evidence = changed(
        made(rng), lambda rows: np.exp(0.1 * ((rows.position_mm - 35.0) / 20.0) ** 2)
    )
    found = found_in(evidence)
    cause = cause_in(found, "position_dependent_gain")
    assert (cause.verdict, cause.gain, cause.parameters) == ("family", None, {})
    assert cause.rivals == ()  # of a gain that is not claimed no rival keeps a share
    assert found.extended_model.effects == []
    assert found.verdict == "partly_explained"
    assert found.explained_share == 0.0


def test_what_is_not_told_apart_explains_nothing_yet(rng: np.random.Generator) -> None:
    found = found_in(made(rng, [("channel_delay", {"delay_s": 2e-5})], Design(1, repeats=4)))
    assert ("channel_delay", "fractional_rolloff") in [one.between for one in found.cannot_tell]
    assert found.verdict == "partly_explained"
    assert found.explained_share == 0.0
    assert "the data leave open why: either channel delay or" in verdict_sentence(found)
    assert "Nothing else is left" not in verdict_sentence(found)


def test_the_extended_model_holds_what_a_model_accepts(rng: np.random.Generator) -> None:
    """Exponents are accepted up to 2; beyond that a step more would change nothing."""
    evidence = changed(made(rng), lambda rows: (rows.normal_force_n / 0.4) ** 2.1)
    found = found_in(evidence)
    exponent = cause_in(found, "force_dependent_gain").parameters["exponent"]
    assert exponent.value == pytest.approx(2.1, abs=0.03)
    simulator_of(found.extended_model, MOUNT)
    (effect,) = [
        one for one in found.extended_model.effects if one.id == "force_dependent_gain"
    ]
    assert effect.parameters["exponent"] == 2.0
    assert any("exponent is found at" in note for note in found.notes)


@pytest.mark.parametrize("people", [1, 8])
def test_without_what_measures_the_skin_nothing_is_said_of_it(
    people: int, rng: np.random.Generator
) -> None:
    evidence = []
    for one in made(rng, base=PAPER_SKIN):
        rows = one.observed.rows
        if one.observed.info.participant < f"P{people:02}":
            rows = replace(rows, mobility=rows.mobility * np.nan)
        evidence.append(replace(one, observed=replace(one.observed, rows=rows)))
    found = found_in(evidence, base_model("paper", "mobility"))
    assert found.notes[0].startswith("Left out: P00")
    assert (found.verdict is None) == (people == 8)


def test_blanks_alone_say_nothing_of_the_response(rng: np.random.Generator) -> None:
    found = found_in([undriven(one) for one in made(rng)])
    assert found.verdict is None
    assert found.notes[0].endswith("no usable trial says anything of the friction response.")


def test_slow_strokes_without_drive_are_no_condition_to_predict(
    rng: np.random.Generator,
) -> None:
    slow = (5.0, 10.0, 20.0, 30.0)
    design = Design(speeds_mm_s=(*slow, 60.0, 100.0))
    evidence = made(rng, [("direction_asymmetry", {"share": 0.2})], design)
    found = found_in(
        [undriven(one) if one.observed.info.speed_mm_s in slow else one for one in evidence]
    )
    assert "direction_asymmetry" in named(found)
    assert found.unseen == ()


def test_a_trial_without_its_force_is_left_out(rng: np.random.Generator) -> None:
    first, *others = made(rng)
    rows, along = first.observed.rows, first.stretches
    rows = replace(rows, normal_force_n=rows.normal_force_n * np.nan)
    along = replace(along, normal_force_n=along.normal_force_n * np.nan)
    first = replace(first, observed=replace(first.observed, rows=rows), stretches=along)
    found = found_in([first, *others])
    assert found.study.trials_used == len(others)
    assert "1 of" in found.notes[0]

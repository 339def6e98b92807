"""What is said of evidence that no cause of the catalogue explains."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.blind.generator import Case, Hidden, Seeds, make_study
from tests.blind.generator import Design as Truth
from tests.service.discovery.made import MOUNT, Design, found_in, made

from frictus_hardware.physics.effects import KNOWN
from frictus_hardware.physics.simulator import Simulator
from frictus_service.discovery.beyond.draft import draft_cause
from frictus_service.discovery.beyond.grammar import grammar
from frictus_service.discovery.discover import discover_study
from frictus_service.discovery.document import Discovery
from frictus_service.discovery.problem.base_models import simulator_of
from frictus_service.discovery.report.findings import verdict_sentence
from frictus_service.discovery.report.page import render
from frictus_service.discovery.report.residuals import discrepancy_figure
from frictus_service.errors import DraftCauseError

pytestmark = [pytest.mark.long, pytest.mark.timeout(600)]
"""Each analyses a study, or two."""

TONES = tuple(np.round(np.geomspace(31.0, 1888.0, 12), 1).tolist())
MANY_TONES = Design(tones_hz=TONES, tones_per_trial=4, forces_n=(0.4,), repeats=1)
USUAL = Design(repeats=1)

HIDDEN = {
    "echo": ({"share": 0.15}, "delay_s", 0.0011, MANY_TONES),
    "gain_switch_by_time": ({"log_change": 0.4}, "threshold_min", 4.2, Design(repeats=2)),
}


@pytest.fixture(scope="module")
def resonance() -> Discovery:
    rng = np.random.default_rng(3)
    values = {"depth": 0.25, "frequency_hz": 200.0, "damping": 0.08}
    return found_in(made(rng, [("extra_resonance", values)], MANY_TONES))


@pytest.mark.parametrize("id_", HIDDEN)
def test_a_form_is_characterised_with_its_shape(id_: str, rng: np.random.Generator) -> None:
    values, name, true, design = HIDDEN[id_]
    found = found_in(made(rng, [(id_, {**values, name: true})], design))
    (form,) = found.characterised
    assert (form.id, form.verdict) == (id_, "characterised")
    estimate = form.parameters[name]
    assert estimate.ci95 is not None
    low, high = estimate.ci95
    assert low < estimate.value < high
    assert abs(true - estimate.value) <= 2.5 * max(high - estimate.value, estimate.value - low)
    assert form.ci95[0] > 0.0
    assert form.share > 0.5
    assert found.verdict in ("characterised", "partly_explained")


def test_a_form_enters_the_extended_model_and_is_not_looked_for_again(
    resonance: Discovery, rng: np.random.Generator
) -> None:
    (effect,) = resonance.extended_model.effects
    assert effect.id == "extra_resonance"
    assert resonance.causes == ()
    assert resonance.verdict == "characterised"
    assert len(simulator_of(resonance.extended_model, MOUNT).paths) == 1
    values = {"depth": 0.25, "frequency_hz": 200.0, "damping": 0.08}
    later = found_in(
        made(rng, [("extra_resonance", values)], MANY_TONES), resonance.extended_model
    )
    assert later.characterised == ()


def test_a_form_is_said_in_words_with_what_it_could_be(resonance: Discovery) -> None:
    (form,) = resonance.characterised
    for part in ("A resonance at ", "that the base model has not", "nats each", "could be"):
        assert part in form.statement
    assert "extra resonance (characterised)" in verdict_sentence(resonance)
    page = render(resonance)
    assert "characterised, not confirmed" in page
    assert "smooth discrepancy over frequency" in page


def test_the_smooth_discrepancy_is_drawn_beside_the_form(resonance: Discovery) -> None:
    smooth = resonance.discrepancy
    assert smooth is not None
    assert not smooth.in_model
    near = min(smooth.bins, key=lambda one: abs(one.tone_hz - 200.0))
    assert near.form_db is not None
    assert near.form_db == pytest.approx(20.0 * np.log10(1.25), abs=0.4)
    assert near.size_db > near.half_db > 0.0  # an octave spreads it out
    assert discrepancy_figure(smooth) is not None
    assert discrepancy_figure(None) is None


def test_a_cause_in_another_shape_keeps_its_name_and_the_form_has_its_size(
    rng: np.random.Generator,
) -> None:
    """At light force only: the power law leaves little, and yet is not the shape."""
    values = {"log_change": 0.6, "threshold_n": 0.28}
    design = Design(forces_n=(0.2, 0.25, 0.32, 0.4, 0.6), repeats=1)
    found = found_in(made(rng, [("cutoff_switch_by_force", values)], design))
    (form,) = found.characterised
    assert form.id in ("cutoff_switch_by_force", "cutoff_knee_below_force")
    assert found.explained_share == form.share > 0.5
    (cause,) = found.causes
    assert (cause.id, cause.verdict) == ("force_dependent_cutoff", "family")
    assert (cause.parameters, cause.gain) == ({}, None)
    assert found.verdict == "partly_explained"
    assert [effect.id for effect in found.extended_model.effects] == [form.id]


def test_a_cause_that_shows_beside_its_own_bend_has_not_the_shape_of_the_catalogue(
    rng: np.random.Generator,
) -> None:
    """A gain that rises at once and then slowly is no drift of so much a minute."""
    rises = {"log_change": 0.4, "threshold_min": 1.6}
    effects = [("gain_drift", {"per_minute": 0.1}), ("gain_switch_by_time", rises)]
    found = found_in(made(rng, effects, Design(repeats=2)))
    assert [form.id for form in found.characterised] == ["gain_switch_by_time"]
    assert [(cause.id, cause.verdict) for cause in found.causes] == [("gain_drift", "family")]
    assert found.verdict == "partly_explained"
    assert {effect.id for effect in found.extended_model.effects} == {
        "gain_drift",
        "gain_switch_by_time",
    }


def test_a_power_law_and_what_bends_it_back_are_one_bend_also_where_people_differ(
    tmp_path: Path,
) -> None:
    """Everybody's own power law leaves less than the bend, which is the same for all."""
    bend = Hidden("force_saturation", {"exponent": 0.58, "force_n": 0.476}, "unknown")
    design = Truth(8, n_tones=3, n_speeds=3, n_forces=5, seconds=1.5)
    found = _found_of(bend, design, 384590703, tmp_path)
    (form,) = found.characterised
    assert form.id == "gain_knee_above_force"
    exponent = form.parameters["exponent"]
    assert exponent.ci95 is not None
    assert exponent.ci95[0] <= -0.58 <= exponent.ci95[1]
    assert [(cause.id, cause.verdict) for cause in found.causes] == [
        ("force_dependent_gain", "family")
    ]
    assert found.unexplained == ()


def test_a_form_that_is_large_is_not_taken_for_the_noise_that_it_is_compared_by(
    tmp_path: Path,
) -> None:
    """Without the notch in the model its readings scatter more, and count less."""
    values = {"depth": 0.4, "frequency_hz": 215.0, "quality": 3.2}
    design = Truth(8, n_tones=15, n_speeds=3, n_forces=1, seconds=1.5)
    notch = Hidden("notch_at_speed", values, "unknown")
    found = _found_of(notch, design, 607202352, tmp_path)
    (form,) = found.characterised
    assert form.id == "extra_resonance"
    low, high = form.parameters["frequency_hz"].ci95 or (np.nan, np.nan)
    assert low <= 215.0 <= high
    assert form.parameters["depth"].value < 0.0 < form.parameters["by_speed"].value


def _found_of(hidden: Hidden, design: Truth, seed: int, folder: Path) -> Discovery:
    path = folder / "study.h5"
    make_study(path, Case("unknown", (hidden,), design), Seeds(seed, seed + 1))
    return discover_study(path, workers=0, seed=1)


def test_nothing_is_characterised_in_nothing(rng: np.random.Generator) -> None:
    found = [found_in(made(rng, (), USUAL)) for _ in range(3)]
    assert sum(bool(one.characterised) for one in found) <= 1


def test_a_draft_is_an_effect_and_a_cause_of_the_shape_that_was_found(
    resonance: Discovery,
) -> None:
    sources = draft_cause(resonance, "tape_resonance")
    spaces: list[dict[str, Any]] = []
    for path, source in sources.items():
        assert path.name == "tape_resonance.py"
        assert all(len(line) <= 96 for line in source.splitlines())
        space: dict[str, Any] = {}
        exec(compile(source, str(path), "exec"), space)
        spaces.append(space)
    (effect,), (cause,) = spaces[0]["EFFECTS"], spaces[1]["CAUSES"]
    assert effect.id == cause.id == "tape_resonance"
    values = {name: each.value for name, each in resonance.characterised[0].parameters.items()}
    dose = effect.parameters[0].name
    drafted = effect.extend(Simulator(), {dose: values[dose]})
    assert drafted == KNOWN["extra_resonance"].extend(Simulator(), values)


def test_drafts_that_cannot_be_are_refused(
    resonance: Discovery, rng: np.random.Generator
) -> None:
    with pytest.raises(DraftCauseError, match="no cause can be called 'Tape!'"):
        draft_cause(resonance, "Tape!")
    with pytest.raises(DraftCauseError, match="'stick_slip' is known already"):
        draft_cause(resonance, "stick_slip")
    with pytest.raises(DraftCauseError, match="nothing was characterised"):
        draft_cause(resonance.model_copy(update={"characterised": ()}), "tape_resonance")


def test_every_form_says_its_words_from_its_own_parameters() -> None:
    for form in grammar():
        names = {each.name for each in KNOWN[form.id].parameters}
        shown = dict.fromkeys([*names, "kind", "following"], "x")
        assert "{" not in form.what.format_map(shown)
        assert all(name in names for held in form.grid for name, _ in held)
        assert set(form.shapes) <= names

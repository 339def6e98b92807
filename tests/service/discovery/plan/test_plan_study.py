"""A plan beside a study: planned and found standard errors; and the command."""

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from tests.blind.generator import Case, Seeds, make_study
from tests.blind.generator import Design as Truth
from threadpoolctl import threadpool_limits
from typer.testing import CliRunner

from frictus_service.cli.app import app
from frictus_service.cli.options import Exit
from frictus_service.discovery.evidence.evidence_rows import subjects_of
from frictus_service.discovery.evidence.observation_table import rows_of, units_of, used
from frictus_service.discovery.evidence.trial_evidence import TrialEvidence, study_evidence
from frictus_service.discovery.inference.linear_model import ProjectedUnits, project_out
from frictus_service.discovery.inference.linearisation import linearise
from frictus_service.discovery.inference.significance import standard_error
from frictus_service.discovery.plan.ability import ability_of
from frictus_service.discovery.plan.assumptions import assumed
from frictus_service.discovery.plan.documents import FactorialDesign, Plan, Setup, read_design
from frictus_service.discovery.plan.programme import programme_of
from frictus_service.discovery.plan.rows import expected
from frictus_service.discovery.plan.run import of_study
from frictus_service.discovery.problem.base_models import base_model, simulator_of
from frictus_service.discovery.problem.candidates import candidates_of
from frictus_service.discovery.problem.problem import DiscoveryProblem
from frictus_service.study.importers import open_study

pytestmark = pytest.mark.campaign

TRUTH = Truth(participants=6, n_tones=4, n_speeds=3, n_forces=2)
OF_CONDITIONS = {"speed_dependent_gain", "speed_dependent_cutoff", "gain_drift"}


class Study:
    """A simulated study without effects, and what `discover` makes of it."""

    def __init__(self, path: Path) -> None:
        self.path = path
        with open_study(path) as study:
            mount, trials = study.info.mount, study.trials
            self.seconds = {one.id: study.n_samples(one.id) / 20_000.0 for one in trials}
        base = simulator_of(base_model("paper", "friction"), mount)
        self.setup = Setup(base, mount, "friction", tuple(candidates_of("friction")))
        self.evidence: list[TrialEvidence] = used(
            study_evidence(path, workers=1, cache=path.parent)
        )
        rows = rows_of(self.evidence, units_of(self.evidence, "friction"), "friction")
        subjects = tuple(subjects_of(rows, TRUTH.participants))
        problem = DiscoveryProblem(base, mount, "friction", subjects, self.setup.candidates, ())
        with threadpool_limits(limits=1):
            self.found: ProjectedUnits = project_out(linearise(problem, ()).units)
        infos = [one.observed.info for one in self.evidence]
        self.design = FactorialDesign(
            participants=TRUTH.participants,
            tones_hz=tuple(sorted({tone for info in infos for tone in info.tones_hz})),
            speeds_mm_s=tuple(sorted({info.speed_mm_s for info in infos})),
            forces_n=tuple(sorted({info.force_n for info in infos})),
            seconds=TRUTH.seconds,
        )


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory, module_seed: int) -> Iterator[Study]:
    path = tmp_path_factory.mktemp("plan") / "null.h5"
    make_study(path, Case("null", (), TRUTH), Seeds(module_seed, module_seed + 1))
    yield Study(path)
    path.unlink()


def test_a_design_promises_the_noise_that_is_found(
    study: Study, rng: np.random.Generator
) -> None:
    known = assumed("friction", study.setup.candidates)
    with threadpool_limits(limits=1):
        units = expected(programme_of(study.design, rng), study.setup, known, rng)
    promised = project_out(units).information.mean(axis=0)
    found = study.found.information.mean(axis=0)
    assert np.array_equal(promised > 0.0, found > 0.0)
    seen = np.flatnonzero(found)
    ratio = np.sqrt(promised[seen] / found[seen])
    said = {study.setup.candidates[k].effect: r for k, r in zip(seen, ratio, strict=True)}
    assert 1 / 1.5 < np.median(ratio) < 1.5, said
    assert np.all((ratio > 1 / 2.5) & (ratio < 2.5)), said


def test_a_study_as_design_promises_the_errors_that_are_found(
    study: Study, rng: np.random.Generator
) -> None:
    with threadpool_limits(limits=1):
        programme, estimated = of_study(study.evidence, study.seconds, study.setup)
        ability = ability_of(programme, study.setup, estimated, int(rng.integers(2**31)))
    assert ability is not None
    assert programme.done
    assert ability.n_units == TRUTH.participants
    assert 45.0 < programme.span_mm < 65.0
    assert programme.trial_every_s == pytest.approx(20.0)
    found = standard_error(study.found.estimates, study.found.information)
    assert np.array_equal(np.isfinite(ability.standard_error), np.isfinite(found))
    seen = np.flatnonzero(np.isfinite(found))
    ratio = ability.standard_error[seen] / found[seen]
    said = {study.setup.candidates[k].effect: r for k, r in zip(seen, ratio, strict=True)}
    assert np.all(ratio > 1 / 1.5), said
    # Where not the scatter but the accuracy of measuring sets the limit, readings scatter less
    # than that, and so do estimates.
    scattering = found[seen] > study.found.accuracy[seen] / 4.0
    assert scattering.sum() > 5
    assert np.all(ratio[scattering] < 1.5), said
    assert np.all(ratio < 2.5), said


def run(*words: str | Path) -> tuple[int, str, str]:
    result = CliRunner().invoke(app, ["plan", *map(str, words)])
    return result.exit_code, result.stdout, result.stderr


def test_the_command_plans_with_a_study(study: Study, tmp_path: Path) -> None:
    out = tmp_path / "plan.json"
    options = ("--seed", 3, "--workers", 0, "--cache", study.path.parent, "--out", out)
    code, told, progress = run(study.path, *map(str, options))
    assert code == 0, progress
    found = Plan.model_validate_json(out.read_bytes())
    assert json.loads(told) == json.loads(out.read_bytes())
    assert (found.participants, found.seed) == (TRUTH.participants, 3)
    assert "of this study" in found.assumptions
    assert "further trials" in progress


def test_the_command_plans_with_a_design(study: Study, tmp_path: Path) -> None:
    path = tmp_path / "design.json"
    path.write_text(study.design.model_dump_json(by_alias=True), encoding="utf-8")
    assert read_design(path) == study.design
    code, told, progress = run(path, "--want", "gain_drift=1e-4", "--json")
    assert code == 0, progress
    drift = next(one for one in json.loads(told)["effects"] if one["id"] == "gain_drift")
    assert (drift["wanted"], drift["shown"]) == (1e-4, "larger only")


@pytest.mark.parametrize(
    ("text", "options", "said"),
    [
        ("{", (), "no design/1 document"),
        ('{"participants": 8}', (), "tones_hz"),
        (None, (), "no design"),
        ("{}", ("--want", "gain_drift"), "EFFECT=SIZE"),
        ("{}", ("--want", "nothing=1"), "no effect 'nothing'"),
        ("{}", ("--want", "gain_drift=9"), "above 0, up to 1"),
        ("{}", ("--want", "gain_drift=nan"), "above 0, up to 1"),
        ("{}", ("--base", "nowhere.json"), "no base model"),
    ],
)
def test_what_cannot_be_planned_with_is_said(
    text: str | None, options: tuple[str, ...], said: str, tmp_path: Path
) -> None:
    path = tmp_path / "design.json"
    if text is not None:
        path.write_text(text, encoding="utf-8")
    code, _, told = run(path, *options)
    assert code == Exit.USAGE
    assert said in " ".join(told.split())


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"tones_hz": (100.0, 100.0)}, "every level once"),
        ({"tones_per_trial": 3}, "tones_per_trial is 3"),
        ({"trial_every_s": 2.0}, "trial_every_s is 2"),
        ({"repeats": 100, "speeds_mm_s": tuple(range(1, 41))}, "trials for each"),
        ({"drive_vpp": (200.0,)}, "150"),
    ],
)
def test_designs_that_nobody_can_run_are_refused(changes: dict[str, object], said: str) -> None:
    usual: dict[str, object] = {
        "participants": 8,
        "tones_hz": (100.0, 500.0),
        "speeds_mm_s": (60.0,),
        "forces_n": (0.4,),
    }
    with pytest.raises(ValueError, match=said):
        FactorialDesign.model_validate(usual | changes)

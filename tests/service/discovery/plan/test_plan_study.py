"""A plan beside studies: planned and found standard errors; and the command."""

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from tests.blind.generator import Design as Truth
from tests.blind.null_studies import NullStudy, make, root_mean_square
from threadpoolctl import threadpool_limits
from typer.testing import CliRunner

from frictus_hardware.arrays import FloatArray, IntArray
from frictus_service.cli.app import app
from frictus_service.cli.options import Exit
from frictus_service.discovery.inference.linear_model import project_out
from frictus_service.discovery.plan.ability import ability_of
from frictus_service.discovery.plan.assumptions import assumed
from frictus_service.discovery.plan.documents import FactorialDesign, Plan, read_design
from frictus_service.discovery.plan.programme import programme_of
from frictus_service.discovery.plan.rows import expected

pytestmark = [pytest.mark.campaign, pytest.mark.timeout(600)]

TRUTH = Truth(participants=6, n_tones=4, n_speeds=3, n_forces=2)
STUDIES = 6
"""A standard error of six people is itself uncertain by a third."""


@pytest.fixture(scope="module")
def studies(
    tmp_path_factory: pytest.TempPathFactory, module_seed: int
) -> Iterator[list[NullStudy]]:
    paths = [tmp_path_factory.mktemp("plan") / "study" / "null.h5" for _ in range(STUDIES)]
    for number, path in enumerate(paths):
        make(path, TRUTH, "friction", module_seed + 2 * number)
    yield [NullStudy.of(path, TRUTH, "friction") for path in paths]
    for path in paths:
        path.unlink()


@pytest.fixture(scope="module")
def study(studies: list[NullStudy]) -> NullStudy:
    return studies[0]


def by_effect(study: NullStudy, seen: IntArray, ratio: FloatArray) -> dict[str, float]:
    names = [study.setup.candidates[k].effect for k in seen]
    return dict(zip(names, ratio.tolist(), strict=True))


def test_a_design_promises_the_noise_that_is_found(
    studies: list[NullStudy], rng: np.random.Generator
) -> None:
    """How well each person's effects are known, beside how people differ."""
    study = studies[0]
    known = assumed("friction", study.setup.candidates)
    with threadpool_limits(limits=1):
        met = expected(programme_of(study.design, rng), study.setup, known, rng)
    promised = project_out(met.units).information.mean(axis=0)
    # By how much six people differ is itself known to a third: over several studies.
    every = np.array([each.found.information.mean(axis=0) for each in studies])
    assert np.all((promised > 0.0) == (every > 0.0))
    seen = np.flatnonzero(promised)
    found = 1.0 / np.mean(1.0 / every[:, seen], axis=0)
    ratio = np.sqrt(promised[seen] / found)
    said = by_effect(study, seen, ratio)
    assert 1 / 1.5 < np.median(ratio) < 1.5, said
    assert np.all((ratio > 1 / 2.5) & (ratio < 2.5)), said


def test_a_design_promises_the_errors_that_are_found(
    studies: list[NullStudy], rng: np.random.Generator
) -> None:
    seed = int(rng.integers(2**31))
    found = np.array([each.found_error for each in studies])
    promised = np.array([each.promised_error(seed) for each in studies])
    assert np.array_equal(np.isfinite(promised), np.isfinite(found))
    _as_found(studies[0], root_mean_square(promised), root_mean_square(found))


def test_a_study_as_design_promises_the_errors_that_are_found(
    studies: list[NullStudy], rng: np.random.Generator
) -> None:
    promised = []
    for each in studies:
        programme, estimated = each.as_design
        with threadpool_limits(limits=1):
            ability = ability_of(programme, each.setup, estimated, int(rng.integers(2**31)))
        assert ability is not None
        assert programme.done
        assert ability.n_units == TRUTH.participants
        assert 45.0 < programme.span_mm < 65.0
        assert programme.trial_every_s == pytest.approx(20.0)
        promised.append(ability.standard_error)
    found = np.array([each.found_error for each in studies])
    assert np.array_equal(np.isfinite(promised), np.isfinite(found))
    _as_found(studies[0], root_mean_square(np.array(promised)), root_mean_square(found))


def _as_found(study: NullStudy, promised: FloatArray, found: FloatArray) -> None:
    seen = np.flatnonzero(np.isfinite(found))
    ratio = promised[seen] / found[seen]
    said = by_effect(study, seen, ratio)
    assert np.all(ratio > 1 / 1.5), said
    assert np.all(ratio < 1.5), said


def run(*words: str | Path) -> tuple[int, str, str]:
    result = CliRunner().invoke(app, ["plan", *map(str, words)])
    return result.exit_code, result.stdout, result.stderr


def test_the_command_plans_with_a_study(study: NullStudy, tmp_path: Path) -> None:
    out = tmp_path / "plan.json"
    options = ("--seed", 3, "--workers", 0, "--cache", study.path.parent, "--out", out)
    code, told, progress = run(study.path, *map(str, options))
    assert code == 0, progress
    found = Plan.model_validate_json(out.read_bytes())
    assert json.loads(told) == json.loads(out.read_bytes())
    assert (found.participants, found.seed) == (TRUTH.participants, 3)
    assert "of this study" in found.assumptions
    assert "further trials" in progress


def test_the_command_plans_with_a_design(study: NullStudy, tmp_path: Path) -> None:
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
        ('{"second": 2}', (), "tones_hz: Field required; speeds_mm_s: Field required; and 2"),
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

"""`frictus identify` on a real file: study in, report, document and models out."""

import json
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from typer.testing import CliRunner

from frictus.model import Model
from frictus_laboratory.reproduction.plan import StudyConditions, plan_study
from frictus_laboratory.reproduction.population import draw_people
from frictus_laboratory.reproduction.reproduce import record_study
from frictus_service.cli.app import app

DESIGN = StudyConditions(
    tones_hz=(60.0, 150.0, 300.0, 600.0, 1200.0),
    speeds_mm_s=(40.0, 100.0),
    forces_n=(0.4,),
    seconds=1.2,
    delay_s=100e-6,
)
LIFTED = "P01-0003"


@pytest.fixture
def study(rng: np.random.Generator, tmp_path: Path) -> Path:
    plans = plan_study(draw_people(2, rng), DESIGN, rng)
    plans = [
        replace(plan, fault="lifted") if plan.info.id == LIFTED else plan for plan in plans
    ]
    path = tmp_path / "study.h5"
    record_study(path, plans)
    return path


def run(*words: str) -> tuple[int, str, str]:
    result = CliRunner().invoke(app, ["identify", *words])
    return result.exit_code, result.stdout, result.stderr


def test_from_study_to_models(study: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    code, told, progress = run(str(study), "--out", str(out), "--workers", "0", "--json")
    assert code == 0, progress
    found = json.loads(told)
    assert found["study"]["simulated"] is True
    excluded = [trial["trial"] for trial in found["study"]["excluded"]]
    assert LIFTED in excluded
    assert found["study"]["trials"] == 20 == found["study"]["trials_used"] + len(excluded)
    laws = [person["friction"]["law"] for person in found["participants"]]
    for law in laws:
        delay = law["delay_s"]
        assert abs(delay["value"] - 100e-6) < 10e-6 + 4.0 * (delay["standard_error"] or 0.0)
    whole = json.loads((out / "identification.json").read_bytes())
    assert len(whole["conditions"]) == 4
    models = [Model.model_validate_json(path.read_bytes()) for path in out.glob("models/*")]
    assert {model.participant for model in models} == {"P01", "P02", None}
    assert all(model.provenance["study_sha256"] == found["study"]["sha256"] for model in models)
    assert all(model.simulated for model in models)
    assert "<html" in (out / "report.html").read_text(encoding="utf-8")
    # What was observed is known the next time, and nothing else changes.
    _, again, progress = run(str(study), "--out", str(out), "--workers", "0", "--json")
    assert "20 of them known already" in progress
    assert json.loads(again) == found


def test_no_valid_trial_is_a_sentence_and_a_code(study: Path, tmp_path: Path) -> None:
    with h5py.File(study, "r+") as file:
        for trial in file["trials"].values():
            trial.attrs["speed_mm_s"] = 300.0
    code, told, progress = run(str(study), "--out", str(tmp_path / "o"), "--workers", "0")
    assert code == 2
    assert not told
    assert "frictus: none of 20 trials" in progress
    assert not (tmp_path / "o").exists()


def turn(study: Path, name: str) -> None:
    """Turn the sign of a channel of all trials."""
    with h5py.File(study, "r+") as file:
        for trial in file["trials"].values():
            trial.attrs.pop("sha256", None)
            samples = trial[name]
            if "scale" in samples.attrs:
                samples.attrs["scale"] = -samples.attrs["scale"]
            else:
                samples[...] = -samples[...]


def test_a_turned_force_is_a_sentence_and_a_code(study: Path, tmp_path: Path) -> None:
    turn(study, "force_n")
    code, told, progress = run(str(study), "--out", str(tmp_path / "o"), "--workers", "0")
    assert code == 2
    assert not told
    assert "nothing was fitted" in progress
    assert "force_n" in progress
    assert not (tmp_path / "o" / "report.html").exists()
    assert not (tmp_path / "o" / "models").exists()


@pytest.mark.long
def test_a_turned_accelerometer_leaves_friction(study: Path, tmp_path: Path) -> None:
    options = ("--workers", "0", "--json")
    _, right, _ = run(str(study), "--out", str(tmp_path / "right"), *options)
    turn(study, "accel_m_s2")
    code, told, _ = run(str(study), "--out", str(tmp_path / "turned"), *options)
    assert code == 0
    before, after = json.loads(right), json.loads(told)
    assert "Nothing was fitted to the skin" in after["notes"][0]
    assert "velocity or force has the wrong sign" in after["notes"][1]
    assert "turn accel_m_s2 or skin_velocity_m_s along x" in after["notes"][1]
    for was, now in zip(before["participants"], after["participants"], strict=True):
        assert now["friction"] == was["friction"]
        assert was["mobility"] is not None
        assert now["mobility"] is None


def test_a_file_that_is_no_study_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "study.h5"
    path.write_bytes(b"not HDF5")
    code, _, progress = run(str(path))
    assert code == 2
    assert progress.startswith("frictus: ")

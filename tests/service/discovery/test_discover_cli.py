"""`frictus discover`: what it asks, prints and leaves behind."""

import json
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from tests.service.discovery.found import discovery
from typer.testing import CliRunner

from frictus_service.cli.app import app
from frictus_service.discovery.document import Discovery
from frictus_service.errors import StudyError


@pytest.fixture
def asked(rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """What the analysis was asked; it answers with a discovery, or refuses `bad.h5`."""
    calls: dict[str, Any] = {}

    def discover_study(path: Path, **options: Any) -> Discovery:
        calls.update(options, path=path)
        options["tell"]("looking")
        if path.name == "bad.h5":
            raise StudyError("bad.h5: no trial can be read")
        found = discovery(rng)
        return found.model_copy(update={"verdict": None}) if path.name == "few.h5" else found

    stand_in = ModuleType("frictus_service.discovery.discover")
    stand_in.discover_study = discover_study  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, stand_in.__name__, stand_in)
    return calls


def run(*words: str) -> tuple[int, str, str]:
    result = CliRunner().invoke(app, ["discover", *words])
    return result.exit_code, result.stdout, result.stderr


def test_from_study_to_report(asked: dict[str, Any], tmp_path: Path) -> None:
    study, out, model = (str(tmp_path / name) for name in ("a.h5", "out", "mine.json"))
    options = ("--response", "mobility", "--base", model, "--seed", "5", "--workers", "0")
    code, told, progress = run(study, "--out", out, *options, "--cluster", "tcp://x")
    assert code == 0, progress
    assert "looking" in progress
    tell = asked.pop("tell")
    assert callable(tell)
    assert asked == {
        "path": Path(study),
        "response": "mobility",
        "base": model,
        "seed": 5,
        "workers": 0,
        "cache": Path(out) / "observations",
        "cluster": "tcp://x",
    }
    printed = json.loads(told)
    assert printed["verdict"] == "explained"
    assert {Path(file).name for file in printed.pop("files")} == {
        "report.html",
        "report.json",
        "extended_model.json",
    }
    whole = json.loads((tmp_path / "out" / "report.json").read_bytes())
    assert {name: whole[name] for name in printed} == printed


def test_the_folder_is_named_after_the_study(asked: dict[str, Any], tmp_path: Path) -> None:
    code, _, _ = run(str(tmp_path / "a.h5"), "--cache", str(tmp_path / "kept"))
    assert code == 0
    assert (tmp_path / "a-discovery" / "report.html").is_file()
    assert asked["cache"] == tmp_path / "kept"
    assert (asked["response"], asked["base"], asked["seed"]) == ("friction", "paper", None)


@pytest.mark.usefixtures("asked")
def test_where_nothing_was_tested_there_is_no_extended_model(tmp_path: Path) -> None:
    out = tmp_path / "out"
    code, _, _ = run(str(tmp_path / "a.h5"), "--out", str(out))
    assert code == 0
    assert (out / "extended_model.json").is_file()
    code, told, progress = run(str(tmp_path / "few.h5"), "--out", str(out))
    assert code == 2
    assert progress.splitlines()[-1].startswith("frictus: nothing was tested")
    printed = json.loads(told)
    assert printed["verdict"] is None
    assert {Path(file).name for file in printed["files"]} == {"report.html", "report.json"}
    assert not (out / "extended_model.json").exists()
    assert "<td>extended</td>" not in (out / "report.html").read_text(encoding="utf-8")


@pytest.mark.usefixtures("asked")
def test_what_cannot_be_used_is_a_sentence_and_a_code(tmp_path: Path) -> None:
    code, _, told = run(str(tmp_path / "bad.h5"))
    assert code == 2
    assert told.splitlines()[-1] == "frictus: bad.h5: no trial can be read"
    assert not (tmp_path / "bad-discovery").exists()
    code, _, told = run(str(tmp_path / "a.h5"), "--response", "heat")
    assert code == 2
    code, _, told = run(str(tmp_path / "a.h5"), "--draft-cause", "No Name")
    assert code == 2
    assert "no cause can be called 'No Name'" in told


@pytest.mark.usefixtures("asked")
def test_where_there_is_nothing_to_draft_the_rest_is_told(tmp_path: Path) -> None:
    code, told, progress = run(str(tmp_path / "a.h5"), "--draft-cause", "tape_resonance")
    assert code == 2
    assert json.loads(told)["verdict"] == "explained"
    assert progress.splitlines()[-1].startswith("frictus: nothing was characterised")

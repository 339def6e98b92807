"""`frictus paper` from options to files, at a small size."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from frictus_laboratory.reproduction import reproduce
from frictus_laboratory.reproduction.paper import HEADINGS
from frictus_laboratory.reproduction.reproduce import QUICK
from frictus_service.cli.app import app
from frictus_service.cli.options import Exit
from frictus_service.identification.documents import Identification

FEW = replace(
    QUICK,
    tones_hz=(40.0, 80.0, 150.0, 300.0, 500.0, 750.0, 2000.0),
    speeds_mm_s=(30.0, 90.0),
    forces_n=(0.4,),
    bad_share=0.0,
)


@pytest.mark.long
def test_what_is_shown_is_what_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, rng: np.random.Generator
) -> None:
    monkeypatch.setattr(reproduce, "QUICK", FEW)
    kept, seed = tmp_path / "kept", int(rng.integers(2**32))
    options = ["--participants", "2", "--seconds", "1", "--seed", f"{seed}", "--workers", "0"]
    done = CliRunner().invoke(app, ["paper", *options, "--out", f"{kept}", "--json"])
    assert done.exit_code == Exit.OK, done.stderr
    (line,) = done.stdout.splitlines()
    told = json.loads(line)
    assert told["seed"] == seed
    assert told["account"].startswith("2 participants, 28 trials, ")
    table = (kept / "table.md").read_text(encoding="utf-8").splitlines()
    assert [cell.strip() for cell in table[0].strip("|").split("|")] == list(HEADINGS)
    assert len(table) == 2 + len(told["rows"])
    document = (kept / "identification.json").read_bytes()
    assert Identification.model_validate_json(document).study.trials == 28
    assert (kept / "study.h5").exists()
    again = CliRunner().invoke(app, ["paper", *options, "--out", f"{kept}"])
    assert (again.exit_code, "study.h5" in again.stderr) == (Exit.USAGE, True)

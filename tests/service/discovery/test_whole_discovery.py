"""From the raw samples of a study to the report: nothing stands in for anything."""

import json
from pathlib import Path

import numpy as np
from tests.blind.generator.case import Case, Design, Hidden
from tests.blind.generator.study import Seeds, make_study
from typer.testing import CliRunner

from frictus.model import Model
from frictus_service.cli.app import app
from frictus_service.discovery.document import Discovery

SHARE = 0.15
HIDDEN = (Hidden("direction_asymmetry", {"share": SHARE}),)
DESIGN = Design(participants=6, n_tones=3, n_speeds=2, n_forces=1, tones_per_trial=3)


def test_a_hidden_effect_is_in_the_report(tmp_path: Path, rng: np.random.Generator) -> None:
    study, out = tmp_path / "study.h5", tmp_path / "found"
    drawn = Seeds(*(int(seed) for seed in rng.integers(2**31, size=2)))
    make_study(study, Case("test", HIDDEN, DESIGN), drawn)
    words = ["discover", str(study), "--out", str(out), "--seed", "7", "--workers", "0"]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, done.output
    text = (out / "report.json").read_bytes()
    found = Discovery.model_validate_json(text)
    assert json.loads(text)["schema"] == "discovery/1"
    assert found.seed == 7
    assert found.study.trials == 36
    assert found.study.trials_used > 24
    assert found.evidence is not None
    assert found.evidence.held_out == "participants"
    (asymmetry,) = [each for each in found.causes if each.id == "direction_asymmetry"]
    share = asymmetry.parameters["share"].value
    assert abs(share - SHARE) < 0.03
    assert found.gain is not None
    assert found.gain.residual_db[1] < found.gain.residual_db[0]
    page = (out / "report.html").read_text("utf-8")
    assert asymmetry.statement[:40] in page
    model = Model.model_validate_json((out / "extended_model.json").read_bytes())
    assert model == found.extended_model
    assert "direction_asymmetry" in [effect.id for effect in model.effects]

"""One swipe of one person says what explains it, for itself alone, and refuses copies."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.blind.generator.case import Hidden
from tests.blind.generator.recording import Recording, Source, make_recording
from typer.testing import CliRunner

from frictus_service.cli.app import app
from frictus_service.discovery.document import Discovery, OneRecording
from frictus_service.discovery.one_recording.analysis import rank_recording
from frictus_service.discovery.problem.base_models import ResponseName, base_model
from frictus_service.study.importers import open_study
from frictus_service.study.writer import StudyWriter

DELAY_S = 2.5e-4
LATE = Recording("texture", 2.0, Hidden("channel_delay", {"delay_s": DELAY_S}))


def ranked(
    path: Path, response: ResponseName = "mobility"
) -> tuple[OneRecording | None, tuple[str, ...]]:
    return rank_recording(path, base_model("paper", response), lambda line: None)


@pytest.fixture(scope="module")
def late(tmp_path_factory: pytest.TempPathFactory, module_seed: int) -> Path:
    path = tmp_path_factory.mktemp("late") / "swipe.h5"
    make_recording(path, LATE, module_seed)
    return path


@pytest.mark.long
def test_a_swipe_says_that_its_channels_are_apart(late: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    asked = ["discover", str(late), "--response", "mobility", "--workers", "0"]
    done = CliRunner().invoke(app, [*asked, "--out", str(out)])
    assert done.exit_code == 0, done.output
    assert "In this recording only, a delay of 0.2" in done.output
    assert not (out / "extended_model.json").exists()
    found = Discovery.model_validate_json((out / "report.json").read_bytes())
    one = found.one_recording
    assert found.verdict is None
    assert not found.causes
    assert one is not None
    assert one.beyond_threshold
    assert one.models[0].causes == ("channel_delay",)
    delay = one.models[0].parameters["channel_delay"]["delay_s"]
    assert delay.value == pytest.approx(DELAY_S, rel=0.004)
    assert delay.ci95 is not None
    assert delay.ci95[0] < delay.value < delay.ci95[1] < 1.05 * DELAY_S
    assert one.statement.startswith("In this recording only, a delay of 0.2")
    assert "It would be confirmed by" in one.statement
    page = (out / "report.html").read_text()
    assert "What ranks first in this recording only" in page
    assert "p, corrected" not in page


def test_where_nothing_is_driven_the_other_response_is_pointed_at(late: Path) -> None:
    found, notes = ranked(late, "friction")
    assert found is None
    assert "No ranking of one recording: 0 windows" in notes[-1]
    assert "--response mobility" in notes[-1]


@pytest.mark.long
def test_copies_and_overlaps_add_nothing(late: Path, tmp_path: Path) -> None:
    with open_study(late) as study:
        trial, info = study.read(study.trials[0].id), study.info
    assert trial.skin_velocity_m_s is not None
    late_half = slice(trial.force_n.shape[0] // 2, None)
    inside = trial.position_t_s >= 1.0
    half = replace(
        trial,
        info=replace(trial.info, id="half", order=2),
        force_n=trial.force_n[late_half],
        skin_velocity_m_s=trial.skin_velocity_m_s[late_half],
        position_mm=trial.position_mm[inside],
        position_t_s=trial.position_t_s[inside] - 1.0,
    )
    path = tmp_path / "copied.h5"
    with StudyWriter(path, info) as writer:
        writer.add(trial)
        writer.add(replace(trial, info=replace(trial.info, id="again", order=1)))
        writer.add(half)
    alone, _ = ranked(late)
    copied, notes = ranked(path)
    assert alone is not None
    assert copied is not None
    assert len(copied.refused) == 2
    assert sum(note.startswith("Not independent: trial") for note in notes) == 2
    assert copied.windows == alone.windows
    assert copied.models[0].heldout_loglik == pytest.approx(alone.models[0].heldout_loglik)


@pytest.mark.parametrize(
    ("source", "response"), [("texture", "mobility"), ("drive", "friction")]
)
def test_nothing_hidden_leaves_the_base_model_first(
    source: Source, response: ResponseName, tmp_path: Path, seed: int
) -> None:
    path = tmp_path / "plain.h5"
    make_recording(path, Recording(source, 2.0), seed)
    found, _ = ranked(path, response)
    assert found is not None
    assert not found.beyond_threshold
    assert found.models[0].causes == ()
    assert "no cause explains more" in found.statement


@pytest.mark.parametrize(
    ("source", "response"), [("texture", "mobility"), ("drive", "friction")]
)
def test_a_channel_that_is_early_is_no_roll_off(
    source: Source, response: ResponseName, tmp_path: Path, seed: int
) -> None:
    """As of a converter that takes one channel after the other, or a slow amplifier."""
    path = tmp_path / "early.h5"
    hidden = Hidden("channel_delay", {"delay_s": -1e-4})
    make_recording(path, Recording(source, 2.0, hidden), seed)
    found, _ = ranked(path, response)
    assert found is not None
    assert found.models[0].causes == ("channel_delay",)
    delay = found.models[0].parameters["channel_delay"]["delay_s"]
    assert delay.value == pytest.approx(-1e-4, rel=0.1)
    assert delay.ci95 is not None
    assert delay.ci95[1] < 0.0
    assert "(what should follow comes first)" in found.statement


def test_a_recording_too_short_for_folds_says_what_it_needs(tmp_path: Path, seed: int) -> None:
    path = tmp_path / "short.h5"
    make_recording(path, Recording("texture", 0.8), seed)
    found, notes = ranked(path)
    assert found is None
    assert "accepted: 3 at least, which needs 0.9 s of steady sliding" in notes[-1]


@pytest.mark.long
def test_twice_the_delay_is_twice_as_long(tmp_path: Path, rng: np.random.Generator) -> None:
    seed, delays = int(rng.integers(2**31)), []
    for times in (1.0, 2.0):
        path = tmp_path / f"{times:g}.h5"
        make_recording(
            path,
            Recording("drive", 2.0, Hidden("channel_delay", {"delay_s": times * 6e-5})),
            seed,
        )
        found, _ = ranked(path, "friction")
        assert found is not None
        delays.append(found.models[0].parameters["channel_delay"]["delay_s"].value)
    assert delays[1] == pytest.approx(2.0 * delays[0], rel=0.03)


@pytest.mark.long
def test_a_mode_is_found_at_its_frequency_and_quality(
    tmp_path: Path, rng: np.random.Generator
) -> None:
    """Between those at which modes are tried; with a quality held, a share is far off."""
    quality = float(rng.uniform(3.5, 7.0))
    mode = {"share": 0.3, "frequency_hz": 410.0, "quality": quality}
    path = tmp_path / "mode.h5"
    recording = Recording("texture", 2.0, Hidden("second_mode", mode))
    make_recording(path, recording, int(rng.integers(2**31)))
    found, _ = ranked(path)
    assert found is not None
    assert found.models[0].causes == ("second_mode",)
    estimates = found.models[0].parameters["second_mode"]
    assert estimates["frequency_hz"].value == pytest.approx(410.0, rel=0.01)
    assert estimates["quality"].value == pytest.approx(quality, rel=0.1)
    assert estimates["share"].value == pytest.approx(0.3, rel=0.06)
    for each in estimates.values():
        assert each.ci95 is not None
        assert each.ci95[0] < each.value < each.ci95[1]


def test_positions_are_taken_earlier_by_the_delay_of_the_touch_sensor(
    tmp_path: Path, seed: int
) -> None:
    path, late_path, late_s = tmp_path / "plain.h5", tmp_path / "late.h5", 0.04
    make_recording(path, Recording("drive", 2.0), seed)
    with open_study(path) as study, StudyWriter(late_path, study.info) as writer:
        trial = study.read(study.trials[0].id)
        writer.add(replace(trial, position_t_s=trial.position_t_s + late_s))
    base = base_model("paper", "friction")
    likelihoods = []
    for each, earlier_s in ((path, 0.0), (late_path, late_s), (late_path, 0.0)):
        found, _ = rank_recording(each, base, lambda line: None, earlier_s)
        assert found is not None
        likelihoods.append({one.causes: one.heldout_loglik for one in found.models})
    right, earlier, left_late = likelihoods
    assert earlier == pytest.approx(right, rel=1e-6, abs=1e-6)
    assert left_late != pytest.approx(right, rel=1e-6, abs=1e-6)

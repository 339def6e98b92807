"""A study that changes while it is read is refused, whoever changes it in whatever way."""

import os
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from tests.service.identification.trials import STUDY, Made, numbered, trial
from typer.testing import CliRunner

from frictus_service.cli.app import app
from frictus_service.discovery import impact_recording
from frictus_service.discovery.discover import discover_study
from frictus_service.errors import StudyError
from frictus_service.identification.pipeline.study import observe_study
from frictus_service.study.file_state import unchanged
from frictus_service.study.writer import StudyWriter
from frictus_service.tracking import recorded

CHANGES: dict[str, Callable[[Path], object]] = {
    "written": lambda file: file.write_bytes(b"another"),
    "replaced": lambda file: os.replace(shutil.copy(__file__, file.with_name("new")), file),
    "gone": lambda file: file.unlink(),
}


@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.parametrize("in_folder", [False, True])
def test_a_change_is_seen(tmp_path: Path, change: str, in_folder: bool) -> None:
    folder = tmp_path / "study"
    folder.mkdir()
    (folder / "a.h5").write_bytes(b"one")
    path = folder if in_folder else folder / "a.h5"
    with unchanged(path):
        (folder / "a.h5").read_bytes()
    gone = change == "gone" and not in_folder
    match = "deleted or moved while it was read" if gone else "changed while it was read"
    with pytest.raises(StudyError, match=match), unchanged(path):
        CHANGES[change](folder / "a.h5")
    shutil.copy(__file__, folder / "a.h5")
    with pytest.raises(StudyError, match=match), unchanged(path):
        _change_and_fail(folder / "a.h5", change)


def _change_and_fail(file: Path, change: str) -> None:
    CHANGES[change](file)
    raise FileNotFoundError(2, "No such file or directory", str(file))


def test_what_is_not_there_is_left_to_who_reads_it(tmp_path: Path) -> None:
    with unchanged(tmp_path / "none.h5"):
        pass


@pytest.fixture
def studies(tmp_path: Path, rng: np.random.Generator) -> list[Path]:
    """Two studies of the same trials, of other people."""
    made = []
    for name in ("one.h5", "other.h5"):
        with StudyWriter(tmp_path / name, STUDY) as writer:
            for number in range(2):
                tones = (float(rng.uniform(50.0, 900.0)),)
                writer.add(numbered(trial(Made(tones, seconds=1.2), rng), number))
        made.append(tmp_path / name)
    return made


@pytest.mark.parametrize("when", ["known already", "criticising"])
def test_no_report_is_made_of_parts_of_two_studies(studies: list[Path], when: str) -> None:
    path, other = studies

    def replaced(line: str) -> None:
        if when in line:
            os.replace(other, path)

    with pytest.raises(StudyError, match="changed while it was read"):
        discover_study(path, workers=0, seed=1, tell=replaced)


@pytest.mark.parametrize("when", ["known already", "criticising"])
def test_a_study_that_vanishes_while_it_is_read_is_said_to_have(
    studies: list[Path], when: str
) -> None:
    def vanishes(line: str) -> None:
        if when in line:
            studies[0].unlink()

    with pytest.raises(StudyError, match=r"one\.h5 was deleted or moved while it was read"):
        discover_study(studies[0], workers=0, seed=1, tell=vanishes)


def test_observations_of_workers_are_of_one_study(studies: list[Path]) -> None:
    path, other = studies

    def replaced(line: str) -> None:
        if "known already" in line:
            os.replace(other, path)

    with pytest.raises(StudyError, match="changed while it was read"):
        observe_study(path, workers=1, tell=replaced)


def test_a_study_that_vanishes_while_it_is_tracked_is_said_to_have(
    studies: list[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    def follow(*_: object) -> dict[str, object]:
        studies[0].unlink()
        return {}

    monkeypatch.setattr(recorded, "follow_study", follow)
    told = CliRunner().invoke(app, ["track", str(studies[0])]).stderr
    assert "one.h5 was deleted or moved while it was read" in told


def test_blows_that_are_written_over_while_they_are_read_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, read = tmp_path / "blows.npy", impact_recording.read_impacts
    np.save(path, np.zeros(1_000))

    def read_and_cut(path: Path, rate_hz: float | None) -> impact_recording.ImpactRecording:
        blows = read(path, rate_hz)
        path.write_bytes(b"")
        return blows

    monkeypatch.setattr(impact_recording, "read_impacts", read_and_cut)
    told = CliRunner().invoke(app, ["mount", str(path), "--rate", "5000"]).stderr
    assert "blows.npy changed while it was read" in told

"""When the trials of an imported recording began: as given, or by the file's own time."""

import os
from datetime import datetime
from pathlib import Path

import h5py
import numpy as np
import pytest
from typer.testing import CliRunner

from frictus_service.cli.app import app
from frictus_service.study.reader import StudyReader

RATE_HZ = 2000.0
SECONDS = 12.0
WRITTEN_S = 1_780_000_000


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    """Return six strokes of a second each, whose normal force tells the time of each sample."""
    path = tmp_path / "swipes.h5"
    time_s = np.arange(round(SECONDS * RATE_HZ)) / RATE_HZ
    stroke, within_s = np.divmod(time_s, 2.0)
    velocity = np.where(within_s < 1.0, 40.0 * (-1.0) ** stroke, 0.0)
    with h5py.File(path, "w") as file:
        file.attrs["sample_rate_hz"] = RATE_HZ
        for name, unit, values in (
            ("Fx", "N", 0.2 * np.sign(velocity)),
            ("Fz", "N", 0.4 + 1e-3 * time_s),
            ("x", "mm", np.cumsum(velocity) / RATE_HZ),
        ):
            file.create_dataset(name, data=values).attrs["unit"] = unit
    os.utime(path, (WRITTEN_S, WRITTEN_S))
    return path


def imported(path: Path, *words: str) -> tuple[str, list[tuple[float, float]]]:
    """Return what was told, and of each trial when it began: in the file, and by its label."""
    out = path.with_name("study.h5")
    result = CliRunner().invoke(app, ["study", "import", str(path), str(out), "--yes", *words])
    assert result.exit_code == 0, result.stderr
    with StudyReader(out) as study:
        trials = [study.read(info.id) for info in study.trials]
    assert len(trials) == 6
    return result.stdout, [
        (
            1e3 * (float(trial.force_n[0, 2]) - 0.4),
            datetime.fromisoformat(trial.info.started_utc).timestamp(),
        )
        for trial in trials
    ]


def test_each_stroke_began_when_it_did(recording: Path) -> None:
    told, trials = imported(recording, "--set", "started_utc=2026-03-01T10:00:00Z")
    start_s = datetime.fromisoformat("2026-03-01T10:00:00Z").timestamp()
    for number, (in_file_s, labelled_s) in enumerate(trials):
        assert labelled_s - start_s == pytest.approx(in_file_s, abs=1e-3)
        assert in_file_s == pytest.approx(2.0 * number, abs=0.1)
    assert "no start time was given" not in told


def test_a_file_was_written_when_its_recording_ended(recording: Path) -> None:
    told, trials = imported(recording)
    for in_file_s, labelled_s in trials:
        assert labelled_s - (WRITTEN_S - SECONDS) == pytest.approx(in_file_s, abs=1e-3)
    assert "no start time was given" in told
    recording.with_name("study.h5").unlink()
    assert "no start time was given" in imported(recording)[0]  # the saved map gives none


@pytest.mark.parametrize("wrong", ["yesterday", "9999-12-31T23:59:59Z"])
def test_a_start_that_is_no_time_is_refused(wrong: str, recording: Path) -> None:
    out = recording.with_name("study.h5")
    command = ["study", "import", str(recording), str(out), "--yes"]
    result = CliRunner().invoke(app, [*command, "--set", f"started_utc={wrong}"])
    assert result.exit_code == 2
    assert f"started_utc: is '{wrong}'; accepted: ISO 8601" in result.stderr

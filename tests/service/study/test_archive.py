"""A study for an archive: NWB that inspectors accept, events, a card, checksums."""

import csv
import hashlib
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from nwbinspector import Importance, inspect_nwbfile
from pynwb import NWBHDF5IO
from tests.full_disk import full_after
from typer.testing import CliRunner

from frictus_service.cli.app import app
from frictus_service.errors import NotWrittenError, StudyError
from frictus_service.study.archive import (
    COLUMNS,
    SIMULATED,
    export_archive,
    row_of_session,
)
from frictus_service.study.reader import StudyReader
from frictus_service.study.trial import StudyInfo, Trial

MakeTrial = Callable[..., Trial]
WriteStudy = Callable[..., Path]


@pytest.fixture
def archive(make_trial: MakeTrial, write_study: WriteStudy, tmp_path: Path) -> Path:
    gap = make_trial("gap", order=1, started_utc="2026-03-01T10:00:30Z")
    gap.force_n[3:7] = np.nan
    later = {"started_utc": "2026-03-01T10:01:00Z", "drive_vpp": 0.0, "voltage_v": None}
    study = write_study(
        make_trial("first", order=0, tones_hz=(70.0, 130.0), n_samples=3_000),
        gap,
        make_trial("blank", order=2, tones_hz=(), **later),
        make_trial("again", order=0, session=1, position_t_s=np.arange(6) / 400.0),
        make_trial("other", order=0, participant="p-2"),
        make_trial("in mN", order=5, force_n=np.full((400, 3), 400.0)),
    )
    with StudyReader(study) as opened:
        excluded = export_archive(opened, tmp_path / "out", "CC-BY-4.0", "P18Y/P65Y")
    assert [one.trial for one in excluded] == ["in mN"]
    return tmp_path / "out"


def test_a_full_disk_is_said_and_leaves_nothing(
    make_trial: MakeTrial, write_study: WriteStudy, tmp_path: Path
) -> None:
    study = write_study(make_trial("long", n_samples=40_000))
    with (
        StudyReader(study) as opened,
        pytest.raises(NotWrittenError, match="cannot be written: File too large"),
        full_after(100_000),
    ):
        export_archive(opened, tmp_path / "out", "CC-BY-4.0", None)
    assert list(tmp_path.glob("*out*")) == []


SESSIONS = ("sub-p1/sub-p1_ses-00", "sub-p1/sub-p1_ses-01", "sub-p2/sub-p2_ses-00")


@pytest.mark.parametrize("session", SESSIONS)
def test_the_inspector_finds_no_violation(archive: Path, session: str) -> None:
    found = list(inspect_nwbfile(archive / f"{session}.nwb"))
    least = Importance.BEST_PRACTICE_VIOLATION.value
    assert not [message for message in found if message.importance.value >= least]


def test_the_signals_are_those_of_the_study_at_their_times(archive: Path) -> None:
    with (
        StudyReader(archive.parent / "study.h5") as study,
        NWBHDF5IO(archive / f"{SESSIONS[0]}.nwb", "r") as opened,
    ):
        file = opened.read()
        table = file.trials.to_dataframe()
        assert table["trial"].tolist() == ["first", "gap", "blank"]
        assert table["tone_hz"].tolist() == ["70 130", "250", "n/a"]
        assert table["start_time"].tolist() == [0.0, 30.0, 60.0]
        assert file.subject.subject_id == "p1"
        for row in table.itertuples():
            trial = study.read(row.trial)
            force = file.acquisition[f"force_{row.order:05d}"]
            np.testing.assert_array_equal(force.data[:], trial.force_n)
            assert force.starting_time == row.start_time + trial.force_skew_s
            assert force.rate == trial.info.sample_rate_hz
            assert (f"voltage_{row.order:05d}" in file.acquisition) == (row.trial != "blank")
            behaviour = file.processing["behavior"]["Position"]
            position = behaviour.spatial_series[f"position_{row.order:05d}"]
            np.testing.assert_allclose(position.data[:], 1e-3 * trial.position_mm)
            np.testing.assert_allclose(
                position.timestamps[:], row.start_time + trial.position_t_s
            )


def test_even_positions_have_a_rate(archive: Path) -> None:
    with NWBHDF5IO(archive / f"{SESSIONS[1]}.nwb", "r") as opened:
        behaviour = opened.read().processing["behavior"]["Position"]
        assert behaviour.spatial_series["position_00000"].rate == pytest.approx(400.0)


def test_events_list_the_trials_and_their_columns_are_explained(archive: Path) -> None:
    with (archive / f"{SESSIONS[0]}_events.tsv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file, delimiter="\t"))
    assert [row["trial"] for row in rows] == ["first", "gap", "blank"]
    assert [float(row["onset"]) for row in rows] == [0.0, 30.0, 60.0]
    assert float(rows[0]["duration"]) == 0.15
    explained = json.loads((archive / f"{SESSIONS[0]}_events.json").read_text(encoding="utf-8"))
    assert list(explained) == list(rows[0]) == ["onset", "duration", *COLUMNS]


def test_a_trial_that_is_called_like_a_formula_is_none_in_a_spreadsheet(
    make_trial: MakeTrial, write_study: WriteStudy, tmp_path: Path
) -> None:
    names = ["=1+1", "+A1", "@SUM(A1)", "-A1", "-1.5", "-", "a=b"]
    trials = [make_trial(name, order=order) for order, name in enumerate(names)]
    with StudyReader(write_study(*trials)) as opened:
        export_archive(opened, tmp_path / "out")
    (table,) = (tmp_path / "out").rglob("*_events.tsv")
    with table.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file, delimiter="\t"))
    assert [row["trial"] for row in rows] == [f"'{name}" for name in names[:4]] + names[4:]


def test_tones_are_written_in_full(make_trial: MakeTrial) -> None:
    """Six digits made 123.457 Hz of 123.4567, and a broadband drive was said to be none."""
    tones_hz = (123.4567, 250.0, 1.0 / 3.0)
    told = row_of_session(make_trial(tones_hz=tones_hz))["tone_hz"]
    assert told.startswith("123.4567 250 0.3333")
    assert tuple(float(hz) for hz in told.split()) == tones_hz
    broadband = row_of_session(make_trial(tones_hz=(), drive_vpp=150.0))
    assert (broadband["tone_hz"], broadband["drive_vpp"]) == ("n/a", 150.0)
    assert "n/a: no tones (see drive_vpp)" in COLUMNS["tone_hz"]


def test_the_card_tells_a_stranger_and_the_sums_hold(archive: Path) -> None:
    card = (archive / "README.md").read_text(encoding="utf-8")
    for said in (
        "2 participants, 3 sessions, 5 trials",
        "Licence: CC-BY-4.0",
        "| sub-p1/sub-p1_ses-00.nwb | 3 |",
        "lab: nord",
        "- trial in mN, force_n",
    ):
        assert said in card
    lines = (archive / "SHA256SUMS").read_text(encoding="utf-8").splitlines()
    summed = {line[66:]: line[:64] for line in lines}
    files = {p.relative_to(archive).as_posix() for p in archive.rglob("*") if p.is_file()}
    assert set(summed) == files - {"SHA256SUMS"}
    for name, digest in summed.items():
        assert hashlib.sha256((archive / name).read_bytes()).hexdigest() == digest


def test_a_simulated_finger_is_nobody_s(
    make_trial: MakeTrial, write_study: WriteStudy, tmp_path: Path
) -> None:
    study = write_study(make_trial(), info=StudyInfo("twin", extras={"simulated": 1}))
    with StudyReader(study) as opened:
        export_archive(opened, tmp_path / "out")
    assert SIMULATED in (tmp_path / "out" / "README.md").read_text(encoding="utf-8")
    with NWBHDF5IO(tmp_path / "out" / f"{SESSIONS[0]}.nwb", "r") as opened:
        subject = opened.read().subject
        assert (subject.species, subject.description) == (None, SIMULATED)


def test_an_age_that_is_none_is_refused(
    make_trial: MakeTrial, write_study: WriteStudy, tmp_path: Path
) -> None:
    with StudyReader(write_study(make_trial())) as opened:
        with pytest.raises(StudyError, match="age '25': P25Y, or a range"):
            export_archive(opened, tmp_path / "out", age="25")
        export_archive(opened, tmp_path / "out")
    card = (tmp_path / "out" / "README.md").read_text(encoding="utf-8")
    assert "Age of the participants: not given" in card
    assert "Licence: none has been given" in card


def test_a_study_without_a_trial_that_can_be_used_is_refused(
    make_trial: MakeTrial, write_study: WriteStudy, tmp_path: Path
) -> None:
    study = write_study(make_trial("in mN", force_n=np.full((400, 3), 400.0)))
    with (
        StudyReader(study) as opened,
        pytest.raises(StudyError, match=r"no trial can be used, .* in mN, force_n: "),
    ):
        export_archive(opened, tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("session", [0, 1])
@pytest.mark.parametrize("other", ["p-1", "P1"])
def test_two_people_of_one_name_are_refused(
    make_trial: MakeTrial, write_study: WriteStudy, tmp_path: Path, other: str, session: int
) -> None:
    study = write_study(
        make_trial("a", order=0, participant=other),
        make_trial("b", order=0, participant="p1", session=session),
    )
    with (
        StudyReader(study) as opened,
        pytest.raises(StudyError, match="would be called 'p1': rename one"),
    ):
        export_archive(opened, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_the_command_writes_it_and_says_which_options_go_with_it(
    make_trial: MakeTrial, write_study: WriteStudy, tmp_path: Path
) -> None:
    study, out = write_study(make_trial("a", order=3)), tmp_path / "friction"
    card = ["--licence", "CC0-1.0", "--age", "P25Y"]
    done = CliRunner().invoke(
        app, ["export", str(study), "--to", "nwb", "--out", str(out), *card]
    )
    assert done.exit_code == 0, done.output
    assert (out / "sub-p1" / "sub-p1_ses-00.nwb").is_file()
    assert "Licence: CC0-1.0" in (out / "README.md").read_text(encoding="utf-8")
    wrong = CliRunner().invoke(app, ["export", str(study), "--to", "mat", *card])
    assert wrong.exit_code == 2
    assert "go with --to nwb" in wrong.output

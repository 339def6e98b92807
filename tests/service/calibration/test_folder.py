"""The folder of a calibration: what is in it is whole, and only its own calibration goes on."""

from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from frictus_service.calibration.folder import CalibrationFolder
from frictus_service.calibration.job import CalibrationSpec
from frictus_service.errors import Exclusion, FolderError
from frictus_service.study.reader import StudyReader
from frictus_service.study.trial import StudyInfo, Trial, TrialInfo

SPEC = CalibrationSpec(rig="rig1", participant="P01", seed=5)
STUDY = StudyInfo(rig="rig1", extras={"protocol": "quick"})
RATE_HZ = 20_000.0


def trial(folder: CalibrationFolder, rng: np.random.Generator) -> Trial:
    """Return half a second of a finger that slides, with noise of its own."""
    n = round(0.5 * RATE_HZ)
    time_s = np.arange(0.0, 0.5, 1.0 / 60.0)
    info = TrialInfo(
        id=folder.next_id,
        participant="P01",
        session=folder.spec.session,
        order=len(folder.done),
        speed_mm_s=60.0,
        force_n=0.4,
        tones_hz=(100.0, 300.0),
        drive_vpp=150.0,
        sample_rate_hz=RATE_HZ,
        started_utc="2026-01-31T12:00:00+00:00",
    )
    return Trial(
        info=info,
        voltage_v=75.0 * np.cos(2.0 * np.pi * 0.35 * np.arange(n)),
        force_n=rng.normal(0.4, 0.1, (n, 3)),
        accel_m_s2=rng.normal(0.0, 1.0, (n, 3)),
        skin_velocity_m_s=None,
        position_mm=np.column_stack([5.0 + 60.0 * time_s, np.full(time_s.size, 17.0)]),
        position_t_s=time_s,
        voltage_source="monitor",
    )


def test_trials_are_there_when_the_folder_is_opened_again(
    tmp_path: Path, rng: np.random.Generator
) -> None:
    first = CalibrationFolder.open(tmp_path / "c", SPEC)
    kept = [trial(first, rng)]
    first.add(kept[0], STUDY, "")
    kept.append(trial(first, rng))
    first.add(kept[1], STUDY, "mean speed 20 % off")
    again = CalibrationFolder.open(tmp_path / "c", SPEC)
    assert again.done == first.done
    assert [done.rejected for done in again.done] == ["", "mean speed 20 % off"]
    assert again.done[0].record_s == pytest.approx(0.5)
    assert again.next_id == "P01-0002"
    left_out: list[Exclusion] = []
    for held, written in zip(again.trials(left_out.append), kept, strict=True):
        assert held.info == written.info
        np.testing.assert_array_equal(held.force_n, written.force_n)
    assert not left_out


def test_what_is_deleted_under_way_ends_it_at_the_next_trial(
    tmp_path: Path, rng: np.random.Generator
) -> None:
    folder = CalibrationFolder.open(tmp_path / "c", SPEC)
    folder.add(trial(folder, rng), STUDY, "")
    following = trial(folder, rng)
    (tmp_path / "c").rename(tmp_path / "moved")
    for act in (lambda: folder.add(following, STUDY, ""), lambda: folder.merge(STUDY)):
        with pytest.raises(
            FolderError, match=r"lost 2 of 2 files .* such as calibration\.json"
        ):
            act()
    assert not (tmp_path / "c").exists()
    (tmp_path / "moved").rename(tmp_path / "c")
    folder.add(following, STUDY, "")
    assert len(CalibrationFolder.open(tmp_path / "c", SPEC).done) == 2


def test_all_trials_become_one_study_as_often_as_asked(
    tmp_path: Path, rng: np.random.Generator
) -> None:
    folder = CalibrationFolder.open(tmp_path, SPEC)
    for verdict in ("", "rejected for a reason", ""):
        folder.add(trial(folder, rng), STUDY, verdict)
        assert folder.merge(STUDY) == ()
        with StudyReader(folder.study) as reader:
            assert len(reader.trials) == len(folder.done)
            assert reader.info.extras == STUDY.extras
    assert folder.study == tmp_path / "study.h5"


def test_a_torn_trial_is_as_if_it_never_was(tmp_path: Path, rng: np.random.Generator) -> None:
    """A crash leaves the file that was being written under another name."""
    folder = CalibrationFolder.open(tmp_path, SPEC)
    folder.add(trial(folder, rng), STUDY, "")
    (tmp_path / "trials" / ".P01-0001.h5.4711.part").write_bytes(b"torn")
    again = CalibrationFolder.open(tmp_path, SPEC)
    assert again.next_id == "P01-0001"
    again.add(trial(again, rng), STUDY, "")


def test_a_trial_that_is_gone_or_damaged_is_named(
    tmp_path: Path, rng: np.random.Generator
) -> None:
    """The finger was driven for one more trial, whose name one that was there had."""
    folder = CalibrationFolder.open(tmp_path, SPEC)
    for _ in range(2):
        folder.add(trial(folder, rng), STUDY, "")
    first, second = sorted(tmp_path.glob("trials/*.h5"))
    held = first.read_bytes()
    first.unlink()
    with pytest.raises(FolderError, match="lacks trial P01-0000; put it back"):
        CalibrationFolder.open(tmp_path, SPEC)
    first.write_bytes(held)
    with h5py.File(second, "r+") as file:
        del file["trials/P01-0001"].attrs["speed_mm_s"]
    with pytest.raises(FolderError, match=r"P01-0001\.h5 is damaged: speed_mm_s .*put a copy"):
        CalibrationFolder.open(tmp_path, SPEC)


def test_another_session_may_go_on(tmp_path: Path, rng: np.random.Generator) -> None:
    folder = CalibrationFolder.open(tmp_path, SPEC)
    folder.add(trial(folder, rng), STUDY, "")
    second = CalibrationFolder.open(tmp_path, SPEC.model_copy(update={"session": 2}))
    second.add(trial(second, rng), STUDY, "")
    second.merge(STUDY)
    with StudyReader(second.study) as reader:
        assert [info.session for info in reader.trials] == [1, 2]


@pytest.mark.parametrize("change", [{"seed": 6}, {"participant": "P02"}, {"rig": "rig2"}])
def test_another_calibration_is_refused(tmp_path: Path, change: dict[str, object]) -> None:
    CalibrationFolder.open(tmp_path, SPEC)
    with pytest.raises(FolderError, match=f"another {next(iter(change))}"):
        CalibrationFolder.open(tmp_path, SPEC.model_copy(update=change))


def test_a_folder_that_says_nothing_readable_is_refused(
    tmp_path: Path, rng: np.random.Generator
) -> None:
    folder = CalibrationFolder.open(tmp_path, SPEC)
    folder.add(trial(folder, rng), STUDY, "")
    (tmp_path / "calibration.json").write_text("{", encoding="utf-8")
    with pytest.raises(FolderError, match="cannot be read: document: Invalid JSON") as refused:
        CalibrationFolder.open(tmp_path, SPEC)
    assert "\n" not in str(refused.value)
    (tmp_path / "calibration.json").unlink()
    with pytest.raises(FolderError, match=r"no calibration\.json"):
        CalibrationFolder.open(tmp_path, SPEC)


def test_what_no_reader_accepts_is_left_out_of_the_study_and_said(
    tmp_path: Path, rng: np.random.Generator
) -> None:
    folder = CalibrationFolder.open(tmp_path, SPEC)
    folder.add(trial(folder, rng), STUDY, "")
    still = trial(folder, rng)
    at_rest = np.full_like(still.position_mm, 17.0)
    folder.add(replace(still, position_mm=at_rest), STUDY, "the finger did not move")
    said: list[Exclusion] = []
    assert [held.info.id for held in folder.trials(said.append)] == ["P01-0000"]
    assert [(one.trial, one.field) for one in said] == [(still.info.id, "position_mm")]
    assert folder.merge(STUDY) == tuple(said)
    with StudyReader(folder.study) as reader:
        assert len(reader.trials) == 1

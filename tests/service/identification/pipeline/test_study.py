"""A study gives the same observations whoever does the work, and says what it left out."""

import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import fields
from pathlib import Path

import h5py
import numpy as np
import pytest
from tests.service.identification.trials import STUDY, Made, numbered, trial

from frictus_service.identification.observation.observe import observe
from frictus_service.identification.observation.response import (
    ResponseRows,
    TrialObservations,
)
from frictus_service.identification.pipeline import study as study_pipeline
from frictus_service.identification.pipeline.study import Task, observe_study
from frictus_service.identification.pipeline.workers import Crash, Reading
from frictus_service.study.reader import StudyReader
from frictus_service.study.trial import Trial
from frictus_service.study.writer import StudyWriter

pytestmark = pytest.mark.long

TRIALS = 6


@pytest.fixture
def study(tmp_path: Path, rng: np.random.Generator) -> Path:
    path = tmp_path / "study.h5"
    with StudyWriter(path, STUDY) as writer:
        for number in rng.permutation(TRIALS):
            made = Made((float(rng.uniform(50.0, 900.0)),), seconds=1.2, noise_n=0.002)
            writer.add(numbered(trial(made, rng), int(number)))
    return path


def require_same(one: list[TrialObservations], other: list[TrialObservations]) -> None:
    assert [each.info for each in one] == [each.info for each in other]
    assert [each.sha256 for each in one] == [each.sha256 for each in other]
    assert [each.reasons for each in one] == [each.reasons for each in other]
    for first, second in zip(one, other, strict=True):
        for field in fields(ResponseRows):
            np.testing.assert_array_equal(
                getattr(first.rows, field.name), getattr(second.rows, field.name)
            )


def test_the_number_of_workers_changes_nothing(study: Path) -> None:
    alone = observe_study(study, workers=0)
    assert [each.info.order for each in alone] == list(range(TRIALS))
    with StudyReader(study) as reader:
        direct = [observe(reader.read(each.id), reader.info) for each in reader.trials]
    require_same(alone, direct)
    require_same(alone, observe_study(study, workers=2))
    require_same(alone, observe_study(study))


def test_known_trials_are_not_read_again(
    study: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = observe_study(study, workers=0, cache=tmp_path / "cache")
    told: list[str] = []

    def refuse(_self: StudyReader, trial_id: str) -> Trial:
        raise AssertionError(f"{trial_id} is read")

    monkeypatch.setattr(StudyReader, "read", refuse)
    again = observe_study(study, workers=0, cache=tmp_path / "cache", tell=told.append)
    require_same(first, again)
    assert f"{TRIALS} trials, {TRIALS} of them known already" in told


def test_a_copy_of_the_file_is_read_but_not_estimated_again(
    study: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = observe_study(study, workers=0, cache=tmp_path / "cache")
    copy = tmp_path / "copy.h5"
    copy.write_bytes(study.read_bytes())

    def refuse(*_: object) -> TrialObservations:
        raise AssertionError("estimated again")

    monkeypatch.setattr(study_pipeline, "observe_along", refuse)
    require_same(first, observe_study(copy, workers=0, cache=tmp_path / "cache"))


def test_damaged_entries_are_made_anew(study: Path, tmp_path: Path) -> None:
    first = observe_study(study, workers=0, cache=tmp_path / "cache")
    entries = sorted((tmp_path / "cache").rglob("*.*"))
    assert len(entries) == TRIALS + 1
    for entry in entries:
        entry.write_bytes(entry.read_bytes()[:-3])
    require_same(first, observe_study(study, workers=0, cache=tmp_path / "cache"))


def test_trials_that_cannot_be_read_stay_in_the_list(study: Path) -> None:
    with h5py.File(study, "r+") as file:
        force = file["trials/t2/force_n"]
        values = force[()]
        values[100, 2] += values[100, 2] + 1
        force[...] = values
    seen = observe_study(study, workers=0)
    assert [each.info.id for each in seen] == [f"t{number}" for number in range(TRIALS)]
    assert [each.valid for each in seen] == [number != 2 for number in range(TRIALS)]
    assert seen[2].reasons[0].startswith("sha256 the content does not match")
    assert seen[2].rows.tone_hz.size == 0


def copied(study: Path, trials: Iterable[str], **changed: str | int) -> None:
    """Add copies of trials, ``z`` before their ids, whose attributes are changed."""
    with h5py.File(study, "r+") as file:
        for name in trials:
            file.copy(f"trials/{name}", f"trials/z{name}")
            attributes = file[f"trials/z{name}"].attrs
            del attributes["sha256"]
            for key, value in changed.items():
                attributes[key] = value


def test_a_copy_in_another_place_counts_once(study: Path) -> None:
    copied(study, ["t1"], order=90)
    seen = {each.info.id: each for each in observe_study(study, workers=0)}
    assert {name for name, each in seen.items() if not each.valid} == {"zt1"}
    assert "same measurement as trial t1" in seen["zt1"].reasons[-1]


def test_a_person_under_two_names_is_one(study: Path, tmp_path: Path) -> None:
    """Of one name all trials stay, whichever ids come first; and so when they are known."""
    copied(study, [f"t{number}" for number in range(TRIALS)], participant="A before all")
    for _ in range(2):
        seen = observe_study(study, workers=0, cache=tmp_path / "cache")
        assert len(seen) == 2 * TRIALS
        assert {each.info.participant for each in seen if each.valid} == {"A before all"}


def test_what_the_reader_leaves_out_is_told(study: Path) -> None:
    with h5py.File(study, "r+") as file:
        del file["trials/t3"].attrs["speed_mm_s"]
    told: list[str] = []
    assert len(observe_study(study, workers=0, tell=told.append)) == TRIALS - 1
    assert any(line.startswith("trial t3 is left out: speed_mm_s") for line in told)


def test_a_trial_that_ends_its_workers_is_reported(
    study: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    expected = [each.valid for each in observe_study(study, workers=0)]
    expected[3] = False

    def crashing(
        work: Callable[[Task], Reading], tasks: Sequence[Task], *_: object
    ) -> Iterator[tuple[int, Reading | Crash]]:
        for number, task in enumerate(tasks):
            crash = Crash(3, "with exit code 5")
            yield number, crash if task.trial.id == "t3" else work(task)
        study_pipeline.release()

    monkeypatch.setattr(study_pipeline, "work_through", crashing)
    seen = observe_study(study, workers=2)
    assert [each.valid for each in seen] == expected
    assert seen[3].reasons == (
        "3 worker processes ended while they observed it, the last one with exit code 5",
    )


@pytest.mark.parametrize("workers", [-1])
def test_a_wrong_number_of_workers(workers: int, study: Path) -> None:
    with pytest.raises(ValueError, match=r"workers is -1; accepted: 0"):
        observe_study(study, workers=workers)


MEASURE = """
import sys
from frictus_service.identification.pipeline.study import observe_study
for path in sys.argv[1:]:
    observe_study(path, workers=0)
    (peak,) = [line for line in open("/proc/self/status") if line.startswith("VmHWM")]
    print(peak.split()[1])
"""


@pytest.mark.skipif(sys.platform != "linux", reason="peak memory is read as Linux reports it")
def test_memory_stays_flat_over_a_study_ten_times_larger(
    tmp_path: Path, rng: np.random.Generator
) -> None:
    one = trial(Made(seconds=2.0), rng)
    paths = []
    for count in (4, 40):
        paths.append(tmp_path / f"{count}.h5")
        with StudyWriter(paths[-1], STUDY) as writer:
            for number in range(count):
                writer.add(numbered(one, number))
    done = subprocess.run(
        [sys.executable, "-c", MEASURE, *map(str, paths)],
        check=True,
        capture_output=True,
        text=True,
        timeout=100.0,
    )
    small_kb, large_kb = map(int, done.stdout.split())
    data_kb = paths[1].stat().st_size / 1024.0
    assert data_kb > 60_000.0
    assert large_kb - small_kb < 0.2 * data_kb

"""Positions of a hand that turns, beside the acceleration of its nail: told, and taken off."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from tests.blind.generator import Case, Design, Seeds, make_study
from tests.service.identification.plausibility.slips import record_of
from tests.service.identification.trials import STUDY, Made, trial
from typer.testing import CliRunner

from frictus_service.cli.app import app
from frictus_service.identification.observation.observe import course_of
from frictus_service.identification.pipeline.study import OBSERVER, read_study, records_of
from frictus_service.identification.plausibility.judge import judge_study
from frictus_service.identification.plausibility.pool import TrialRecord
from frictus_service.identification.plausibility.position_delay import (
    delay_text,
    sensor_delay_s,
)
from frictus_service.identification.plausibility.turns import friction_delay_s
from frictus_service.study.importers import open_study
from frictus_service.study.trial import StudyInfo, Trial
from frictus_service.study.writer import StudyWriter

LATE_S = 0.04
"""Of the touch reports of a lifelike study, whose file does not say so."""

Lifelike = tuple[list[Trial], StudyInfo]


@pytest.fixture(scope="module")
def lifelike(module_seed: int, tmp_path_factory: pytest.TempPathFactory) -> Lifelike:
    path: Path = tmp_path_factory.mktemp("lifelike") / "study.h5"
    design = Design(participants=2, n_speeds=3, n_forces=2, lifelike=True)
    make_study(path, Case("lifelike", (), design), Seeds(module_seed, module_seed + 1))
    with open_study(path) as study:
        return [study.read(each.id) for each in study.trials], study.info


@pytest.fixture(scope="module")
def records(lifelike: Lifelike) -> list[TrialRecord]:
    trials, info = lifelike
    return [record_of(trial, info) for trial in trials]


def written(path: Path, lifelike: Lifelike, says_s: float | None = None) -> Path:
    """Write the trials as a study that says how late its positions are, or does not."""
    trials, info = lifelike
    with StudyWriter(path, info) as writer:
        for trial in trials:
            writer.add(trial)
    if says_s is not None:
        with h5py.File(path, "r+") as file:
            file.attrs["positions_late_s"] = says_s
    return path


def test_late_positions_are_told_with_their_delay(records: list[TrialRecord]) -> None:
    (found,) = judge_study(records)
    assert (found.code, found.severity) == ("position_delay", "warning")
    assert found.value == pytest.approx(1e3 * LATE_S, abs=4.0)


def test_early_positions_are_told_as_early(lifelike: Lifelike) -> None:
    trials, info = lifelike
    early = [replace(one, position_t_s=one.position_t_s - 2.0 * LATE_S) for one in trials]
    (found,) = judge_study([record_of(one, info) for one in early])
    assert (found.code, found.severity) == ("position_delay", "warning")
    assert found.value == pytest.approx(-1e3 * LATE_S, abs=4.0)
    assert f"the positions turn {-found.value:.0f} ms earlier than" in found.sentence


@pytest.mark.parametrize(
    ("late_s", "words"), [(0.0352, "35.2 ms late"), (-0.012, "12.0 ms early")]
)
def test_a_delay_has_no_sign_in_words(late_s: float, words: str) -> None:
    assert delay_text(late_s) == words


def test_once_the_study_says_so_nothing_is_said(lifelike: Lifelike, tmp_path: Path) -> None:
    late, _ = lifelike
    with open_study(written(tmp_path / "study.h5", lifelike, LATE_S)) as study:
        trials, info = [study.read(each.id) for each in study.trials], study.info
    for before, after in zip(late, trials, strict=True):
        np.testing.assert_allclose(after.position_t_s, before.position_t_s - LATE_S)
        assert after.sha256 != before.sha256  # what was observed before is not taken for it
    assert judge_study([record_of(trial, info) for trial in trials]) == ()


def test_a_study_that_says_nothing_is_read_without_the_delay(
    lifelike: Lifelike, tmp_path: Path
) -> None:
    path = written(tmp_path / "silent.h5", lifelike)
    told: list[str] = []
    readings = read_study(path, OBSERVER, workers=0, cache=tmp_path, tell=told.append)
    found_s = sensor_delay_s([record_of(trial, lifelike[1]) for trial in lifelike[0]])
    assert found_s == pytest.approx(LATE_S, abs=2e-3)
    assert f"positions come {1e3 * found_s:.1f} ms late: trials are read without it" in told
    (finding,) = judge_study(records_of(readings))
    assert (finding.code, finding.severity) == ("position_delay_removed", "warning")
    assert finding.value == pytest.approx(1e3 * found_s)

    stated = read_study(written(tmp_path / "says.h5", lifelike, found_s), OBSERVER, workers=0)
    for one, other in zip(readings, stated, strict=True):
        assert one.observed.sha256 == other.observed.sha256
        np.testing.assert_array_equal(
            one.observed.rows.friction_response, other.observed.rows.friction_response
        )

    told.clear()
    again = read_study(path, OBSERVER, workers=0, cache=tmp_path, tell=told.append)
    assert told.count(f"{len(readings)} trials, {len(readings)} of them known already") == 2
    assert judge_study(records_of(again)) == (finding,)


def test_what_a_study_says_is_not_corrected(lifelike: Lifelike, tmp_path: Path) -> None:
    path = written(tmp_path / "study.h5", lifelike, says_s=0.0)
    (finding,) = judge_study(records_of(read_study(path, OBSERVER, workers=0)))
    assert finding.code == "position_delay"


def test_the_finger_of_a_study_is_followed_without_the_delay(
    lifelike: Lifelike, records: list[TrialRecord], tmp_path: Path
) -> None:
    found_s = sensor_delay_s(records)
    someone = lifelike[0][0].info.participant
    silent = written(tmp_path / "silent.h5", lifelike)
    says = written(tmp_path / "says.h5", lifelike, found_s)
    asked = ("--participant", someone, "--json")
    without, stated, late = (
        CliRunner().invoke(app, ["track", str(path), *asked])
        for path in (silent, says, written(tmp_path / "late.h5", lifelike, says_s=0.0))
    )
    assert f"positions come {1e3 * found_s:.1f} ms late: read without it" in without.stderr
    assert "late" not in stated.stderr + late.stderr
    assert without.stdout == stated.stdout != late.stdout


Delay = Callable[[TrialRecord], float]


def late_by(
    records: list[TrialRecord], by_skin_s: Delay, by_friction_s: Delay | None = None
) -> list[TrialRecord]:
    """Return the same records, their positions late by what functions say of each."""
    by_friction_s = by_friction_s or by_skin_s
    late = [(each, by_skin_s(each), by_friction_s(each)) for each in records]
    return [
        replace(
            each,
            statistics=replace(each.statistics, late_by_skin_s=one, late_by_friction_s=other),
        )
        for each, one, other in late
    ]


def test_one_delay_at_all_speeds_and_of_all_people_is_the_sensors(
    records: list[TrialRecord],
) -> None:
    assert sensor_delay_s(late_by(records, lambda _: 0.0312)) == pytest.approx(0.0312)
    assert sensor_delay_s(late_by(records, lambda _: -0.0312)) == pytest.approx(-0.0312)


def test_what_may_be_no_delay_of_the_sensor_is_left(records: list[TrialRecord]) -> None:
    skin_mm = 2.0  # by which the skin is stretched before the pad follows the nail

    def stretched(record: TrialRecord) -> float:
        return skin_mm / record.observed.mean_speed_mm_s

    def of_person(record: TrialRecord) -> float:
        return 0.05 if record.observed.info.participant == "P01" else 0.03

    def of_few(record: TrialRecord) -> float:
        return 0.04 if record in records[:5] else np.nan

    for delay_s in (stretched, of_person, of_few, lambda _: 0.008):
        assert sensor_delay_s(late_by(records, delay_s)) == 0.0
    for one_s, other_s in ((0.0, 0.04), (0.06, 0.04), (-0.04, 0.04)):  # one of them is another
        told = late_by(records, lambda _, it=one_s: it, lambda _, it=other_s: it)  # type: ignore[misc]
        assert sensor_delay_s(told) == 0.0
        assert [each.code for each in judge_study(told)] == ["position_delay"]
    slowest = min(each.observed.info.speed_mm_s for each in records)
    of_one_speed = [each for each in records if each.observed.info.speed_mm_s == slowest]
    assert sensor_delay_s(late_by(of_one_speed, lambda _: 0.04)) == 0.0


def test_rests_at_the_turns_say_nothing(records: list[TrialRecord]) -> None:
    """Friction may stay while a finger rests: positions seem to turn first then."""
    rested = late_by(records, lambda _: np.nan, lambda _: -0.06)
    assert judge_study(rested) == ()
    beside_skin = late_by(records, lambda _: 0.04, lambda _: -0.02)
    assert sensor_delay_s(beside_skin) == pytest.approx(0.04)


def test_friction_alone_tells_the_delay(lifelike: Lifelike, tmp_path: Path) -> None:
    """Most rigs have no accelerometer."""
    trials, info = lifelike
    bare = [replace(each, accel_m_s2=None) for each in trials]
    path = written(tmp_path / "study.h5", (bare, info))
    (finding,) = judge_study(records_of(read_study(path, OBSERVER, workers=0)))
    assert finding.code == "position_delay_removed"
    assert finding.value == pytest.approx(1e3 * LATE_S, abs=2.0)


def by_friction_s(made: Trial) -> float:
    return friction_delay_s(made.force_n.T, made.info.sample_rate_hz, course_of(made))


@pytest.mark.parametrize("late_s", [0.0, 0.025, 0.06])
@pytest.mark.parametrize("speed_mm_s", [50.0, 100.0])
def test_friction_tells_the_delay_of_strokes(
    late_s: float, speed_mm_s: float, rng: np.random.Generator
) -> None:
    made = trial(Made((100.0,), speed_mm_s, seconds=3.0, span_mm=0.6 * speed_mm_s), rng)
    late = replace(made, position_t_s=made.position_t_s + late_s, accel_m_s2=None)
    assert by_friction_s(late) == pytest.approx(late_s, abs=2e-3)


def test_few_reports_tell_nothing(rng: np.random.Generator) -> None:
    made = trial(Made((100.0,), 100.0, seconds=3.0), rng)
    spacing_s = float(np.median(np.diff(made.position_t_s)))
    few = slice(None, None, round(1.0 / 30.0 / spacing_s))
    rare = replace(made, position_mm=made.position_mm[few], position_t_s=made.position_t_s[few])
    assert np.isfinite(by_friction_s(made))
    said = record_of(rare, STUDY).statistics
    assert np.isnan([said.late_by_friction_s, said.late_by_skin_s]).all()


def resting(rests_s: float, late_s: float, rng: np.random.Generator) -> Trial:
    """Return strokes with rests between them, in which friction keeps its sign."""
    made = trial(Made((100.0,), 60.0, seconds=4.0), rng)
    count, rate_hz = made.force_n.shape[0], made.info.sample_rate_hz
    time_s = np.arange(count) / rate_hz
    stroke_s = 0.8
    number, within_s = np.divmod(time_s, stroke_s + rests_s)
    part = np.clip(within_s / stroke_s, 0.0, 1.0)
    there = part**3 * (10.0 - 15.0 * part + 6.0 * part**2)  # of minimum jerk
    right = number % 2 == 0
    force = made.force_n.copy()
    force[:, 0] = np.where(right, 0.2, -0.2) + 0.005 * rng.standard_normal(count)
    x_mm = np.interp(
        made.position_t_s, time_s, 20.0 + 50.0 * np.where(right, there, 1.0 - there)
    )
    position_mm = np.column_stack([x_mm, np.full(x_mm.size, 5.0)])
    position_t_s = made.position_t_s + late_s
    return replace(made, force_n=force, position_mm=position_mm, position_t_s=position_t_s)


@pytest.mark.parametrize("rests_s", [0.05, 0.15, 0.4])
@pytest.mark.parametrize("late_s", [0.0, 0.04])
def test_friction_that_keeps_its_sign_at_rest_tells_nothing(
    rests_s: float, late_s: float, rng: np.random.Generator
) -> None:
    made = resting(rests_s, late_s, rng)
    assert np.isnan(by_friction_s(made))

"""Positions of a hand that turns, beside the acceleration of its nail."""

from dataclasses import replace
from pathlib import Path

import pytest
from tests.blind.generator import Case, Design, Seeds, make_study
from tests.service.identification.plausibility.slips import record_of

from frictus_service.identification.plausibility.judge import judge_study
from frictus_service.study.importers import open_study
from frictus_service.study.trial import StudyInfo, Trial

LATE_S = 0.04
"""Of the touch reports of a lifelike study, whose file does not say so."""


@pytest.fixture(scope="module")
def lifelike(
    module_seed: int, tmp_path_factory: pytest.TempPathFactory
) -> tuple[list[Trial], StudyInfo]:
    path: Path = tmp_path_factory.mktemp("lifelike") / "study.h5"
    design = Design(participants=1, n_speeds=2, n_forces=1, lifelike=True)
    make_study(path, Case("lifelike", (), design), Seeds(module_seed, module_seed + 1))
    with open_study(path) as study:
        return [study.read(each.id) for each in study.trials], study.info


def test_late_positions_are_told_with_their_delay(
    lifelike: tuple[list[Trial], StudyInfo],
) -> None:
    trials, info = lifelike
    (found,) = judge_study([record_of(trial, info) for trial in trials])
    assert (found.code, found.severity) == ("position_delay", "warning")
    assert found.value == pytest.approx(1e3 * LATE_S, abs=4.0)


def test_once_they_are_in_time_nothing_is_said(
    lifelike: tuple[list[Trial], StudyInfo],
) -> None:
    trials, info = lifelike
    mended = [replace(each, position_t_s=each.position_t_s - LATE_S) for each in trials]
    assert judge_study([record_of(trial, info) for trial in mended]) == ()

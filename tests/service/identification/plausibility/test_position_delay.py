"""Positions of a hand that turns, beside the acceleration of its nail."""

from pathlib import Path

import h5py
import numpy as np
import pytest
from tests.blind.generator import Case, Design, Seeds, make_study
from tests.service.identification.plausibility.slips import record_of

from frictus_service.identification.plausibility.judge import judge_study
from frictus_service.study.importers import open_study
from frictus_service.study.trial import StudyInfo, Trial
from frictus_service.study.writer import StudyWriter

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


def test_once_the_study_says_so_nothing_is_said(
    lifelike: tuple[list[Trial], StudyInfo], tmp_path: Path
) -> None:
    late, info = lifelike
    path = tmp_path / "study.h5"
    with StudyWriter(path, info) as writer:
        for trial in late:
            writer.add(trial)
    with h5py.File(path, "r+") as file:
        file.attrs["positions_late_s"] = LATE_S
    with open_study(path) as study:
        trials, info = [study.read(each.id) for each in study.trials], study.info
    for before, trial in zip(late, trials, strict=True):
        np.testing.assert_allclose(trial.position_t_s, before.position_t_s - LATE_S)
        assert trial.sha256 != before.sha256  # what was observed before is not taken for it
    assert judge_study([record_of(trial, info) for trial in trials]) == ()

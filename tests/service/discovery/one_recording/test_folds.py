"""Windows lie apart, folds are stretches of time or have all tones, correlation is measured."""

from collections import Counter
from dataclasses import replace
from datetime import datetime
from pathlib import Path

import numpy as np
import pytest
from tests.blind.generator.recording import Recording, make_recording

from frictus_service.discovery.evidence.bands import WINDOW_S
from frictus_service.discovery.evidence.trial_evidence import TrialEvidence
from frictus_service.discovery.one_recording.windows import (
    LEAST_FOLDS,
    correlation_time_s,
    folds_of,
    windows_of,
)
from frictus_service.study.importers import open_study
from frictus_service.study.trial import StudyInfo, Trial

APART_S = 0.05


@pytest.fixture
def swipe(tmp_path: Path, seed: int) -> tuple[Trial, StudyInfo]:
    path = tmp_path / "swipe.h5"
    make_recording(path, Recording("texture", 2.0), seed)
    with open_study(path) as study:
        return study.read(study.trials[0].id), study.info


def test_windows_lie_apart_in_time(swipe: tuple[Trial, StudyInfo]) -> None:
    found = windows_of(*swipe, 0.3, APART_S)
    began = datetime.fromisoformat(swipe[0].info.started_utc)
    begins = np.array(
        [
            (datetime.fromisoformat(one.observed.info.started_utc) - began).total_seconds()
            for one in found
        ]
    )
    assert len(found) >= 5
    assert np.all(np.diff(begins) >= 0.3 + APART_S - 1e-6)
    assert all(np.isfinite(one.observed.rows.mobility).all() for one in found)
    assert all(one.observed.valid for one in found)


def test_folds_are_stretches_of_time(swipe: tuple[Trial, StudyInfo]) -> None:
    found = windows_of(*swipe, 0.12, 0.02) * 2
    folds = folds_of(found, "mobility")
    assert np.all(np.diff(folds.of_trial) >= 0)
    assert len(folds.names) == 10
    assert min(Counter(folds.of_trial.tolist()).values()) >= len(found) // 10


def test_folds_have_all_tones_where_each_trial_has_one(swipe: tuple[Trial, StudyInfo]) -> None:
    found = windows_of(*swipe, 0.3, APART_S)[:4]

    def played(tone_hz: float) -> list[TrialEvidence]:
        return [
            replace(
                one,
                observed=replace(
                    one.observed, info=replace(one.observed.info, tones_hz=(tone_hz,))
                ),
            )
            for one in found
        ]

    windows = [*played(40.0), *played(250.0)]
    folds = folds_of(windows, "mobility")
    assert len(folds.names) == 4
    for fold in range(4):
        own = [
            windows[k].observed.info.tones_hz for k in np.flatnonzero(folds.of_trial == fold)
        ]
        assert set(own) == {(40.0,), (250.0,)}


def test_a_narrow_band_resembles_itself_for_longer(
    swipe: tuple[Trial, StudyInfo], rng: np.random.Generator
) -> None:
    trial, _ = swipe
    n = trial.force_n.shape[0]
    frequency = np.fft.rfftfreq(n, 1.0 / trial.info.sample_rate_hz)

    def with_band(low: float, high: float) -> float:
        spectrum = np.fft.rfft(rng.standard_normal(n))
        spectrum[(frequency < low) | (frequency > high)] = 0.0
        force = np.zeros_like(trial.force_n)
        force[:, 0] = np.fft.irfft(spectrum, n)
        force[:, 2] = trial.force_n[:, 2]
        return correlation_time_s(replace(trial, force_n=force))

    # A rectangular band of width B: one over B.
    assert with_band(100.0, 1100.0) == pytest.approx(1e-3, rel=0.15)
    assert with_band(200.0, 300.0) == pytest.approx(1e-2, rel=0.25)
    silent = replace(trial, force_n=trial.force_n * [0.0, 0.0, 1.0])
    assert correlation_time_s(silent) == WINDOW_S


def test_tones_that_were_played_once_leave_enough_folds(
    swipe: tuple[Trial, StudyInfo],
) -> None:
    first, *others = windows_of(*swipe, 0.3, APART_S)
    info = replace(first.observed.info, tones_hz=(40.0,))
    windows = [replace(first, observed=replace(first.observed, info=info)), *others]
    folds = folds_of(windows, "mobility")
    assert len(folds.names) == LEAST_FOLDS
    assert set(folds.of_trial.tolist()) == set(range(LEAST_FOLDS))

"""Evidence stands beside the observations row by row, whoever does the work."""

import pickle
from dataclasses import fields, replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from tests.service.identification.trials import RATE_HZ, STUDY, Made, numbered, trial

from frictus_service.discovery.evidence.trial_evidence import (
    EVIDENCE,
    TrialEvidence,
    evidence_of,
    study_evidence,
)
from frictus_service.identification.observation.observe import observe
from frictus_service.identification.pipeline.study import (
    Task,
    observe_study,
    read_task,
    release,
)
from frictus_service.study.importers import open_study
from frictus_service.study.writer import StudyWriter

MADE = (Made((150.0,), 40.0), Made((200.0, 470.0, 731.0)), Made(()), Made((90.0,), 100.0))


def columns(of: object) -> dict[str, np.ndarray]:
    return {field.name: getattr(of, field.name) for field in fields(of)}  # type: ignore[arg-type]


def require_same(one: TrialEvidence, other: TrialEvidence) -> None:
    assert one.observed.info == other.observed.info
    assert one.observed.reasons == other.observed.reasons
    for first, second in (
        (one.observed.rows, other.observed.rows),
        (one.harmonics, other.harmonics),
        (one.stretches, other.stretches),
    ):
        assert type(first) is type(second)
        for name, column in columns(first).items():
            np.testing.assert_array_equal(column, getattr(second, name))


@pytest.mark.parametrize("made", MADE)
def test_one_entry_per_row(made: Made, rng: np.random.Generator) -> None:
    measured = trial(made, rng)
    found = evidence_of(measured, STUDY)
    rows = found.observed.rows
    for column in columns(found.harmonics).values():
        assert column.shape == rows.tone_hz.shape
    for name, column in columns(observe(measured, STUDY).rows).items():
        if made.tones_hz:
            np.testing.assert_array_equal(getattr(rows, name), column)
    for column in columns(found.stretches).values():
        assert column.shape == found.stretches.sweep.shape


def test_where_the_finger_was(rng: np.random.Generator) -> None:
    found = evidence_of(trial(Made((150.0,), 60.0, span_mm=60.0), rng), STUDY)
    rows, stretches = found.observed.rows, found.stretches
    place = {
        (sweep, third): at
        for sweep, third, at in zip(
            stretches.sweep, stretches.third, stretches.position_mm, strict=True
        )
    }
    for sweep, third, at in zip(rows.sweep, rows.third, rows.position_mm, strict=True):
        assert at == place[sweep, third]
    np.testing.assert_allclose(rows.position_mm, 35.0 + 19.0 * (rows.third - 1), atol=4.0)
    np.testing.assert_allclose(stretches.speed_mm_s, 60.0, rtol=0.03)
    np.testing.assert_allclose(stretches.normal_force_n, 0.4, rtol=0.2)


def test_every_row_knows_its_message(rng: np.random.Generator) -> None:
    """At 150 mm/s a third is too short to tell 50 from 60 Hz, and the first one yet shorter."""
    found = evidence_of(trial(Made((120.0,), 150.0, seconds=1.5), rng), STUDY)
    assert found.observed.rows.tone_hz.size > 6
    assert np.isnan(found.harmonics.second).all()
    np.testing.assert_allclose(found.harmonics.message_mean, 0.5, atol=2e-3)
    np.testing.assert_allclose(found.harmonics.message_power, 0.499**2 / 2.0, rtol=5e-3)


def test_a_sweep_that_ends_as_the_trial_begins(rng: np.random.Generator) -> None:
    """Thirds in which the start of the drive still rings are listed, and say nothing."""
    whole = trial(Made((120.0,), 60.0), rng)
    later = 16_000
    cut = replace(
        whole,
        voltage_v=None if whole.voltage_v is None else whole.voltage_v[later:],
        force_n=whole.force_n[later:],
        accel_m_s2=None,
        position_mm=whole.position_mm[whole.position_t_s >= later / RATE_HZ],
        position_t_s=whole.position_t_s[whole.position_t_s >= later / RATE_HZ]
        - later / RATE_HZ,
    )
    found = evidence_of(cut, STUDY)
    assert found.stretches.sweep.size > 2
    assert np.isnan(found.stretches.line60_n2[found.stretches.seconds < 0.1]).all()


def test_power_of_all_tones_together(rng: np.random.Generator) -> None:
    found = evidence_of(trial(Made((200.0, 470.0, 731.0)), rng), STUDY)
    per_stretch = np.square(np.abs(found.observed.rows.message)).reshape(-1, 3).sum(axis=1)
    power = found.harmonics.message_power.reshape(-1, 3)
    np.testing.assert_allclose(power.T, np.tile(per_stretch / 2.0, (3, 1)), rtol=0.01)


def test_a_study(rng: np.random.Generator, tmp_path: Path) -> None:
    path, cache = tmp_path / "study.h5", tmp_path / "cache"
    with StudyWriter(path, STUDY) as writer:
        for number, made in enumerate(MADE):
            writer.add(numbered(trial(made, rng), number))
    with h5py.File(path, "r+") as file:
        force = file["trials/t3/force_n"]
        force[100, 2] = force[100, 2] + 1.0
    observe_study(path, workers=0, cache=cache)  # kept beside the evidence, not in its place
    told: list[str] = []
    alone = study_evidence(path, workers=0, cache=cache, tell=told.append)
    assert "4 trials, 0 of them known already" in told
    assert [each.observed.valid for each in alone] == [True, True, True, False]
    assert alone[3].observed.reasons[0].startswith("sha256 the content does not match")
    assert alone[3].stretches.sweep.size == alone[3].harmonics.second.size == 0
    again = study_evidence(path, workers=0, cache=cache, tell=told.append)
    assert told[-1].startswith("1 of 1")  # what could not be read is tried again
    for one, known in zip(alone, again, strict=True):
        require_same(one, known)
    with open_study(path) as study:
        tasks = [Task(path, each, None, EVIDENCE) for each in study.trials]
    # What a worker process is sent, and what it sends back.
    sent = pickle.loads(pickle.dumps(tasks[0]))
    back = pickle.loads(pickle.dumps(read_task(sent)))
    release()
    require_same(alone[0], TrialEvidence.of(back))

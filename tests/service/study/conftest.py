"""Trials made up of plausible numbers, and files of them."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from frictus_hardware.physics.linear import Mount
from frictus_service.study.trial import StudyInfo, Trial, TrialInfo
from frictus_service.study.writer import StudyWriter

SAMPLE_RATE_HZ = 20_000.0
INFO = StudyInfo(
    rig="rig1", mount=Mount().lateral, extras={"lab": "nord", "humidity": 0.4, "n_people": 2}
)

MakeTrial = Callable[..., Trial]
WriteStudy = Callable[..., Path]


@pytest.fixture
def make_trial(rng: np.random.Generator) -> MakeTrial:
    """Return a function that makes a trial: id, then attributes or data sets by name."""

    def make(name: str = "a", n_samples: int = 400, **changes: Any) -> Trial:
        asked = TrialInfo(
            id=name,
            participant="p1",
            session=0,
            order=int(rng.integers(1_000_000)),
            speed_mm_s=60.0,
            force_n=0.4,
            tones_hz=(250.0,),
            drive_vpp=150.0,
            sample_rate_hz=SAMPLE_RATE_HZ,
            started_utc="2026-03-01T10:00:00Z",
        )
        n_positions = 6
        trial = Trial(
            info=asked,
            voltage_v=rng.uniform(-75.0, 75.0, n_samples),
            force_n=rng.normal(0.4, 0.05, (n_samples, 3)),
            accel_m_s2=rng.normal(0.0, 30.0, (n_samples, 3)),
            skin_velocity_m_s=None,
            position_mm=rng.uniform(0.0, 100.0, (n_positions, 2)),
            position_t_s=np.sort(rng.uniform(0.0, n_samples / SAMPLE_RATE_HZ, n_positions)),
            force_skew_s=25e-6,
            skin_skew_s=-10e-6,
            voltage_source="monitor",
        )
        of_info = {key: changes.pop(key) for key in tuple(changes) if key in _OF_INFO}
        of_info |= {"force_n": changes.pop("target_n")} if "target_n" in changes else {}
        return replace(trial, info=replace(asked, **of_info), **changes)

    return make


_OF_INFO = {
    "participant",
    "session",
    "order",
    "speed_mm_s",
    "tones_hz",
    "drive_vpp",
    "sample_rate_hz",
    "started_utc",
}


@pytest.fixture
def write_study(tmp_path: Path) -> WriteStudy:
    """Return a function that writes trials to a file and returns its path."""

    def write(*trials: Trial, info: StudyInfo = INFO, name: str = "study.h5") -> Path:
        with StudyWriter(tmp_path / name, info) as writer:
            for trial in trials:
                writer.add(trial)
        return tmp_path / name

    return write

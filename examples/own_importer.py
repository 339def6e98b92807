"""Read one's own files as a study, and identify models from them.

The format here is made up: a folder with a NumPy file per trial and its conditions in the name.
A package registers such an importer as an entry point of the group `frictus.importers`; then
`frictus identify FOLDER` and all other commands read it.
"""

import hashlib
import re
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np

from frictus_hardware.physics.linear import Mount
from frictus_laboratory.reproduction.plan import StudyConditions, plan_study
from frictus_laboratory.reproduction.population import draw_people
from frictus_laboratory.reproduction.simulate import simulate_trial
from frictus_service.errors import Exclusion
from frictus_service.identification.analysis import identify
from frictus_service.identification.observation.observe import observe
from frictus_service.study.importers import read_all
from frictus_service.study.trial import StudyInfo, Trial, TrialInfo

NAME = re.compile(r"(\w+)_(\d+)_(\d+)mms_([\d.]+)N_([\d.]+)Hz")


@dataclass
class NumpyFolder:
    """A study in a folder of `.npz` files."""

    folder: Path
    info = StudyInfo(rig="ours", mount=Mount().lateral)
    excluded: tuple[Exclusion, ...] = ()

    @property
    def trials(self) -> tuple[TrialInfo, ...]:
        """Trials that can be read, by participant and order."""
        return tuple(self._info(path) for path in sorted(self.folder.glob("*.npz")))

    @property
    def sha256(self) -> str:
        """Hash of the whole study."""
        whole = hashlib.sha256()
        for path in sorted(self.folder.glob("*.npz")):
            whole.update(path.read_bytes())
        return whole.hexdigest()

    @staticmethod
    def _info(path: Path) -> TrialInfo:
        found = NAME.fullmatch(path.stem)
        assert found is not None, f"{path.name} does not name its conditions"
        person, order, speed, force, tone = found.groups()
        return TrialInfo(
            id=path.stem,
            participant=person,
            session=1,
            order=int(order),
            speed_mm_s=float(speed),
            force_n=float(force),
            tones_hz=(float(tone),),
            drive_vpp=150.0,
            sample_rate_hz=20_000.0,
            started_utc="2026-03-02T09:00:00+00:00",
        )

    def n_samples(self, trial_id: str) -> int:
        """Return how many samples a trial has."""
        return len(self.read(trial_id).force_n)

    def read(self, trial_id: str) -> Trial:
        """Return one trial."""
        path = self.folder / f"{trial_id}.npz"
        with np.load(path) as data:
            return Trial(
                info=self._info(path),
                voltage_v=data["volts"],
                force_n=data["force"],
                accel_m_s2=data["acceleration"],
                skin_velocity_m_s=None,
                position_mm=data["position"],
                position_t_s=data["time"],
            )

    def __enter__(self) -> Self:
        """Return the study."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close it."""


class Importer:
    """What an entry point names."""

    layout = "a folder of .npz files"

    def recognises(self, path: Path) -> bool:
        """Return whether it is such a folder."""
        return path.is_dir() and any(path.glob("*.npz"))

    def open(self, path: Path) -> NumpyFolder:
        """Return the study."""
        return NumpyFolder(path)


def record(folder: Path) -> None:
    """Put a small simulated study there, in the place of a laboratory."""
    rng = np.random.default_rng(1)
    design = StudyConditions(
        (31.0, 97.0, 303.0, 948.0), (20.0, 60.0, 100.0), (0.4,), seconds=2.0
    )
    for plan in plan_study(draw_people(2, rng), design, rng):
        trial, info = simulate_trial(plan), plan.info
        name = (
            f"{info.participant}_{info.order:03d}_{info.speed_mm_s:.0f}mms_"
            f"{info.force_n}N_{info.tones_hz[0]:g}Hz.npz"
        )
        assert trial.voltage_v is not None
        assert trial.accel_m_s2 is not None
        np.savez(
            folder / name,
            volts=trial.voltage_v,
            force=trial.force_n,
            acceleration=trial.accel_m_s2,
            position=trial.position_mm,
            time=trial.position_t_s,
        )


with tempfile.TemporaryDirectory() as name:
    record(Path(name))
    importer = Importer()
    assert importer.recognises(Path(name))
    with importer.open(Path(name)) as study:
        trials = [each for each in read_all(study) if isinstance(each, Trial)]
        found = identify([observe(trial, study.info) for trial in trials])
for person in found.participants:
    print(person.model_dump_json(indent=1, include={"participant", "friction"}))

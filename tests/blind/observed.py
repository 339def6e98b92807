"""Small studies of one person, and what the estimator reports of them."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from tests.blind.generator import Case, Design, Hidden, Seeds, make_study
from tests.blind.generator.people import EVERYBODY_ALIKE
from tests.blind.generator.trial import Sensors

from frictus_service.identification.observation.observe import observe
from frictus_service.identification.observation.response import TrialObservations
from frictus_service.study.importers import open_study
from frictus_service.study.trial import Trial

FloatArray = NDArray[np.float64]

QUIET = Sensors(force_noise_n=1e-5, accel_noise_m_s2=1e-3)
ONE_PERSON = Design(participants=1, n_tones=3, n_speeds=2, n_forces=2)


@contextmanager
def written(
    folder: Path, hidden: tuple[Hidden, ...], seed: int, design: Design = ONE_PERSON
) -> Iterator[Path]:
    """Give the file of a study of people who are all alike."""
    path = folder / f"{seed}.h5"
    make_study(path, Case("test", hidden, design), Seeds(seed, seed), EVERYBODY_ALIKE, QUIET)
    yield path
    path.unlink()


def observations(
    folder: Path, hidden: tuple[Hidden, ...], seed: int, design: Design = ONE_PERSON
) -> list[TrialObservations]:
    """Return what the estimator says of each trial, in order."""
    with written(folder, hidden, seed, design) as path, open_study(path) as study:
        found = [observe(study.read(trial.id), study.info) for trial in study.trials]
    return sorted(found, key=lambda trial: trial.info.order)


def trials(
    folder: Path, hidden: tuple[Hidden, ...], seed: int, design: Design = ONE_PERSON
) -> list[Trial]:
    """Return the trials, in order."""
    with written(folder, hidden, seed, design) as path, open_study(path) as study:
        read = [study.read(trial.id) for trial in study.trials]
    return sorted(read, key=lambda trial: trial.info.order)

"""The paper's processing gives a cutoff, and not the true one."""

import numpy as np
import pytest
from tests.service.identification.paper_literal import literal_cutoffs
from tests.service.identification.trials import LAW, PAPER_TONES_HZ, STUDY, Made, trial

from frictus_hardware.physics.friction import cutoff_hz

pytestmark = pytest.mark.long

STUDIES = 12


def test_the_paper_to_the_letter_misses_the_cutoff(rng: np.random.Generator) -> None:
    true_hz = float(cutoff_hz(LAW, 60.0))
    found_hz = np.array([_literal_hz(rng) for _ in range(STUDIES)])
    print(f"cutoffs to the letter: {found_hz.round()} Hz, in truth {true_hz:.0f} Hz")  # noqa: T201
    # One of them may be right by chance (they scatter by 17 %); the lot of them is not.
    typical = np.sqrt(np.mean(np.square(np.log(found_hz / true_hz))))
    assert 0.05 < typical < 0.5


def _literal_hz(rng: np.random.Generator) -> float:
    trials = [
        trial(Made((tone,), 60.0, seconds=2.04, noise_n=0.002), rng)
        for tone in PAPER_TONES_HZ[::2]
    ]
    found = literal_cutoffs(trials, STUDY)
    assert set(found) == {("P01", 60.0, 0.4)}
    return found[("P01", 60.0, 0.4)]

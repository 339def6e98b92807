"""The paper's processing gives a cutoff, and not the true one."""

import numpy as np
from tests.service.identification.paper_literal import literal_cutoffs
from tests.service.identification.trials import LAW, PAPER_TONES_HZ, STUDY, Made, trial

from frictus_hardware.physics.friction import cutoff_hz


def test_the_paper_to_the_letter_is_biased(rng: np.random.Generator) -> None:
    trials = [
        trial(Made((tone,), 60.0, seconds=2.04, noise_n=0.002), rng)
        for tone in PAPER_TONES_HZ[::2]
    ]
    found = literal_cutoffs(trials, STUDY)
    assert set(found) == {("P01", 60.0, 0.4)}
    (cutoff,) = found.values()
    true = float(cutoff_hz(LAW, 60.0))
    print(f"cutoff to the letter: {cutoff:.0f} Hz, in truth {true:.0f} Hz")  # noqa: T201
    assert 0.01 < abs(cutoff / true - 1.0) < 10.0

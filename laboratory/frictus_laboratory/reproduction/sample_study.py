"""A study of the laboratory next door, whose model gets something wrong: to try discovery on.

Six people of 12 trials of a second each. What is hidden is drawn from effects of the catalogue,
of sizes that so small a study shows.
"""

from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from frictus_laboratory.reproduction.plan import Effects, StudyConditions, plan_study
from frictus_laboratory.reproduction.population import draw_people
from frictus_laboratory.reproduction.simulate import STEPS, simulate_trial, study_info
from frictus_service.study.writer import StudyWriter

PEOPLE: Final = 6
CONDITIONS: Final = StudyConditions(
    tones_hz=(60.0, 250.0, 800.0),
    speeds_mm_s=(30.0, 80.0),
    forces_n=(0.3, 0.6),
    seconds=1.0,
)
HIDDEN: Final = (
    ("direction_asymmetry", "share", 0.15),
    ("force_dependent_gain", "exponent", 0.5),
    ("channel_delay", "delay_s", 2e-4),
)
"""One of them, its parameter so large within `VARIES`."""
VARIES: Final = (0.7, 1.3)


def write_sample_study(path: Path, rng: np.random.Generator) -> Effects:
    """Write the study, and return what is hidden in it.

    Parameters
    ----------
    path : Path
        Of the `study/1` file; it appears once it is whole.
    rng : Generator
        Source of everything random.
    """
    effect, name, size = HIDDEN[int(rng.integers(len(HIDDEN)))]
    effects = ((effect, {name: size * float(rng.uniform(*VARIES))}),)
    plans = plan_study(draw_people(PEOPLE, rng), replace(CONDITIONS, effects=effects), rng)
    with StudyWriter(path, study_info()) as writer:
        for plan in plans:
            writer.add(simulate_trial(plan), STEPS)
    return effects

"""Simulate a study whose fingers have an effect that the model lacks, and find it by name.

Eight people whose gain grows with the force they press with; the study file does not tell.
"""

import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from frictus_service.discovery.report.phrasing import verdict_sentence
from frictus_service.discovery.run import discover_study
from frictus_service.reproduction.plan import StudyConditions, plan_study
from frictus_service.reproduction.population import draw_people
from frictus_service.reproduction.record import record_study

EXPONENT = 0.35
"""Of the normal force, in the gain: what the base model does not have."""


def main() -> None:
    """Simulate, discover, and print what was found."""
    rng = np.random.default_rng(4)
    design = StudyConditions(
        (31.0, 97.0, 303.0, 948.0), (20.0, 60.0, 100.0), (0.2, 0.4, 0.6), seconds=4.0
    )
    plans = [
        replace(
            plan,
            law=replace(
                plan.law, gain_n=plan.law.gain_n * (plan.info.force_n / 0.4) ** EXPONENT
            ),
        )
        for plan in plan_study(draw_people(8, rng), design, rng)
    ]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "study.h5"
        record_study(path, plans)
        found = discover_study(path, seed=1)
    print(verdict_sentence(found))
    for cause in found.causes:
        for name, estimate in cause.parameters.items():
            print(
                f"{cause.id}: {name} = {estimate.value:.3f} {estimate.unit}, put in {EXPONENT}"
            )


if __name__ == "__main__":  # worker processes import this file
    main()

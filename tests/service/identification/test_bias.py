"""The cutoff is right where it is hard: undeclared delay, mount, wandering force, bad trials.

The same trials go through the paper's own processing, which the bias beside ours is of.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pytest
from tests.service.identification.paper_literal import literal_cutoffs

from frictus_hardware.arrays import FloatArray
from frictus_laboratory.reproduction.plan import (
    StudyConditions,
    TrialPlan,
    log_tones,
    plan_study,
)
from frictus_laboratory.reproduction.population import draw_people
from frictus_laboratory.reproduction.simulate import simulate_trial, study_info
from frictus_service.identification.analysis import identify
from frictus_service.identification.documents import Settings
from frictus_service.identification.observation.observe import observe
from frictus_service.identification.observation.response import TrialObservations
from frictus_service.study.trial import Trial

Condition = tuple[str, float, float]

DELAY_S = 1e-4
BAD_SHARE = 0.05
FEW = StudyConditions(
    log_tones(15),
    speeds_mm_s=(20.0, 60.0, 100.0),
    forces_n=(0.4,),
    seconds=1.5,
    delay_s=DELAY_S,
    bad_share=BAD_SHARE,
)
MANY = StudyConditions(log_tones(15), forces_n=(0.2, 0.5), delay_s=DELAY_S, bad_share=BAD_SHARE)


@dataclass(frozen=True)
class Errors:
    """Relative errors of the cutoff, per condition."""

    ours: FloatArray
    literal: FloatArray


def errors_of(design: StudyConditions, people: int, rng: np.random.Generator) -> Errors:
    plans = plan_study(draw_people(people, rng), design, rng)
    observations: list[TrialObservations] = []

    def trials() -> Iterator[Trial]:
        for plan in plans:
            trial = simulate_trial(plan)
            observations.append(observe(trial, study_info()))
            yield trial

    literal = literal_cutoffs(trials(), study_info())
    found = identify(observations, settings=Settings(mixed_models=False, sweeps=False))
    laws = {condition_of(plan): plan.law for plan in plans}
    ours, truth = {}, {}
    for each in found.conditions:
        condition = (each.participant, each.speed_mm_s, each.force_n)
        law = laws[condition]
        truth[condition] = law.cutoff_0_hz + law.slope_hz_per_mm_s * each.measured_speed_mm_s
        if each.friction is not None:
            ours[condition] = each.friction.cutoff_hz.value
    assert set(ours) == set(laws)
    errors = Errors(
        *(
            np.array([value / truth[condition] - 1.0 for condition, value in way.items()])
            for way in (ours, literal)
        )
    )
    for name, error in (("ours", errors.ours), ("the paper's way", errors.literal)):
        median, size = np.median(error), np.median(np.abs(error))
        print(f"cutoff, {name}: median error {median:+.2%}, median size {size:.2%}")  # noqa: T201
    return errors


def is_unbiased(errors: Errors) -> bool:
    """Return whether ours is within 2 %, and better than the paper's way."""
    better = np.median(np.abs(errors.ours)) < np.median(np.abs(errors.literal))
    return bool(abs(np.median(errors.ours)) < 0.02 and better)


def condition_of(plan: TrialPlan) -> Condition:
    return plan.info.participant, plan.info.speed_mm_s, plan.info.force_n


@pytest.mark.long
def test_cutoff_is_within_two_percent(rng: np.random.Generator) -> None:
    assert is_unbiased(errors_of(FEW, 2, rng))


@pytest.mark.long
def test_sizes_do_not_lead_where_phases_know_better() -> None:
    """With weights that had not settled these cutoffs came out 4 to 15 % high, said ±1 %."""
    errors = errors_of(FEW, 1, np.random.default_rng(1404572848))
    assert np.max(np.abs(errors.ours)) < 0.01


@pytest.mark.campaign
@pytest.mark.timeout(1800)
def test_cutoff_is_within_two_percent_with_trials_of_full_length(
    rng: np.random.Generator,
) -> None:
    assert is_unbiased(errors_of(MANY, 4, rng))

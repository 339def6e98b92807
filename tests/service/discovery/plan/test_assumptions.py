"""What a study tells a plan: how people differ who say something, and when there is none."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from tests.service.discovery.made import MOUNT, PAPER, Design, made

from frictus_hardware.arrays import FloatArray
from frictus_service.discovery.evidence.observation_table import used
from frictus_service.discovery.evidence.trial_evidence import TrialEvidence
from frictus_service.discovery.inference.linear_model import ProjectedUnits
from frictus_service.discovery.plan.assumptions import excess_variance
from frictus_service.discovery.plan.documents import Setup
from frictus_service.discovery.plan.run import of_study
from frictus_service.discovery.problem.candidates import candidates_of
from frictus_service.errors import DesignError

SETUP = Setup(PAPER, MOUNT, "friction", tuple(candidates_of("friction")))


def spread_of(estimates: FloatArray, information: FloatArray) -> float:
    none = np.zeros(1)
    left = ProjectedUnits(
        (estimates * information)[:, np.newaxis],
        information[:, np.newaxis],
        none,
        none > 0.0,
        none > 0.0,
    )
    return float(np.sqrt(np.maximum(excess_variance(left), 0.0))[0])


def test_who_says_little_makes_nobody_alike(rng: np.random.Generator) -> None:
    """Nobody's noise is taken for that of others, nor is who says nothing known exactly."""
    between, information = 0.3, np.full(9, 1e3)
    information[-1] = 2.0
    found = []
    for _ in range(200):
        own = rng.normal(0.0, np.hypot(between, 1.0 / np.sqrt(information)))
        found.append(spread_of(own, information))
        silent = spread_of(own, np.where(information < 3.0, 0.0, information))
        assert silent == pytest.approx(spread_of(own[:-1], information[:-1]))
    assert np.sqrt(np.mean(np.square(found))) == pytest.approx(between, rel=0.12)
    assert spread_of(np.ones(9), np.zeros(9)) == 0.0


@pytest.mark.parametrize("target", ["speed_mm_s", "force_n"])
def test_no_plan_is_made_of_trials_without_a_target(
    target: str, rng: np.random.Generator
) -> None:
    none: dict[str, Any] = {target: 0.0}

    def untold(one: TrialEvidence) -> TrialEvidence:
        info = replace(one.observed.info, **none)
        return replace(one, observed=replace(one.observed, info=info))

    evidence = [untold(one) for one in made(rng, design=Design(participants=6))]
    with pytest.raises(DesignError, match=r"no target.*accepted: a study with targets above 0"):
        of_study(used(evidence), {one.observed.info.id: 2.0 for one in evidence}, SETUP)

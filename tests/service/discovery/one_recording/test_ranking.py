"""Two causes are fitted beside each other, whatever their coefficients are counted in."""

from dataclasses import replace

import numpy as np
import pytest
from tests.service.discovery.made import MOUNT, PAPER, Design, Scatter, made
from threadpoolctl import threadpool_limits

from frictus_service.discovery.evidence.evidence_rows import subjects_of
from frictus_service.discovery.evidence.observation_table import rows_of, units_of, used
from frictus_service.discovery.one_recording.ranking import rank
from frictus_service.discovery.problem.candidates import candidates_of
from frictus_service.discovery.problem.problem import DiscoveryProblem

DELAY_S, CORNER_HZ = 2e-4, 8.0
HIDDEN = [("channel_delay", {"delay_s": DELAY_S}), ("charge_leakage", {"corner_hz": CORNER_HZ})]


@pytest.mark.long
def test_a_corner_in_hz_is_seen_beside_a_delay_in_s(rng: np.random.Generator) -> None:
    """Per unit of its coefficient, a delay changes the response a million times as much."""
    steady = Scatter(condition=0.0, contact=0.02)
    evidence = used(made(rng, HIDDEN, Design(participants=1, repeats=8), scatter=steady))
    folds = units_of(evidence, "friction")
    rows = rows_of(evidence, folds, "friction")
    rows = replace(rows, condition_of_trial=np.arange(len(evidence)))
    subjects = tuple(subjects_of(rows, len(folds.names)))
    candidates = tuple(candidates_of("friction"))
    problem = DiscoveryProblem(PAPER, MOUNT, "friction", subjects, candidates, ())
    noise = [np.full(subject.tone.size, steady.response**2) for subject in subjects]
    with threadpool_limits(limits=1):
        ranking = rank(replace(problem, differing=frozenset()), noise)
    found = {
        tuple(ranking.candidates[k].effect for k in model.candidates): model.coefficients
        for model in ranking.models
    }
    delay, corner = found["channel_delay", "charge_leakage"]
    assert delay == pytest.approx(DELAY_S, rel=0.05)
    assert corner == pytest.approx(CORNER_HZ, rel=0.3)

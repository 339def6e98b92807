"""The cost of a rival: what held-out units lose by it."""

import numpy as np
import pytest

from frictus_hardware.arrays import FloatArray
from frictus_service.discovery.decision.prediction_gain import MOST_RIVALS, rival_costs
from frictus_service.discovery.inference.linear_model import Unit, held_out_gain, project_out
from frictus_service.discovery.problem.candidates import Candidate

ROWS, UNITS = 60, 8
NAMES = ("true", "alike", "alike", "unlike", "third", "fourth", "fifth")
CANDIDATES = [Candidate(name, "size", 0.1) for name in NAMES]


def unit(rng: np.random.Generator, signatures: FloatArray) -> Unit:
    count = signatures.shape[1]
    return Unit(
        readings=1.5 * signatures[:, 0] + rng.standard_normal(ROWS),
        own=np.ones((ROWS, 1)),
        effects=signatures,
        generic=np.zeros((ROWS, 0)),
        accuracy=np.zeros(count),
        generic_accuracy=np.zeros(0),
        positive=np.zeros(count, dtype=np.bool_),
        squared=np.zeros(count, dtype=np.bool_),
    )


@pytest.fixture
def units(rng: np.random.Generator) -> list[Unit]:
    signatures = rng.standard_normal((ROWS, len(NAMES)))
    signatures[:, 1] = signatures[:, 0] + 0.5 * signatures[:, 1]
    signatures[:, 2] = signatures[:, 0] + 1.5 * signatures[:, 2]
    return [unit(rng, signatures) for _ in range(UNITS)]


def test_the_most_alike_is_the_cheapest(units: list[Unit]) -> None:
    costs = rival_costs(units, CANDIDATES, named=0, others=[])
    assert len(costs) == MOST_RIVALS
    assert costs[0].id == "alike"
    assert "true" not in {each.id for each in costs}
    assert [each.cost for each in costs] == sorted(each.cost for each in costs)
    assert all(each.ci95[0] < each.cost < each.ci95[1] for each in costs)
    assert costs[0].cost > 0.0


def test_cost_and_gain_add_up_to_what_the_named_one_gains(units: list[Unit]) -> None:
    own = held_out_gain(project_out(units))[:, 0].mean()
    for each in rival_costs(units, CANDIDATES, named=0, others=[]):
        assert each.cost + each.nats_per_unit == pytest.approx(own)


def test_what_stays_in_the_model_is_no_rival(units: list[Unit]) -> None:
    named = {each.id for each in rival_costs(units, CANDIDATES, named=0, others=[3])}
    assert "unlike" not in named

"""What it would cost to take another cause in the place of one that is named."""

from collections.abc import Sequence
from typing import Final

import numpy as np
from scipy import stats

from frictus_service.discovery.document import RivalCost
from frictus_service.discovery.inference.linear_model import Unit, held_out_gain, project_out
from frictus_service.discovery.problem.candidates import Candidate

MOST_RIVALS: Final = 4


def rival_costs(
    units: Sequence[Unit], candidates: Sequence[Candidate], named: int, others: Sequence[int]
) -> tuple[RivalCost, ...]:
    """Return the causes that would do best in a named one's place, the cheapest first.

    Of each cause the candidate that predicts held-out units best, to first order about the
    extended model and beside the other causes; its cost is what the named one predicts better,
    by unit.

    Parameters
    ----------
    units : sequence of Unit
        About the extended model.
    candidates : sequence of Candidate
        What the effects of the units are.
    named : int
        Number of the candidate whose place it is.
    others : sequence of int
        Candidates that stay in the model.
    """
    gain = held_out_gain(project_out(units, others))
    own, total = gain[:, named], gain.sum(axis=0)
    taken = {candidates[k].effect for k in (named, *others)}
    best: dict[str, int] = {}
    for k in np.argsort(-total).tolist():
        if candidates[k].effect not in taken and total[k] != 0.0:
            best.setdefault(candidates[k].effect, k)
    costs = []
    for name, k in list(best.items())[:MOST_RIVALS]:
        cost = own - gain[:, k]
        half = float(stats.t.ppf(0.975, cost.size - 1)) * float(stats.sem(cost))
        mean = float(cost.mean())
        costs.append(
            RivalCost(
                id=name,
                nats_per_unit=float(gain[:, k].mean()),
                cost=mean,
                ci95=(mean - half, mean + half),
            )
        )
    return tuple(costs)

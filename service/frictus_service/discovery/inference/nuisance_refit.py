"""Own parameters as a prediction needs them: fitted beside what it holds, and nothing else."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from frictus_hardware.arrays import FloatArray
from frictus_service.discovery.evidence.evidence_rows import Subject
from frictus_service.discovery.evidence.residuals import reduce
from frictus_service.discovery.inference.linearisation import MOST_CHANGE, SETTLED, Linearised
from frictus_service.discovery.problem.problem import NUISANCE_STEP, DiscoveryProblem

ROUNDS: Final = 6
"""Of Gauss-Newton at most; with two or three parameters, three do."""


def refit_nuisance(
    problem: DiscoveryProblem,
    model: Linearised,
    effects: Sequence[int],
    coefficients: FloatArray,
) -> FloatArray:
    """Return the own parameters with which a model predicts best.

    Those of the model itself were fitted beside random effects, which no prediction holds:
    they would be right at 60 mm/s and 0.4 N, and nothing would be fitted to where a study was.

    Parameters
    ----------
    problem : DiscoveryProblem
        Data, base model and candidates.
    model : Linearised
        From which the fit begins, and by which readings are weighted.
    effects : sequence of int
        Numbers of candidates.
    coefficients : ndarray, shape (n_units, n_effects)

    Returns
    -------
    ndarray, shape (n_units, n_own)
    """
    return np.array(
        [
            _fitted(problem, subject, own, whitening.weight, effects, row)
            for subject, own, whitening, row in zip(
                problem.subjects, model.own, model.whitenings, coefficients, strict=True
            )
        ]
    )


def _fitted(
    problem: DiscoveryProblem,
    subject: Subject,
    own: FloatArray,
    weight: FloatArray,
    effects: Sequence[int],
    coefficients: FloatArray,
) -> FloatArray:
    """Return the own parameters that leave the least of a subject's readings."""

    def left(own: FloatArray) -> FloatArray:
        return weight * reduce(
            subject.layout, problem.rest(subject, own, effects, coefficients)
        )

    for _ in range(ROUNDS):
        here = left(own)
        slopes = [
            (here - left(own + step)) / NUISANCE_STEP
            for step in NUISANCE_STEP * np.eye(own.size)
        ]
        step = np.linalg.lstsq(np.column_stack(slopes), here, rcond=None)[0]
        own = own + np.clip(step, -MOST_CHANGE, MOST_CHANGE)
        if np.all(np.abs(step) < SETTLED):
            break
    return own


def with_refitted_nuisance(problem: DiscoveryProblem, model: Linearised) -> Linearised:
    """Return a model with the own parameters with which it predicts best.

    Parameters
    ----------
    problem : DiscoveryProblem
        Data, base model and candidates.
    model : Linearised
        A fitted model with the units about it.
    """
    return replace(model, own=refit_nuisance(problem, model, model.chosen, model.coefficients))

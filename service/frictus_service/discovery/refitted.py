"""Own parameters as a prediction needs them: fitted beside what it holds, and nothing else."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from frictus_service.discovery.ground import OWN_STEP, Ground
from frictus_service.discovery.linearised import MOST_CHANGE, SETTLED, Linearised
from frictus_service.discovery.readings import reduce
from frictus_service.discovery.subjects import Subject

FloatArray = NDArray[np.float64]

ROUNDS: Final = 6
"""Of Gauss-Newton at most; with two or three parameters, three do."""


def refitted(
    ground: Ground, model: Linearised, effects: Sequence[int], coefficients: FloatArray
) -> FloatArray:
    """Return the own parameters with which a model predicts best.

    Those of the model itself were fitted beside what people lean to, which no prediction holds:
    they would be right at 60 mm/s and 0.4 N, and nothing would be fitted to where a study was.

    Parameters
    ----------
    ground : Ground
    model : Linearised
        From which the fit begins, and by which readings are weighted.
    effects : sequence of int
    coefficients : ndarray, shape (n_units, n_effects)

    Returns
    -------
    ndarray, shape (n_units, n_own)
    """
    return np.array(
        [
            _fitted(ground, subject, own, whitening.weight, effects, row)
            for subject, own, whitening, row in zip(
                ground.subjects, model.own, model.whitenings, coefficients, strict=True
            )
        ]
    )


def _fitted(
    ground: Ground,
    subject: Subject,
    own: FloatArray,
    weight: FloatArray,
    effects: Sequence[int],
    coefficients: FloatArray,
) -> FloatArray:
    """Return the own parameters that leave the least of a subject's readings."""

    def left(own: FloatArray) -> FloatArray:
        return weight * reduce(subject.layout, ground.rest(subject, own, effects, coefficients))

    for _ in range(ROUNDS):
        here = left(own)
        slopes = [(here - left(own + step)) / OWN_STEP for step in OWN_STEP * np.eye(own.size)]
        step = np.linalg.lstsq(np.column_stack(slopes), here, rcond=None)[0]
        own = own + np.clip(step, -MOST_CHANGE, MOST_CHANGE)
        if np.all(np.abs(step) < SETTLED):
            break
    return own


def as_predicting(ground: Ground, model: Linearised) -> Linearised:
    """Return a model with the own parameters with which it predicts best.

    Parameters
    ----------
    ground : Ground
    model : Linearised
    """
    return replace(model, own=refitted(ground, model, model.chosen, model.coefficients))

"""Studies as whitened signatures and readings, drawn: what a study file gives, without it."""

from collections.abc import Sequence

import numpy as np

from frictus_hardware.arrays import FloatArray
from frictus_service.discovery.across_studies.study_statistics import StudyStatistics, condense
from frictus_service.discovery.inference.linear_model import Unit

ROWS = 60


def unit(
    rng: np.random.Generator, sizes: FloatArray, mixing: FloatArray, *, noise: float = 1.0
) -> Unit:
    """Return a person: readings are own parameters and sizes along mixed signatures, and noise.

    Parameters
    ----------
    rng : numpy.random.Generator
    sizes : ndarray, shape (k,)
        Of the person's effects.
    mixing : ndarray, shape (k, k)
        Of independent signatures: how alike the design makes them.
    noise : float
    """
    k = sizes.size
    own = rng.standard_normal((ROWS, 2))
    effects = rng.standard_normal((ROWS, k)) @ mixing
    readings = own @ rng.standard_normal(2) + effects @ sizes
    return Unit(
        readings=readings + noise * rng.standard_normal(ROWS),
        own=own,
        effects=effects,
        generic=rng.standard_normal((ROWS, 3)),
        accuracy=np.zeros(k),
        generic_accuracy=np.zeros(3),
        positive=np.zeros(k, dtype=np.bool_),
        squared=np.zeros(k, dtype=np.bool_),
    )


def studies(
    rng: np.random.Generator,
    sizes: FloatArray,
    *,
    people: int = 8,
    differ: float = 0.05,
    mixing: Sequence[FloatArray] | None = None,
) -> list[StudyStatistics]:
    """Return studies.

    Parameters
    ----------
    rng : numpy.random.Generator
    sizes : ndarray, shape (n_studies, k)
        Means of each study.
    people : int
        In each.
    differ : float
        Standard deviation of people within a study.
    mixing : sequence of ndarray, shape (k, k), or None
        Of each study.
    """
    found = []
    for number, mean in enumerate(sizes):
        mixed = np.eye(mean.size) if mixing is None else mixing[number]
        units = tuple(
            condense(unit(rng, mean + differ * rng.standard_normal(mean.size), mixed))
            for _ in range(people)
        )
        own = 0.2 * rng.standard_normal((people, 2))
        found.append(StudyStatistics(units, units, own))
    return found

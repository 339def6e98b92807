"""The paper's post-hoc tests: Wilcoxon's signed-rank test between speeds, at each force."""

from collections.abc import Mapping
from itertools import combinations

import numpy as np
from scipy import stats

from frictus_hardware.arrays import FloatArray
from frictus_service.identification.documents import PairTest, Parameter
from frictus_service.identification.fit.estimates import Measured
from frictus_service.identification.inference.statistics import LEAST_FOR_FLIPS, holm


def pairs_of(values: Mapping[Parameter, FloatArray], measured: Measured) -> list[PairTest]:
    """Return the tests of every pair of speeds, with Holm's correction beside them.

    Corrected over the pairs at one force: over all forces together not even ten participants
    whose values all rise could reach 5 % (2/2^10 times 50 pairs). Below six participants no p
    reaches 5 %, and none is given.

    Parameters
    ----------
    values : mapping of parameter to ndarray, shape (n_conditions,)
        NaN where it was not estimated.
    measured : Measured
        Fits of all conditions.
    """
    out: list[PairTest] = []
    speeds = np.unique(measured.target_mm_s).tolist()
    for parameter, value in values.items():
        for force in np.unique(measured.target_n).tolist():
            out += _at(parameter, value, measured, force, speeds)
    return out


def _at(
    parameter: Parameter,
    value: FloatArray,
    measured: Measured,
    force: float,
    speeds: list[float],
) -> list[PairTest]:
    found = [
        (pair, differences)
        for pair in combinations(speeds, 2)
        if (differences := _differences(value, measured, force, pair)).size >= LEAST_FOR_FLIPS
    ]
    p = np.array([stats.wilcoxon(differences).pvalue for _, differences in found])
    return [
        PairTest(
            parameter=parameter,
            force_n=force,
            speeds_mm_s=pair,
            n=differences.size,
            median_difference=float(np.median(differences)),
            p=float(alone),
            p_holm=float(corrected),
        )
        for (pair, differences), alone, corrected in zip(found, p, holm(p), strict=True)
    ]


def _differences(
    value: FloatArray, measured: Measured, force: float, pair: tuple[float, float]
) -> FloatArray:
    """Return the second speed's value less the first's, of the people who have both."""
    sides = np.full((2, int(measured.person.max()) + 1), np.nan)
    for side, speed in zip(sides, pair, strict=True):
        at = (measured.target_n == force) & (measured.target_mm_s == speed)
        side[measured.person[at]] = value[at]
    difference = sides[1] - sides[0]
    known: FloatArray = difference[np.isfinite(difference)]
    return known

"""How small an effect a programme shows, and which effects look alike in it."""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from frictus_hardware.arrays import BoolArray, FloatArray, IntArray
from frictus_service.discovery.decision.decision import NAMING
from frictus_service.discovery.evidence.observation_table import LEAST_UNITS
from frictus_service.discovery.inference.linear_model import (
    ProjectedUnits,
    beside,
    project_out,
    similarity,
)
from frictus_service.discovery.inference.significance import signs, standard_error
from frictus_service.discovery.plan.assumptions import Assumptions
from frictus_service.discovery.plan.documents import Setup
from frictus_service.discovery.plan.programme import Programme
from frictus_service.discovery.plan.rows import ExpectedUnits, expected, units_of_people
from frictus_service.discovery.report.assembly import POWER

DRAWS: Final = 15
"""Studies without effects that are drawn to tell how large the largest t is by chance."""


@dataclass(frozen=True, slots=True)
class Ability:
    """What a programme shows; arrays over candidates.

    Attributes
    ----------
    n_units : int
        Compared with each other.
    critical : float
        |t| that the largest of all exceeds by chance in one study of twenty; infinite where
        none is shown.
    standard_error : ndarray
        Of the mean of each coefficient over units; NaN where it is not asked for.
    detectable : ndarray
        Coefficient that is found in four of five studies; infinite where it is not asked for.
    cosine : ndarray, shape (n_candidates, n_candidates)
        Between signatures as the design asks for them.
    """

    n_units: int
    critical: float
    standard_error: FloatArray
    detectable: FloatArray
    cosine: FloatArray


def ability_of(
    programme: Programme, setup: Setup, assumptions: Assumptions, seed: int
) -> Ability | None:
    """Return what a programme shows; None where there are too few units to test anything.

    Parameters
    ----------
    programme : Programme
        All trials of everybody, in order.
    setup : Setup
        Base model, rig and candidates.
    assumptions : Assumptions
        How readings scatter and people differ.
    seed : int
        Of how fingers wander, and of studies without effects.
    """
    n_units = unit_count(programme)
    if n_units < LEAST_UNITS:
        return None
    rng = np.random.default_rng(seed)
    # What fingers do beyond what they are asked for counts as evidence, but does not separate
    # effects, nor show one that the design does not ask for. How people differ takes evidence,
    # and makes no two effects alike.
    wandering = expected(programme, setup, assumptions, rng)
    alike = replace(assumptions, difference=np.zeros_like(assumptions.difference))
    asked = expected(programme.few(), setup, alike, None).units
    shown = _shown(programme, setup, assumptions)
    like = np.resize(np.arange(len(wandering.units)), n_units)
    left = _of_all(project_out(wandering.units), like, shown)
    spread = np.array([assumptions.spread[each] for each in setup.candidates])
    deviation = np.hypot(_scatter_of_estimates(wandering)[like], spread)
    critical = _critical(left, deviation, rng)
    typical = _with_estimates(left, deviation * _typical(n_units))
    size = typical.detectable(critical, POWER)
    return Ability(
        n_units,
        critical,
        standard_error(typical.estimates, typical.information),
        np.where(shown, size, np.inf),
        similarity(asked),
    )


def _shown(programme: Programme, setup: Setup, assumptions: Assumptions) -> BoolArray:
    """Return which effects own gain and cutoff do not take for themselves.

    If neither conditions deviated nor people differed: what is left between conditions is next
    to nothing of an effect then, and not next to nothing of the little that these leave of it.
    """
    one = replace(programme, people=programme.people[:1])
    exact = replace(
        assumptions,
        deviation=np.zeros_like(assumptions.deviation),
        difference=np.zeros_like(assumptions.difference),
    )
    information = project_out(expected(one, setup, exact, None).units).information
    shown: BoolArray = information.sum(axis=0) > 0.0
    return shown


def unit_count(programme: Programme) -> int:
    """Return how many units a programme has to compare."""
    if programme.participants >= LEAST_UNITS:
        return programme.participants
    return len(units_of_people(programme))


def _of_all(left: ProjectedUnits, like: IntArray, shown: BoolArray) -> ProjectedUnits:
    """Return the same of all units; those that are not looked at are like the others."""
    information = np.where(shown, left.information[like], 0.0)
    return replace(left, along=np.zeros_like(information), information=information)


def _scatter_of_estimates(found: ExpectedUnits) -> FloatArray:
    """Return by how much noise makes the units' coefficients differ, (n_units, n_effects).

    Less than information says: that counts to what measuring is accurate, too, which is the
    same in all units.
    """
    scatter = []
    for unit, whitening, accuracy in zip(
        found.units, found.whitenings, found.accuracies, strict=True
    ):
        left, _ = beside(unit)
        information = np.einsum("ij,ij->j", left, left)
        shared = whitening((left.T / whitening.weight).T)
        shared = (shared.T * whitening.weight * accuracy / 2.0).T
        differing = information - np.einsum("ij,ij->j", shared, shared)
        size = np.maximum(information, np.finfo(float).tiny)
        scatter.append(np.sqrt(np.maximum(differing, 0.0)) / size)
    return np.array(scatter)


def _with_estimates(left: ProjectedUnits, estimates: FloatArray) -> ProjectedUnits:
    return replace(left, along=estimates * left.information)


def _typical(n_units: int) -> FloatArray:
    """Return deviates of mean zero and variance one, shape (n_units, 1)."""
    ladder = np.linspace(-1.0, 1.0, n_units)
    deviates: FloatArray = (ladder / ladder.std(ddof=1))[:, np.newaxis]
    return deviates


def _critical(left: ProjectedUnits, deviation: FloatArray, rng: np.random.Generator) -> float:
    flips = signs(left.information.shape[0], rng)
    drawn = [
        _with_estimates(left, deviation * rng.standard_normal(deviation.shape))
        for _ in range(DRAWS)
    ]
    return float(np.median([each.critical(flips, NAMING) for each in drawn]))

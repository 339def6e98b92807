"""How small an effect a programme shows, and which effects look alike in it."""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from frictus_hardware.arrays import BoolArray, FloatArray
from frictus_service.discovery.decision.decision import NAMING
from frictus_service.discovery.evidence.observation_table import LEAST_UNITS
from frictus_service.discovery.inference.linear_model import (
    ProjectedUnits,
    project_out,
    similarity,
)
from frictus_service.discovery.inference.significance import signs, standard_error
from frictus_service.discovery.plan.assumptions import Assumptions
from frictus_service.discovery.plan.documents import Setup
from frictus_service.discovery.plan.programme import Programme
from frictus_service.discovery.plan.rows import expected, units_of_people
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
    # effects, nor show one that the design does not ask for.
    wandering = project_out(expected(programme, setup, assumptions, rng))
    asked = expected(programme.few(), setup, assumptions, None)
    shown = _shown(programme, setup, assumptions)
    left = _of_all(wandering, n_units, shown)
    spread = np.array([assumptions.spread[each] for each in setup.candidates])
    critical = _critical(left, spread, rng)
    typical = _with_estimates(left, spread, _typical(n_units))
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

    If conditions did not deviate: what is left between those is next to nothing of an effect
    then, and not next to nothing of the little that deviations leave of it.
    """
    one = replace(programme, people=programme.people[:1])
    exact = replace(assumptions, deviation=np.zeros_like(assumptions.deviation))
    information = project_out(expected(one, setup, exact, None)).information
    shown: BoolArray = information.sum(axis=0) > 0.0
    return shown


def unit_count(programme: Programme) -> int:
    """Return how many units a programme has to compare."""
    if programme.participants >= LEAST_UNITS:
        return programme.participants
    return len(units_of_people(programme))


def _of_all(left: ProjectedUnits, n_units: int, shown: BoolArray) -> ProjectedUnits:
    """Return the same of all units; those that are not looked at are like the others."""
    like = np.resize(np.arange(left.information.shape[0]), n_units)
    information = np.where(shown, left.information[like], 0.0)
    return replace(left, along=np.zeros_like(information), information=information)


def _with_estimates(
    left: ProjectedUnits, spread: FloatArray, deviates: FloatArray
) -> ProjectedUnits:
    """Return units whose estimates deviate by noise and by differences between people."""
    with np.errstate(divide="ignore"):
        noise = np.where(left.information > 0.0, 1.0 / left.information, 0.0)
    estimates = deviates * np.sqrt(noise + np.square(spread))
    return replace(left, along=estimates * left.information)


def _typical(n_units: int) -> FloatArray:
    """Return deviates of mean zero and variance one, shape (n_units, 1)."""
    ladder = np.linspace(-1.0, 1.0, n_units)
    deviates: FloatArray = (ladder / ladder.std(ddof=1))[:, np.newaxis]
    return deviates


def _critical(left: ProjectedUnits, spread: FloatArray, rng: np.random.Generator) -> float:
    flips = signs(left.information.shape[0], rng)
    drawn = [
        _with_estimates(left, spread, rng.standard_normal(left.information.shape))
        for _ in range(DRAWS)
    ]
    return float(np.median([each.critical(flips, NAMING) for each in drawn]))

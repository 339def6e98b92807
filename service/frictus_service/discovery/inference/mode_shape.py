"""Frequency and quality of a further mode of the skin, fitted beside its share.

A mode is tried at a grid of frequencies and at one quality. What both are off by shows as the
derivative of its signature, from neighbours a step away; steps of Gauss and Newton move the
mode, and the interval of its share is that with frequency and quality free.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.effects.skin import SECOND_MODE_QUALITY
from frictus_service.discovery.inference.linear_model import Unit
from frictus_service.discovery.inference.linearisation import Linearised
from frictus_service.discovery.inference.units_anew import weighted_as
from frictus_service.discovery.problem.candidates import Candidate
from frictus_service.discovery.problem.problem import DiscoveryProblem

STEP: Final = 0.01
"""Of the logarithms of frequency and quality, at which derivatives are taken."""
MOST_STEP: Final = np.array([0.1, 0.4])
"""Of both logarithms at once: a sixth of the grid's ratio, and about the width of a prior."""
STEPS: Final = 3
ROUNDED: Final = 6
"""Decimals."""
SHAPE: Final = ("frequency_hz", "quality")


@dataclass(frozen=True, slots=True)
class ModeShape:
    """Where a mode is, and how narrow, beside the share that a model has of it.

    Attributes
    ----------
    off : ndarray, shape (2,)
        By which the logarithms of frequency and quality are off.
    standard_errors : ndarray, shape (2,)
    """

    off: FloatArray
    standard_errors: FloatArray


def mode_in(candidates: Sequence[Candidate], chosen: Sequence[int]) -> int | None:
    """Return the candidate in a model that is a further mode; None where none is."""
    modes = (k for k in chosen if candidates[k].effect == "second_mode")
    return next(modes, None)


def moved(mode: Candidate, by: FloatArray) -> Candidate:
    """Return a mode at another frequency and quality.

    Parameters
    ----------
    mode : Candidate
        Of `second_mode`.
    by : ndarray, shape (2,)
        Of the logarithms of frequency and quality.
    """
    held = {"quality": SECOND_MODE_QUALITY, **dict(mode.held)}
    there = (
        (name, round(float(held[name] * np.exp(step)), ROUNDED))
        for name, step in zip(SHAPE, by, strict=True)
    )
    return replace(mode, held=tuple(there))


def with_shape(
    problem: DiscoveryProblem,
    model: Linearised,
    ruler: Linearised,
    mode: int,
) -> tuple[Unit, ...]:
    """Return the units about a model, whose own are also what frequency and quality change.

    Parameters
    ----------
    problem : DiscoveryProblem
        Data, base model and candidates.
    model : Linearised
        A fitted model with a mode in it.
    ruler : Linearised
        By which all models are weighed.
    mode : int
        Candidate that is the mode.

    Returns
    -------
    tuple of Unit
        Effects are those of the model, then the two derivatives.
    """
    one = problem.candidates[mode]
    beside = [
        moved(one, np.array(by) * STEP)
        for by in ((1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0))
    ]
    first = len(problem.candidates)
    larger = replace(problem, candidates=(*problem.candidates, *beside))
    wanted = (*model.chosen, *range(first, first + len(beside)))
    place = model.chosen.index(mode)
    share = float(model.coefficients[:, place].mean())
    n = len(model.chosen)
    units = []
    for unit in weighted_as(larger, model, ruler, wanted):
        up, down = unit.effects[:, n::2], unit.effects[:, n + 1 :: 2]
        change = share * (up - down) / (2.0 * STEP)
        alone = unit.only(range(n))
        units.append(replace(alone, effects=np.hstack([alone.effects, change])))
    return tuple(units)

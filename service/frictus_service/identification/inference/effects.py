"""Effects of speed and force on a parameter, and the paper's post-hoc tests.

Between people slopes differ; a mixed model with a random intercept alone rejects a true null
far too often. Speed and force are centred, so that each effect is that at the middle of the
other's range.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from frictus_hardware.arrays import FloatArray
from frictus_service.identification.documents import (
    EFFECT_UNITS,
    UNITS,
    Effect,
    EffectTest,
    EstimatedQuantity,
    PairTest,
    Parameter,
)
from frictus_service.identification.fit.estimates import Cells, Measured
from frictus_service.identification.inference.statistics import (
    LEAST_FOR_FLIPS,
    Mean,
    flip_signs,
    holm,
    mean_of,
    p_of_t,
    t_of,
)

EFFECTS: tuple[Effect, ...] = ("speed", "force", "interaction")


@dataclass(frozen=True, slots=True)
class Centre:
    """Middle of the study's speeds and forces, and whether they vary.

    Attributes
    ----------
    speed_mm_s, force_n : float
        Targets.
    effects : tuple of Effect
        Those that the study can show.
    """

    speed_mm_s: float
    force_n: float
    effects: tuple[Effect, ...]

    @classmethod
    def of(cls, speeds_mm_s: Sequence[float], forces_n: Sequence[float]) -> "Centre":
        """Return the middle of target speeds and forces."""
        speeds, forces = sorted(set(speeds_mm_s)), sorted(set(forces_n))
        shown: list[Effect] = []
        if len(speeds) > 1:
            shown.append("speed")
        if len(forces) > 1:
            shown.append("force")
        if len(shown) == 2:
            shown.append("interaction")
        return cls(float(np.mean(speeds)), float(np.mean(forces)), tuple(shown))

    def design(self, cells: Cells) -> FloatArray:
        """Return a column of ones and one per effect."""
        speed = cells.speed_mm_s - self.speed_mm_s
        force = cells.force_n - self.force_n
        columns = {"speed": speed, "force": force, "interaction": speed * force}
        return np.column_stack(
            [np.ones_like(speed), *(columns[effect] for effect in self.effects)]
        )


def per_participant(cells: Cells, centre: Centre, n_people: int) -> FloatArray:
    """Return each participant's effects by least squares; NaN where they do not determine them.

    Parameters
    ----------
    cells : Cells
        A parameter in all conditions.
    centre : Centre
        Speed and force at which effects are evaluated.
    n_people : int

    Returns
    -------
    ndarray, shape (n_people, 1 + n_effects)
        The value at the centre first.
    """
    design = centre.design(cells)
    scale = np.maximum(np.abs(design).max(axis=0, initial=0.0), np.finfo(float).tiny)
    out = np.full((n_people, design.shape[1]), np.nan)
    for person in range(n_people):
        rows = cells.person == person
        own = design[rows] / scale
        if np.count_nonzero(rows) and np.linalg.matrix_rank(own, tol=1e-3) == own.shape[1]:
            out[person] = np.linalg.lstsq(own, cells.value[rows], rcond=None)[0] / scale
    return out


def across_participants(
    cells: Mapping[Parameter, Cells],
    centre: Centre,
    n_people: int,
    rng: np.random.Generator,
) -> list[EffectTest]:
    """Test every effect on every parameter across participants.

    Parameters
    ----------
    cells : mapping of parameter to Cells
        In all conditions.
    centre : Centre
        Speed and force at which effects are evaluated.
    n_people : int
        How many to draw.
    rng : numpy.random.Generator
        Of random sign flips.
    """
    if not centre.effects or not cells:
        return []
    found = {name: per_participant(own, centre, n_people)[:, 1:] for name, own in cells.items()}
    names = [(name, effect) for name in found for effect in centre.effects]
    table = np.column_stack(list(found.values()))
    known = np.isfinite(table)
    tested = [j for j in range(len(names)) if np.count_nonzero(known[:, j]) >= 2]
    t, p = np.full(len(names), np.nan), np.full(len(names), np.nan)
    for j in tested:
        column = table[known[:, j], j]
        t[j] = t_of(column[:, np.newaxis])[0]
        p[j] = p_of_t(t[j], column.size - 1)
    corrected = np.full(len(names), np.nan)
    corrected[tested] = holm(p[tested])
    alone, largest = _flips(table, known, tested, rng)
    return [
        EffectTest(
            parameter=name,
            effect=effect,
            unit=f"{UNITS[name]} {EFFECT_UNITS[effect]}",
            n=int(np.count_nonzero(known[:, j])),
            value=estimate_of(mean_of(table[known[:, j], j])),
            t=number(t[j]),
            degrees_of_freedom=int(np.count_nonzero(known[:, j])) - 1,
            p=number(p[j]),
            p_holm=number(corrected[j]),
            p_sign_flip=number(alone[j]),
            p_max_t=number(largest[j]),
            per_participant=tuple(table[known[:, j], j].tolist()),
        )
        for j, (name, effect) in enumerate(names)
        if known[:, j].any()
    ]


def _flips(
    table: FloatArray,
    known: NDArray[np.bool_],
    tested: list[int],
    rng: np.random.Generator,
) -> tuple[FloatArray, FloatArray]:
    """Return p of sign flips, with participants of whom all effects are known."""
    alone = np.full(table.shape[1], np.nan)
    largest = np.full(table.shape[1], np.nan)
    whole = known[:, tested].all(axis=1) if tested else np.zeros(0, dtype=np.bool_)
    flipped = flip_signs(table[whole][:, tested], rng) if tested else None
    if flipped is not None:
        alone[tested], largest[tested] = flipped
    return alone, largest


def estimate_of(mean: Mean) -> EstimatedQuantity:
    """Return a mean as it stands in the document."""
    return EstimatedQuantity(
        value=mean.value, standard_error=mean.standard_error, ci95=mean.ci95
    )


def number(value: float) -> float | None:
    """Return a number, or None where it is not finite."""
    return float(value) if np.isfinite(value) else None


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

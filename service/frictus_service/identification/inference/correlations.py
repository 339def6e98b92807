"""Correlations of friction with skin, and conditions that lie far from the rest."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from frictus_hardware.arrays import BoolArray, FloatArray
from frictus_service.identification.documents import (
    Correlation,
    EstimatedQuantity,
    OneCorrelation,
    Parameter,
)
from frictus_service.identification.fit.estimates import FRICTION, MOBILITY, Measured
from frictus_service.identification.inference.effects import Centre
from frictus_service.identification.inference.statistics import far_off, mean_of, p_of_t

LEAST_CONDITIONS = 10
"""Conditions of a participant below which nothing is called an outlier."""
LEAST_SCALE = 0.01
"""Relative deviations of a few per cent are never called far."""
_PASSES = 20


def outliers_of(
    values: Mapping[Parameter, FloatArray], measured: Measured, centre: Centre, mads: float
) -> dict[Parameter, BoolArray]:
    """Return which conditions are outliers in which parameter, shape (n_conditions,) each.

    Judged by the logarithm around the participant's own plane over speed and force, laid by
    least absolute deviations so that the outliers do not lift it.

    Parameters
    ----------
    values : mapping of parameter to ndarray, shape (n_conditions,)
        NaN where it was not estimated.
    measured : Measured
        Fits of all conditions.
    centre : Centre
        Speed and force at which effects are evaluated.
    mads : float
        Scaled median deviations that are far.
    """
    columns = [np.ones(measured.person.size)]
    if "speed" in centre.effects:
        columns.append(measured.speed_mm_s - centre.speed_mm_s)
    if "force" in centre.effects:
        columns.append(measured.force_n - centre.force_n)
    design = np.column_stack(columns)
    out: dict[Parameter, BoolArray] = {}
    for parameter, value in values.items():
        out[parameter] = np.zeros(value.size, dtype=np.bool_)
        for person in np.unique(measured.person):
            rows = np.flatnonzero((measured.person == person) & np.isfinite(value))
            if rows.size >= LEAST_CONDITIONS:
                residual = _residual(design[rows], np.log(value[rows]))
                out[parameter][rows] = far_off(residual, design.shape[1], LEAST_SCALE, mads)
    return out


def _residual(design: FloatArray, value: FloatArray) -> FloatArray:
    """Return residuals of least absolute deviations, by reweighting."""
    weight = np.ones(value.size)
    residual = value
    for _ in range(_PASSES):
        root = np.sqrt(weight)
        line = np.linalg.lstsq(design * root[:, np.newaxis], value * root, rcond=None)[0]
        residual = value - design @ line
        weight = 1.0 / np.maximum(np.abs(residual), 1e-6)
    return residual


LEAST = 5
"""Points below which no correlation is given."""


def correlations_of(
    values: Mapping[Parameter, FloatArray], measured: Measured, participants: Sequence[str]
) -> list[Correlation]:
    """Return the correlations of gain and cutoff with mass, damping and stiffness.

    Parameters
    ----------
    values : mapping of parameter to ndarray, shape (n_conditions,)
        NaN where it was not estimated.
    measured : Measured
        Fits of all conditions.
    participants : sequence of str
        Pseudonym of each condition.
    """
    pairs = [
        (first, second)
        for first in FRICTION
        for second in MOBILITY
        if first in values and second in values
    ]
    out = []
    for first, second in pairs:
        known = np.isfinite(values[first]) & np.isfinite(values[second])
        x, y = values[first][known], values[second][known]
        person, speed = measured.person[known], measured.target_mm_s[known]
        pooled = _spearman(x, y)
        if pooled is None:
            continue
        own = {
            name: found
            for index, name in enumerate(participants)
            if (found := _spearman(x[person == index], y[person == index])) is not None
        }
        mean, p = _mean(own)
        out.append(
            Correlation(
                first=first,
                second=second,
                pooled=pooled,
                per_participant=own,
                within_mean=mean,
                p_within=p,
                at_equal_speed=_at_equal_speed(x, y, person, speed),
                cautions=_cautions(len(pairs), person, speed),
            )
        )
    return out


def _spearman(x: FloatArray, y: FloatArray) -> OneCorrelation | None:
    if x.size < LEAST or np.ptp(x) == 0.0 or np.ptp(y) == 0.0:
        return None
    found = stats.spearmanr(x, y)
    return OneCorrelation(r=float(found.statistic), p=float(found.pvalue), n=x.size)


def _mean(own: Mapping[str, OneCorrelation]) -> tuple[EstimatedQuantity | None, float | None]:
    """Return the mean of the participants' own correlations, each counting once."""
    if len(own) < 2:
        return None, None
    z = np.arctanh(np.clip([one.r for one in own.values()], -0.999, 0.999))
    mean = mean_of(z)
    assert mean.ci95 is not None
    assert mean.standard_error is not None
    low, high = np.tanh(mean.ci95)
    p = p_of_t(mean.value / mean.standard_error, len(own) - 1) if mean.standard_error else None
    value = float(np.tanh(mean.value))
    error = mean.standard_error * (1.0 - value**2)
    return EstimatedQuantity(
        value=value, standard_error=error, ci95=(float(low), float(high))
    ), p


def _at_equal_speed(
    x: FloatArray, y: FloatArray, person: NDArray[np.int64], speed: FloatArray
) -> OneCorrelation | None:
    """Return the correlation of what is left of each person's mean at each speed."""
    _, cell = np.unique(np.column_stack([person, speed]), axis=0, return_inverse=True)
    cell = cell.ravel()
    count = np.bincount(cell)
    several = count[cell] > 1
    rest = [(value - np.bincount(cell, value)[cell] / count[cell])[several] for value in (x, y)]
    return _spearman(*rest)


def _cautions(n_pairs: int, person: NDArray[np.int64], speed: FloatArray) -> tuple[str, ...]:
    people = np.unique(person).size
    out = []
    if person.size > people:
        out.append(
            f"The {person.size} points are not independent: {people} participants, "
            f"{person.size / people:.0f} conditions each. The pooled p takes them for "
            f"{person.size} people; the mean of the participants' own correlations does not."
        )
    if np.unique(speed).size > 1:
        out.append(
            "Speed drives both: parameters that both follow the speed correlate without acting "
            "on each other. At equal speed is what is left without that."
        )
    out.append(
        "Both come from the same measured friction force: a common error, of its gain or of "
        "the mount's response, correlates them."
    )
    if people < 20:
        out.append(f"{people} participants leave the correlation between people wide open.")
    if n_pairs > 1:
        out.append(f"{n_pairs} pairs are tested; the p values are not corrected for that.")
    return tuple(out)

"""Conditions that lie far from the rest of their participant's."""

from collections.abc import Mapping

import numpy as np

from frictus_hardware.arrays import BoolArray, FloatArray
from frictus_service.identification.documents import Parameter
from frictus_service.identification.fit.estimates import Measured
from frictus_service.identification.inference.effects import Centre
from frictus_service.identification.inference.statistics import far_off

LEAST = 10
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
            if rows.size >= LEAST:
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

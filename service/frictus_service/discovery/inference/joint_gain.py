"""How much likelier several effects together make each unit, as the others predict it."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from frictus_hardware.arrays import BoolArray, FloatArray
from frictus_service.discovery.inference.linear_model import Unit, beside, joint, project_out
from frictus_service.discovery.inference.significance import PRIOR_DEGREES
from frictus_service.discovery.projection import LEAST_SHARE, ROUNDING, inverse_of


def joint_gain(units: Sequence[Unit], chosen: Sequence[int]) -> FloatArray:
    """Return by how much several effects together make each unit more likely.

    As `linear_model.held_out_gain`, of all coefficients at once: where signatures are alike,
    the gains of each beside the others do not add up to it.

    Parameters
    ----------
    units : sequence of Unit
        Whitened readings and signatures of each participant or block.
    chosen : sequence of int

    Returns
    -------
    ndarray, shape (n_units,)
    """
    if not chosen:
        return np.zeros(len(units))
    value, noise = fitted_together(units, chosen)
    known = np.isfinite(value)
    return np.array([_gain_of_one(value, noise, known, unit) for unit in range(len(units))])


def fitted_together(
    units: Sequence[Unit], chosen: Sequence[int]
) -> tuple[FloatArray, FloatArray]:
    """Return each unit's coefficients fitted together, NaN where unknown, and covariances.

    Of parameters, and not of their squares, as in `linear_model.ProjectedUnits.tested`. Who
    cannot tell two effects apart knows neither: the smallest coefficients that would do pull
    the mean of those who can.

    Parameters
    ----------
    units : sequence of Unit
        Whitened readings and signatures of each participant or block.
    chosen : sequence of int
        Effects, one at least; what else is known of a unit is its own.

    Returns
    -------
    ndarray, shape (n_units, n_chosen)
    ndarray, shape (n_units, n_chosen, n_chosen)
    """
    units = [unit.only(chosen) for unit in units]
    telling = project_out(units).information > 0.0
    units = [
        replace(unit, effects=np.where(tells, unit.effects, 0.0))
        for unit, tells in zip(units, telling, strict=True)
    ]
    value, noise = (np.stack(each) for each in zip(*map(_fitted_together, units), strict=True))
    told = np.isfinite(joint(units, range(len(chosen))))
    return np.where(told, value, np.nan), noise


def _fitted_together(unit: Unit) -> tuple[FloatArray, FloatArray]:
    effects, readings = beside(unit)
    gram = effects.T @ effects
    covariance = inverse_of(gram, LEAST_SHARE**2)
    value = covariance @ (effects.T @ readings)
    root = np.sign(value) * np.sqrt(np.abs(value))
    squared = unit.squared
    slope = 2.0 * np.maximum(np.abs(root), np.maximum(np.diagonal(covariance), 0.0) ** 0.25)
    scale = np.where(squared, 1.0 / np.maximum(slope, np.finfo(float).tiny), 1.0)
    return np.where(squared, root, value), scale[:, np.newaxis] * covariance * scale


def _gain_of_one(value: FloatArray, noise: FloatArray, known: BoolArray, unit: int) -> float:
    """Return the gain of one unit, whose coefficients are expected to be the others' mean."""
    others = np.arange(len(value)) != unit
    count = known[others].sum(axis=0)
    kept = np.flatnonzero(known[unit] & (count > 0))
    if not kept.size:
        return 0.0
    there = known[others][:, kept]
    least = int(count[kept].min())
    values = np.where(there, value[others][:, kept], 0.0)
    mean = values.sum(axis=0) / count[kept]
    apart = np.where(there, values - mean, 0.0)
    # Mean over those who know; with the roots of both counts it is a covariance in any case.
    expected = noise[others][:, kept][:, :, kept].sum(axis=0)
    expected /= np.sqrt(np.multiply.outer(count[kept], count[kept]))
    variance = (PRIOR_DEGREES * expected + apart.T @ apart) / (PRIOR_DEGREES + least - 1)
    variance *= 1.0 + 1.0 / least
    towards = inverse_of(variance, ROUNDING) @ mean
    return float(towards @ (value[unit, kept] - 0.5 * mean))

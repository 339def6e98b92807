"""Mixed models: a cross-check of effects, and the likelihood-ratio test of people's spread."""

import warnings
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy import optimize, stats

from frictus_hardware.arrays import FloatArray, IntArray
from frictus_service.identification.documents import (
    Effect,
    MixedCheck,
    Parameter,
    SpreadTest,
)
from frictus_service.identification.fit.estimates import Cells
from frictus_service.identification.inference.effects import Centre

CRITICAL: Final = float(stats.chi2.ppf(0.90, 1))
"""A variance cannot be negative: the ratio is 0 in half of all null cases."""
_AT_ZERO: Final = 1e-4
"""Share of the residual variance."""


@dataclass(frozen=True, slots=True)
class RandomIntercept:
    """-2 log-likelihoods at their maxima, without and with a random intercept.

    Attributes
    ----------
    reduced, full : float
        Without and with the random intercept.
    between_variance, residual_variance : float
        Between people, and within.
    """

    reduced: float
    full: float
    between_variance: float
    residual_variance: float


def random_intercept(
    value: FloatArray, design: FloatArray, person: IntArray
) -> RandomIntercept:
    """Fit a linear model with a random intercept by maximum likelihood.

    The likelihood is profiled over the ratio of the variances, its only nonlinear parameter.

    Parameters
    ----------
    value : ndarray, shape (n,)
    design : ndarray, shape (n, k)
    person : ndarray of int, shape (n,)
    """
    n = value.size
    _, group = np.unique(person, return_inverse=True)
    count = np.bincount(group).astype(np.float64)
    table = np.column_stack([design, value])
    sums = np.column_stack([np.bincount(group, column) for column in table.T])
    square = table.T @ table

    def at(ratio: float) -> tuple[float, float]:
        shrink = ratio / (1.0 + ratio * count)
        whole = square - sums.T @ (shrink[:, np.newaxis] * sums)
        line = np.linalg.solve(whole[:-1, :-1], whole[:-1, -1])
        residual = float(whole[-1, -1] - line @ whole[:-1, -1]) / n
        deviance = n * np.log(residual) + float(np.sum(np.log1p(ratio * count)))
        return deviance + n * (1.0 + np.log(2.0 * np.pi)), residual

    found = optimize.minimize_scalar(
        lambda root: at(root**2)[0], bounds=(0.0, 30.0), method="bounded"
    )
    ratio = float(found.x) ** 2
    if at(0.0)[0] <= at(ratio)[0]:
        ratio = 0.0
    full, residual = at(ratio)
    return RandomIntercept(at(0.0)[0], full, ratio * residual, residual)


def people_differ(parameter: Parameter, cells: Cells, centre: Centre) -> SpreadTest | None:
    """Test whether people differ; None below two people or with too few conditions.

    Parameters
    ----------
    parameter : Parameter
        Gain, cutoff, mass, damping or stiffness.
    cells : Cells
        A parameter in all conditions.
    centre : Centre
        Speed and force at which effects are evaluated.
    """
    design = centre.design(cells)
    people = np.unique(cells.person).size
    if people < 2 or cells.value.size < people + design.shape[1]:
        return None
    scale = float(np.std(cells.value)) or 1.0
    design = design / np.maximum(np.abs(design).max(axis=0), np.finfo(float).tiny)
    found = random_intercept(cells.value / scale, design, cells.person)
    unscaled = 2.0 * cells.value.size * np.log(scale)
    ratio = max(found.reduced - found.full, 0.0)
    return SpreadTest(
        parameter=parameter,
        minus_2_ll_reduced=found.reduced + unscaled,
        minus_2_ll_full=found.full + unscaled,
        ratio=ratio,
        critical_5_percent=CRITICAL,
        p=0.5 * float(stats.chi2.sf(ratio, 1)) if ratio > 0.0 else 1.0,
        between_sd=scale * float(np.sqrt(found.between_variance)),
        residual_sd=scale * float(np.sqrt(found.residual_variance)),
    )


def cross_check(cells: Cells, centre: Centre) -> dict[Effect, MixedCheck]:
    """Estimate effects by a mixed model, random in intercept and in the slope with speed.

    Not to be trusted, and marked so, where it does not converge or a variance is at zero.

    Parameters
    ----------
    cells : Cells
        A parameter in all conditions.
    centre : Centre
        Speed and force at which effects are evaluated.
    """
    from statsmodels.regression.mixed_linear_model import MixedLM

    design = centre.design(cells)
    scale = np.maximum(np.abs(design).max(axis=0), np.finfo(float).tiny)
    size = float(np.std(cells.value)) or 1.0
    slopes = 1 + ("speed" in centre.effects)  # the speed is the first effect
    random = (design / scale)[:, :slopes]
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        try:
            model = MixedLM(
                cells.value / size, design / scale, groups=cells.person, exog_re=random
            )
            found = model.fit(reml=True, method=["bfgs", "lbfgs", "powell"])
        except (np.linalg.LinAlgError, ValueError) as error:
            failed = MixedCheck(
                value=None, standard_error=None, p=None, trusted=False, why_not=str(error)
            )
            return dict.fromkeys(centre.effects, failed)
    why = _why_not(bool(found.converged), np.asarray(found.cov_re), float(found.scale), told)
    out: dict[Effect, MixedCheck] = {}
    for column, effect in enumerate(centre.effects, 1):
        value, sd = float(found.params[column]), float(found.bse[column])
        known = bool(np.isfinite(value) and np.isfinite(sd))
        unit = size / float(scale[column])
        out[effect] = MixedCheck(
            value=value * unit if np.isfinite(value) else None,
            standard_error=sd * unit if known else None,
            p=float(found.pvalues[column]) if known else None,
            trusted=why is None and known,
            why_not=why or (None if known else "no standard error"),
        )
    return out


def _why_not(
    converged: bool,
    covariance: FloatArray,
    residual: float,
    told: list[warnings.WarningMessage],
) -> str | None:
    if not (converged and np.all(np.isfinite(covariance))):
        return "it did not converge"
    lowest = float(np.min(np.linalg.eigvalsh(covariance)))
    if not lowest >= _AT_ZERO * residual:
        return "a variance is at zero"
    # What is told of optimisers tried before the one that converged does not matter.
    doubts = [str(one.message) for one in told if "Hessian" in str(one.message)]
    return doubts[0].splitlines()[0] if doubts else None

"""Inference across participants: each is one observation, however often they were measured."""

from dataclasses import dataclass
from itertools import product
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from frictus_hardware.arrays import FloatArray

LEAST_FOR_FLIPS: Final = 6
"""Five participants give 16 different flips: 1/16 is above 5 %."""
MOST_FOR_ALL_FLIPS: Final = 14
RANDOM_FLIPS: Final = 20_000


@dataclass(frozen=True, slots=True)
class Mean:
    """A mean with its standard error and 95 % interval; None where one value says nothing."""

    value: float
    standard_error: float | None
    ci95: tuple[float, float] | None


def mean_of(values: FloatArray) -> Mean:
    """Return the mean and its interval by t with n - 1 degrees of freedom.

    Parameters
    ----------
    values : ndarray, shape (n,)
    """
    n = values.size
    value = float(np.mean(values))
    if n < 2:
        return Mean(value, None, None)
    error = float(np.std(values, ddof=1) / np.sqrt(n))
    half = float(stats.t.ppf(0.975, n - 1)) * error
    return Mean(value, error, (value - half, value + half))


def geometric_mean_of(values: FloatArray) -> Mean | None:
    """Return the geometric mean, interval by t on the logarithm; None if any is not positive.

    Parameters
    ----------
    values : ndarray, shape (n,)
    """
    if not np.all(values > 0.0):
        return None
    mean = mean_of(np.log(values))
    value = float(np.exp(mean.value))
    if mean.ci95 is None or mean.standard_error is None:
        return Mean(value, None, None)
    low, high = np.exp(mean.ci95)
    return Mean(value, value * mean.standard_error, (float(low), float(high)))


def lognormal_mean_of(values: FloatArray) -> Mean | None:
    """Return the mean with an interval for lognormal values; None if any is not positive.

    Cox's method with t (Zhou and Gao, Statistics in Medicine 16, 1997; Olsson, Journal of
    Statistics Education 13, 2005). Student's interval of the values as they are is too short
    above and covers too seldom where they are skewed.

    Parameters
    ----------
    values : ndarray, shape (n,)
    """
    n = values.size
    if n < 2 or not np.all(values > 0.0):
        return None
    logs = np.log(values)
    variance = float(np.var(logs, ddof=1))
    middle = float(np.mean(logs)) + variance / 2.0
    error = np.sqrt(variance / n + variance**2 / (2.0 * (n + 1)))
    half = float(stats.t.ppf(0.975, n - 1)) * error
    low, high = np.exp([middle - half, middle + half])
    mean = mean_of(values)
    return Mean(mean.value, mean.standard_error, (float(low), float(high)))


def t_of(values: FloatArray) -> FloatArray:
    """Return Student's t of the mean of each column; 0 where nothing varies and all is 0.

    Parameters
    ----------
    values : ndarray, shape (..., n, k)
    """
    n = values.shape[-2]
    mean = values.mean(axis=-2)
    error = values.std(axis=-2, ddof=1) / np.sqrt(n)
    with np.errstate(divide="ignore", invalid="ignore"):
        found: FloatArray = np.where(mean == 0.0, 0.0, mean / error)
    return found


def p_of_t(t: float, degrees_of_freedom: float) -> float:
    """Return the two-sided p of a t value."""
    return float(2.0 * stats.t.sf(abs(t), degrees_of_freedom))


def flip_signs(
    values: FloatArray, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray] | None:
    """Return p of sign flips, of each column and corrected by the largest |t| of all.

    Exact: under the null each participant's effects are as likely with the other sign. All
    flips up to 14 participants, else a random 20,000 besides the one observed.

    Parameters
    ----------
    values : ndarray, shape (n, k)
        One row per participant.
    rng : numpy.random.Generator

    Returns
    -------
    tuple of ndarray, shape (k,), or None
        None below six participants, who cannot reach 5 %.
    """
    n = values.shape[0]
    if n < LEAST_FOR_FLIPS:
        return None
    if n <= MOST_FOR_ALL_FLIPS:
        # A flip of all signs gives the same |t|: half of the flips are all there are.
        rest = np.array(list(product((1.0, -1.0), repeat=n - 1)))
        signs = np.column_stack([np.ones(rest.shape[0]), rest])
    else:
        signs = rng.choice((-1.0, 1.0), size=(RANDOM_FLIPS, n))
        signs[0] = 1.0
    # The square of each value stays, so that t follows from the flipped mean alone.
    square = np.sum(values**2, axis=0)
    mean = np.abs(signs @ values) / n
    spread = np.maximum(square / n - mean**2, 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        t = np.where(mean == 0.0, 0.0, mean / np.sqrt(spread / (n - 1)))
    seen = t[0] * (1.0 - 1e-9)  # ties are ties, rounding or not
    alone = np.mean(t >= seen, axis=0)
    largest = np.max(t, axis=1)
    return alone, np.mean(largest[:, np.newaxis] >= seen, axis=0)


def holm(p: FloatArray) -> FloatArray:
    """Return Holm's corrected p values, in the order given.

    Parameters
    ----------
    p : ndarray, shape (k,)
    """
    order = np.argsort(p, kind="stable")
    factors = np.arange(p.size, 0, -1)
    corrected = np.empty_like(p)
    corrected[order] = np.minimum(np.maximum.accumulate(p[order] * factors), 1.0)
    return corrected


def far_off(
    residual: FloatArray, fitted: int, least_scale: float, mads: float
) -> NDArray[np.bool_]:
    """Return which residuals lie so many scaled median deviations from zero.

    Parameters
    ----------
    residual : ndarray, shape (n,)
        Around a fit by least absolute deviations, which passes through `fitted` of them.
    fitted : int
        Number of parameters fitted to the residuals.
    least_scale : float
        The scale is taken to be this at least.
    mads : float
        In standard deviations of normal values.
    """
    distance = np.abs(residual)
    left = np.sort(distance)[fitted:]
    scale = float(np.median(left)) / float(stats.norm.ppf(0.75))
    far: NDArray[np.bool_] = distance > mads * max(scale, least_scale)
    return far

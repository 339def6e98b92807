"""Sums over rows whose errors hang together: a gain that varies between trials and stretches.

Each row has a relative residual ``r = z / H - 1``. Its noise is independent; besides, all rows
of a stretch share one deviation and all rows of a trial another, and these are the larger part:
every tone of the paper's protocol is a trial of its own, and contact differs from trial to
trial. With random effects of variances ``a`` (inner) and ``b`` (outer), the inverse of the
rows' covariance follows from Woodbury's identity, group by group, and is never formed.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import optimize

from frictus_hardware.arrays import FloatArray, IntArray


@dataclass(frozen=True, slots=True)
class Levels:
    """Which rows deviate together.

    Attributes
    ----------
    inner : ndarray of int, shape (n_rows,), or None
        Number of the inner group of each row, from 0. None: each row is its own.
    outer_of_inner : ndarray of int, shape (n_inner,)
        Number of the outer group, from 0.
    n_outer : int
        Number of outer groups.
    """

    inner: IntArray | None
    outer_of_inner: IntArray
    n_outer: int


@dataclass(frozen=True, slots=True)
class GroupVariances:
    """Variances of relative deviations that the rows of an inner or outer group share."""

    inner: float
    outer: float


def moments(
    table: FloatArray, weight: FloatArray, levels: Levels, scatter: GroupVariances
) -> FloatArray:
    """Return ``T' C^-1 T`` of each outer group, shape (n_outer, k, k).

    Parameters
    ----------
    table : ndarray, shape (n_rows, k)
    weight : ndarray, shape (n_rows,)
        Inverse of the variance of the independent noise.
    levels : Levels
        Groups of rows within groups.
    scatter : GroupVariances
        Variances that rows of a group share.
    """
    if levels.inner is None:
        alone = weight / (1.0 + scatter.inner * weight)
        square = _outer_products(table, alone, levels.outer_of_inner, levels.n_outer)
        linear = _sums(table, alone, levels.outer_of_inner, levels.n_outer)
        total = _count(alone, levels.outer_of_inner, levels.n_outer)
    else:
        n_inner = levels.outer_of_inner.size
        square = _outer_products(table, weight, levels.inner, n_inner)
        linear = _sums(table, weight, levels.inner, n_inner)
        total = _count(weight, levels.inner, n_inner)
        square, linear, total = _absorb(square, linear, total, scatter.inner)
        parent, n = levels.outer_of_inner, levels.n_outer
        square, linear = _gather(square, parent, n), _gather(linear, parent, n)
        total = _count(total, parent, n)
    return _absorb(square, linear, total, scatter.outer)[0]


def log_determinant(
    weight: FloatArray, levels: Levels, variances: GroupVariances
) -> FloatArray:
    """Return ``ln det C`` of each outer group, shape (n_outer,), as in `moments`.

    By the matrix determinant lemma, group by group: a random effect of variance ``a`` over rows
    of total weight ``W`` multiplies the determinant by ``1 + a W``.

    Parameters
    ----------
    weight : ndarray, shape (n_rows,)
        Inverse of the variance of the independent noise.
    levels : Levels
        Groups of rows within groups.
    variances : GroupVariances
        Variances that rows of a group share.
    """
    parent, n = levels.outer_of_inner, levels.n_outer
    own, total = -np.log(weight), weight
    if levels.inner is not None:
        own = _count(own, levels.inner, parent.size)
        total = _count(weight, levels.inner, parent.size)
    absorbed = 1.0 + variances.inner * total
    inner = _count(own + np.log(absorbed), parent, n)
    found: FloatArray = inner + np.log1p(variances.outer * _count(total / absorbed, parent, n))
    return found


def scatter_of(
    residual: FloatArray, weight: FloatArray, levels: Levels, fitted: float
) -> GroupVariances:
    """Return the scatter behind residuals, by moments (Paule and Mandel).

    The inner one comes from replicates within the outer groups; the outer one from the groups'
    means around the fit.

    Parameters
    ----------
    residual : ndarray, shape (n_rows,)
    weight : ndarray, shape (n_rows,)
        As in `moments`.
    levels : Levels
        Groups of rows within groups.
    fitted : float
        How many degrees of freedom of the outer means the fit has used up.
    """
    value, noise = residual, 1.0 / weight
    if levels.inner is not None:
        n_inner = levels.outer_of_inner.size
        total = np.bincount(levels.inner, weight, n_inner)
        value = np.bincount(levels.inner, weight * residual, n_inner) / total
        noise = 1.0 / total
    parent, n = levels.outer_of_inner, levels.n_outer
    count = np.bincount(parent, minlength=n)

    def centred(inner: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        certainty = 1.0 / (noise + inner)
        total = np.bincount(parent, certainty, n)
        mean = np.bincount(parent, certainty * value, n) / total
        return certainty * np.square(value - mean[parent]), mean, 1.0 / total

    inner = _balanced(lambda a: float(centred(a)[0].sum()), float(np.sum(count - 1)))
    _, mean, own = centred(inner)
    outer = _balanced(lambda b: float(np.sum(mean**2 / (own + b))), max(n - fitted, 1.0))
    return GroupVariances(inner, outer)


def freedom_of_sum(
    first: FloatArray | float,
    of_first: FloatArray | float,
    second: FloatArray | float,
    of_second: FloatArray | float,
) -> FloatArray:
    """Return the degrees of freedom of a sum of two variances (Welch and Satterthwaite).

    Parameters
    ----------
    first, second : ndarray or float
        Variances, not both 0.
    of_first, of_second : ndarray or float
        Degrees of freedom of each.
    """
    each = np.square(first) / of_first + np.square(second) / of_second
    freedom: FloatArray = np.square(first + second) / each
    return freedom


def _balanced(squares: Callable[[float], float], freedom: float) -> float:
    """Return the variance at which weighted squares are what chance gives; 0: they are less.

    Every row counts by its own noise and the scatter together. Unweighted, one that is nearly
    all noise would hide how the others scatter.
    """
    if freedom < 1.0 or squares(0.0) <= freedom:
        return 0.0
    highest = 1e-12
    while squares(highest) > freedom:
        highest *= 10.0
    return float(optimize.brentq(lambda a: squares(a) - freedom, 0.0, highest, rtol=1e-6))


def _absorb(
    square: FloatArray, linear: FloatArray, total: FloatArray, variance: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the sums of groups, each with a random effect of its own."""
    kept = 1.0 / (1.0 + variance * total)
    outer = np.einsum("gi,gj->gij", linear, linear)
    return (
        square - (variance * kept)[:, np.newaxis, np.newaxis] * outer,
        kept[:, np.newaxis] * linear,
        kept * total,
    )


def _outer_products(
    table: FloatArray, weight: FloatArray, group: IntArray, n: int
) -> FloatArray:
    k = table.shape[1]
    out = np.empty((n, k, k))
    for i in range(k):
        weighted = weight * table[:, i]
        for j in range(i, k):
            out[:, i, j] = out[:, j, i] = np.bincount(group, weighted * table[:, j], n)
    return out


def _sums(table: FloatArray, weight: FloatArray, group: IntArray, n: int) -> FloatArray:
    return np.column_stack([np.bincount(group, weight * column, n) for column in table.T])


def _count(weight: FloatArray, group: IntArray, n: int) -> FloatArray:
    return np.bincount(group, weight, n).astype(np.float64)


def _gather(values: FloatArray, group: IntArray, n: int) -> FloatArray:
    out = np.zeros((n, *values.shape[1:]))
    np.add.at(out, group, values)
    return out

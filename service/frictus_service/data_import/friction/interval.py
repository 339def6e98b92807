"""Means and slopes with 95 % intervals by Student's t, slides as units."""

from dataclasses import dataclass

import numpy as np

from frictus_hardware.arrays import FloatArray


@dataclass(frozen=True, slots=True)
class Interval:
    """A value.

    Attributes
    ----------
    value : float
        The estimate.
    low, high : float
        Ends of the 95 % interval.
    """

    value: float
    low: float
    high: float

    def transformed(self, by: "np.ufunc") -> "Interval":
        """Return the interval of a rising function of the value."""
        return Interval(float(by(self.value)), float(by(self.low)), float(by(self.high)))


def mean_of(values: FloatArray) -> Interval | None:
    """Return the mean of values; None where fewer than three are there.

    Parameters
    ----------
    values : ndarray, shape (n,)
        NaN left out.
    """
    there = values[np.isfinite(values)]
    found = regression(np.ones((there.size, 1)), there)
    return None if found is None else found[0]


def regression(columns: FloatArray, values: FloatArray) -> list[Interval] | None:
    """Return the coefficients of least squares; None where the columns do not determine them.

    Parameters
    ----------
    columns : ndarray, shape (n, p)
    values : ndarray, shape (n,)
    """
    from scipy import stats

    count, parameters = columns.shape
    free = count - parameters
    if free < 2 or np.linalg.matrix_rank(columns) < parameters:
        return None
    found = np.linalg.lstsq(columns, values)[0]
    scatter = float(np.square(values - columns @ found).sum()) / free
    errors = np.sqrt(scatter * np.diag(np.linalg.inv(columns.T @ columns)))
    width = float(stats.t.ppf(0.975, free)) * errors
    return [
        Interval(float(value), float(value - off), float(value + off))
        for value, off in zip(found, width, strict=True)
    ]

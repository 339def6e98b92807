"""Friction coefficient against speed and load, with intervals over slides.

``F_t = c · F_n^k · v^b`` is fitted as logarithms, one row per slide. k below 1 is the contact
of a soft finger, whose coefficient falls with load (k near 2/3 by Hertz and adhesion: Wolfram
1983; Adams et al. 2013, doi 10.1098/rsif.2012.0467).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from frictus_hardware.arrays import FloatArray
from frictus_service.data_import.friction.slides import Slide


@dataclass(frozen=True, slots=True)
class StudentInterval:
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

    def transformed(self, by: "np.ufunc") -> "StudentInterval":
        """Return the interval of a rising function of the value."""
        return StudentInterval(float(by(self.value)), float(by(self.low)), float(by(self.high)))


def mean_of(values: FloatArray) -> StudentInterval | None:
    """Return the mean of values; None where fewer than three are there.

    Parameters
    ----------
    values : ndarray, shape (n,)
        NaN left out.
    """
    there = values[np.isfinite(values)]
    found = regression(np.ones((there.size, 1)), there)
    return None if found is None else found[0]


def regression(columns: FloatArray, values: FloatArray) -> list[StudentInterval] | None:
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
        StudentInterval(float(value), float(value - off), float(value + off))
        for value, off in zip(found, width, strict=True)
    ]


LEAST_RATIO: Final = 1.3
"""Of the largest to the smallest speed, or load, from which an exponent is estimated."""


@dataclass(frozen=True, slots=True)
class FrictionCoefficient:
    """Of slides without a drive.

    Attributes
    ----------
    slides : int
        Used.
    coefficient : StudentInterval
        F_t / F_n at `speed_mm_s` and `load_n`.
    speed_mm_s, load_n : float
        Geometric means.
    speed_exponent, load_exponent : StudentInterval or None
        b, and k; None where speeds, or loads, differ too little to say.
    """

    slides: int
    coefficient: StudentInterval
    speed_mm_s: float
    load_n: float
    speed_exponent: StudentInterval | None
    load_exponent: StudentInterval | None


def friction_coefficient(slides: Sequence[Slide]) -> FrictionCoefficient | None:
    """Return the coefficient; None where fewer than three slides have both forces, in newtons.

    Slides are taken as independent; where both directions occur, they may differ by a factor,
    as an offset of the sensor makes them differ.

    Parameters
    ----------
    slides : sequence of Slide
        Without a drive.
    """
    rows = np.array(
        [
            (_mean(each.friction), _mean(each.normal), each.speed_mm_s, each.direction)
            for each in slides
            if each.unit == "N"
        ]
    ).reshape(-1, 4)
    rows = rows[np.all(np.isfinite(rows), axis=1) & np.all(rows[:, :3] > 0.0, axis=1)]
    if len(rows) < 3:
        return None
    friction, load, speed = np.log(rows[:, :3]).T
    fast, heavy = (values - values.mean() for values in (speed, load))
    varied = [np.ptp(values) >= np.log(LEAST_RATIO) for values in (speed, load)]
    columns = [np.ones(len(rows))]
    columns += [values for values, wide in zip((fast, heavy), varied, strict=True) if wide]
    if np.ptp(rows[:, 3]) > 0.0:
        columns.append(rows[:, 3] - rows[:, 3].mean())
    # Without an exponent of its own the load enters as in Amontons' law.
    target = friction - load.mean() if varied[1] else friction - load
    found = regression(np.column_stack(columns), target)
    if found is None:
        return None
    exponents = found[1:]
    return FrictionCoefficient(
        slides=len(rows),
        coefficient=found[0].transformed(np.exp),
        speed_mm_s=float(np.exp(speed.mean())),
        load_n=float(np.exp(load.mean())),
        speed_exponent=exponents[0] if varied[0] else None,
        load_exponent=exponents[int(varied[0])] if varied[1] else None,
    )


def _mean(values: FloatArray) -> float:
    there = values[np.isfinite(values)]
    return float(there.mean()) if there.size else np.nan

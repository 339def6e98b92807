"""Friction coefficient against speed and load, with intervals over slides.

``F_t = c · F_n^k · v^b`` is fitted as logarithms, one row per slide. k below 1 is the contact
of a soft finger, whose coefficient falls with load (k near 2/3 by Hertz and adhesion: Wolfram
1983; Adams et al. 2013, doi 10.1098/rsif.2012.0467). An offset of the sensor adds to the force,
with one sign along x and the other against it: it is no factor, and is taken off before.
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

    def shifted(self, by: float) -> "StudentInterval":
        """Return the interval of the value and a number."""
        return StudentInterval(self.value + by, self.low + by, self.high + by)


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
MOST_AGAINST: Final = 0.1
"""Share of slides with friction against the motion: with more, signs or zeros are wrong."""


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
    offset_n : StudentInterval or None
        Of the tangential force, taken off; None where all slides have one direction.
    """

    slides: int
    coefficient: StudentInterval
    speed_mm_s: float
    load_n: float
    speed_exponent: StudentInterval | None
    load_exponent: StudentInterval | None
    offset_n: StudentInterval | None


def friction_coefficient(
    slides: Sequence[Slide],
) -> tuple[FrictionCoefficient | None, list[str]]:
    """Return the coefficient, None where it cannot be told, and what is to be known of it.

    Slides are taken as independent. Where both directions occur, an offset of the sensor is
    fitted with the coefficient, whose interval holds what is not known of the offset.

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
    rows = rows[np.all(np.isfinite(rows), axis=1) & np.all(rows[:, 1:3] > 0.0, axis=1)]
    total, both_ways = len(rows), len(rows) > 0 and np.ptp(rows[:, 3]) > 0.0
    rows = rows[rows[:, 0] > rows[:, 3] * (_rough_offset(rows) if both_ways else 0.0)]
    against, notes = total - len(rows), []
    if total < len(slides):
        notes.append(
            f"{len(slides) - total} slides lack tangential or normal force in newtons, and are "
            "not in the coefficient"
        )
    if against > MOST_AGAINST * total:
        notes.append(
            f"no friction coefficient: {against} of {total} slides have friction against their "
            f"motion; accepted: {MOST_AGAINST:.0%} of them; look at the sign of the tangential "
            "force, and at its zero where nothing touches the sensor"
        )
        return None, notes
    if against:
        notes.append(
            f"{against} of {total} slides have friction against their motion and are not in "
            "the coefficient, which may be too large therefore"
        )
    found = _fitted(rows)
    if found is None:
        notes.append(
            "no friction coefficient: it takes three slides with tangential and normal force "
            "in newtons, and four where their directions differ"
        )
        return None, notes
    if (offset := found.offset_n) is None:
        notes.append(
            "all slides have one direction: an offset of the tangential force cannot be told "
            "from friction, and is in the coefficient"
        )
    else:
        notes.append(
            "the tangential force differs between directions, as by an offset of the sensor of "
            f"{offset.value:.3g} N [{offset.low:.3g}, {offset.high:.3g}], which is taken off"
        )
    exponents = (("speed", found.speed_exponent), ("load", found.load_exponent))
    notes += [
        f"the {name} varied too little to say how friction depends on it"
        for name, exponent in exponents
        if exponent is None
    ]
    return found, notes


def _rough_offset(rows: FloatArray) -> float:
    """Return the offset if friction were proportional to the load."""
    friction, load, _, direction = rows.T
    columns = np.column_stack([np.ones(len(rows)), direction / load])
    return float(np.linalg.lstsq(columns, friction / load)[0][1])


def _fitted(rows: FloatArray) -> FrictionCoefficient | None:
    """Fit rows of friction, load, speed and direction."""
    from scipy import optimize

    if len(rows) < 3:
        return None
    friction, direction = rows[:, 0], rows[:, 3]
    load, speed = np.log(rows[:, 1:3]).T
    fast, heavy = (values - values.mean() for values in (speed, load))
    varied = [np.ptp(values) >= np.log(LEAST_RATIO) for values in (speed, load)]
    columns = np.column_stack(
        [np.ones(len(rows))]
        + [values for values, wide in zip((fast, heavy), varied, strict=True) if wide]
    )

    def target(offset_n: float) -> FloatArray:
        # Without an exponent of its own the load enters as in Amontons' law.
        against = load.mean() if varied[1] else load
        logs: FloatArray = np.log(friction - direction * offset_n) - against
        return logs

    def scatter(offset_n: float) -> float:
        values = target(offset_n)
        left = values - columns @ np.linalg.lstsq(columns, values)[0]
        return float(left @ left)

    offset = 0.0
    both_ways = np.ptp(direction) > 0.0
    if both_ways:
        # Between these all friction is along the motion.
        ends = -friction[direction < 0.0].min(), friction[direction > 0.0].min()
        offset = float(optimize.minimize_scalar(scatter, bounds=ends, method="bounded").x)
        # What a little more offset does to the logarithms: its error is in all intervals.
        slope = direction / (friction - direction * offset)
        columns = np.column_stack([columns, slope])
    found = regression(columns, target(offset))
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
        offset_n=found[-1].shifted(offset) if both_ways else None,
    )


def _mean(values: FloatArray) -> float:
    there = values[np.isfinite(values)]
    return float(there.mean()) if there.size else np.nan

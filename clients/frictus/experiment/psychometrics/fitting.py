"""Psychometric functions fitted to trials: by maximum likelihood and by their posterior.

The likelihood is computed on a grid of half level (where F is 0.5), slope, guess and lapse
rate, first coarse, then again where the threshold has any probability. From the same table come
the posterior with its central credible interval (Kuss, Jaekel and Wichmann 2005, Journal of
Vision 5(5):8) and the profile likelihood with its interval of the likelihood ratio (Venzon and
Moolgavkar 1988, Applied Statistics 37, 87-94).
"""

from dataclasses import dataclass
from statistics import NormalDist
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from frictus.errors import ArgumentError
from frictus.experiment.psychometrics.psychometric import (
    LAPSE_FLOOR,
    Family,
    FloatArray,
    probability,
    threshold_of,
)

SLOPES: Final = np.geomspace(0.5, 12.0, 25)
LAPSES: Final = np.r_[np.linspace(LAPSE_FLOOR, 0.105, 6), np.linspace(0.165, 0.405, 5)]
"""The prior makes great ones improbable; if the grid ended below the observer's, the threshold
would be found where it is not, and within a narrow interval."""
GUESSES: Final = np.linspace(0.005, 0.605, 13)
"""Where the guess rate is not known from the task."""
GRID: Final = 101
BEYOND: Final = 1.0
"""Decades beyond the levels presented in which a threshold is looked for."""
NEGLIGIBLE: Final = 1e-9
UNLIKELY: Final = 1e-3
RESOLVED: Final = 7
"""Likely slopes or rates below which their steps are made finer."""


@dataclass(frozen=True, slots=True)
class Estimate:
    """A value and its interval.

    Attributes
    ----------
    value : float
        The estimate.
    low, high : float
        Ends of the interval.
    """

    value: float
    low: float
    high: float

    def holds(self, truth: float) -> bool:
        """Return whether a value lies within the interval.

        Parameters
        ----------
        truth : float
            The value.
        """
        return self.low <= truth <= self.high


@dataclass(frozen=True, slots=True)
class PsychometricFit:
    """What trials say of a psychometric function.

    Attributes
    ----------
    threshold : Estimate
        Level at which F is 0.5: mean of the posterior in log10, central credible interval.
    threshold_ml : Estimate
        The same by maximum likelihood, with the interval of the likelihood ratio.
    slope : Estimate
        Posterior of the slope.
    guess, lapse : float
        Posterior means.
    trials : int
        How many trials were fitted.
    open_ended : bool
        Whether an interval reaches the end of the levels looked at: the trials do not bound the
        threshold on that side.
    """

    threshold: Estimate
    threshold_ml: Estimate
    slope: Estimate
    guess: float
    lapse: float
    trials: int
    open_ended: bool


def fit(
    levels: ArrayLike,
    positive: ArrayLike,
    guess: float | None = 0.5,
    *,
    family: Family = "weibull",
    confidence: float = 0.95,
) -> PsychometricFit:
    """Fit a psychometric function to the answers of trials.

    The prior is uniform in log level from a decade below to a decade above the levels
    presented, log-normal in slope (median 2.5, factor of 2 at one standard deviation) and
    falls with the lapse rate as Beta(1, 20); the guess rate, where free, as Beta(1, 5).

    Parameters
    ----------
    levels : array_like, shape (n_trials,)
        Levels as rendered; 0 is a catch trial, which tells of the guess rate alone.
    positive : array_like of bool, shape (n_trials,)
        Correct, or "yes", or "different".
    guess : float or None
        Guess rate, 0 to 0.5: 0.5 for two alternatives; None estimates it.
    family : {'weibull', 'logistic'}
        The function.
    confidence : float
        Of the intervals, 0.5 to 0.999.

    Raises
    ------
    ArgumentError
        If there are no trials, a level is below 0, none is above, or an argument is out of
        range.
    """
    level, answer = np.asarray(levels, float).ravel(), np.asarray(positive, bool).ravel()
    if level.size == 0 or level.size != answer.size:
        raise ArgumentError(
            f"{level.size} levels and {answer.size} answers: as many, at least 1"
        )
    if not (np.all(np.isfinite(level)) and np.all(level >= 0.0) and np.any(level > 0.0)):
        raise ArgumentError("levels of trials to fit are finite, 0 (catch trials) or above")
    if not 0.5 <= confidence <= 0.999:
        raise ArgumentError(f"confidence {confidence}: 0.5 to 0.999 accepted")
    if guess is not None and not 0.0 <= guess <= 0.5:
        raise ArgumentError(f"guess rate {guess}: 0 to 0.5 accepted, None estimates it")
    distinct, which = np.unique(level, return_inverse=True)
    hits = np.bincount(which, weights=answer).astype(np.float64)
    misses = np.bincount(which, weights=~answer).astype(np.float64)
    guesses = GUESSES if guess is None else np.array([guess])
    presented = distinct[distinct > 0.0]
    ends = np.log10(presented[[0, -1]]) + BEYOND * np.array([-1.0, 1.0])
    grid = _Grid(np.linspace(float(ends[0]), float(ends[1]), GRID), SLOPES, guesses, LAPSES)
    table = _log_likelihood(grid, distinct, hits, misses, family)
    for _ in range(2):  # once or twice narrower, so that the steps are small where it counts
        grid = _narrowed(grid, table)
        table = _log_likelihood(grid, distinct, hits, misses, family)
    return _summary(grid, table, level.size, confidence, ends)


class _Grid(NamedTuple):
    """Values of each parameter; a table over them has their shape.

    Attributes
    ----------
    axis : ndarray
        Half levels, log10, in even steps.
    slopes : ndarray
        In even steps of their logarithm.
    guesses, lapses : ndarray
        Rates; one guess where the task gives it.
    """

    axis: FloatArray
    slopes: FloatArray
    guesses: FloatArray
    lapses: FloatArray


def _narrowed(grid: _Grid, table: FloatArray) -> _Grid:
    """Return the grid where there is any probability, in finer steps.

    Slopes and rates keep theirs as long as several of them are likely: of thousands of trials
    none might be near the truth, and the threshold's interval would miss it.
    """
    posterior = table + _log_prior(grid)
    made = []
    for which, values in enumerate(grid):
        mass = np.maximum(_marginal(posterior, which), _profile(table, which))
        likely = np.flatnonzero(mass > (NEGLIGIBLE if which == 0 else UNLIKELY))
        begin, end = max(likely[0] - 1, 0), min(likely[-1] + 1, values.size - 1)
        if which == 0:
            made.append(np.linspace(values[begin], values[end], GRID))
        elif values.size > 1 and likely.size < RESOLVED:
            spaced = np.geomspace if which == 1 else np.linspace
            made.append(spaced(values[begin], values[end], values.size))
        else:
            made.append(values)
    return _Grid(*made)


def _log_likelihood(
    grid: _Grid, levels: FloatArray, hits: FloatArray, misses: FloatArray, family: Family
) -> FloatArray:
    """Return log likelihoods, shape (half levels, slopes, guesses, lapses)."""
    half = 10.0 ** grid.axis[:, np.newaxis]
    threshold = threshold_of(half, grid.slopes, family)[..., np.newaxis, np.newaxis]
    slopes, guesses = grid.slopes[:, np.newaxis, np.newaxis], grid.guesses[:, np.newaxis]
    total = np.zeros(tuple(values.size for values in grid))
    for level, hit, miss in zip(levels, hits, misses, strict=True):
        p = probability(level, threshold, slopes, guesses, grid.lapses, family)
        total += hit * np.log(np.maximum(p, 1e-12)) + miss * np.log(np.maximum(1 - p, 1e-12))
    return total


def _log_prior(grid: _Grid) -> FloatArray:
    """Return the log prior, shape (1, slopes, guesses, lapses), uniform in half level."""
    slope = -0.5 * (np.log(grid.slopes / 2.5) / np.log(2.0)) ** 2
    guess = 4.0 * np.log1p(-grid.guesses)  # a constant where there is one
    steps = np.log(np.gradient(grid.lapses))  # steps are uneven
    lapse = 19.0 * np.log1p(-grid.lapses) + steps
    total = slope[:, np.newaxis, np.newaxis] + guess[:, np.newaxis] + lapse
    return np.asarray(total[np.newaxis], np.float64)


def _marginal(log_posterior: FloatArray, axis: int) -> FloatArray:
    """Return the posterior along one axis of the grid; it sums to 1."""
    weight = np.exp(log_posterior - np.max(log_posterior))
    others = tuple(each for each in range(4) if each != axis)
    marginal = np.sum(weight, axis=others)
    return np.asarray(marginal / np.sum(marginal), np.float64)


def _profile(log_likelihood: FloatArray, axis: int = 0) -> FloatArray:
    """Return the profile likelihood along one axis of the grid, 1 at its maximum."""
    profile = np.max(log_likelihood, axis=tuple(each for each in range(4) if each != axis))
    return np.asarray(np.exp(profile - np.max(profile)), np.float64)


def _central(axis: FloatArray, mass: FloatArray, confidence: float) -> tuple[float, float]:
    """Return the central interval of a distribution on a grid of even steps."""
    step = axis[1] - axis[0]
    edges = np.concatenate([[axis[0] - step / 2], axis + step / 2])
    cumulative = np.concatenate([[0.0], np.cumsum(mass)])
    tail = (1.0 - confidence) / 2.0
    low, high = np.interp([tail, 1.0 - tail], cumulative, edges)
    return float(low), float(high)


def _likelihood_interval(
    axis: FloatArray, profile: FloatArray, confidence: float
) -> tuple[float, float, float]:
    """Return maximum and ends of the interval of the likelihood ratio."""
    drop = NormalDist().inv_cdf(0.5 + confidence / 2.0) ** 2 / 2.0
    best = int(np.argmax(profile))
    fall = np.log(np.maximum(profile, 1e-300)) + drop
    below, above = np.flatnonzero(fall[:best] < 0.0), np.flatnonzero(fall[best:] < 0.0)
    low, high = float(axis[0]), float(axis[-1])
    if below.size:
        i = int(below[-1])
        low = float(np.interp(0.0, fall[i : i + 2], axis[i : i + 2]))
    if above.size:
        i = best + int(above[0])
        high = float(np.interp(0.0, fall[i - 1 : i + 1][::-1], axis[i - 1 : i + 1][::-1]))
    return float(axis[best]), low, high


def _summary(
    grid: _Grid,
    table: FloatArray,
    trials: int,
    confidence: float,
    ends: FloatArray,
) -> PsychometricFit:
    axis, posterior = grid.axis, table + _log_prior(grid)
    mass = _marginal(posterior, 0)
    low, high = _central(axis, mass, confidence)
    best, ml_low, ml_high = _likelihood_interval(axis, _profile(table), confidence)
    slope_mass, log_slope = _marginal(posterior, 1), np.log10(grid.slopes)
    slope_low, slope_high = _central(log_slope, slope_mass, confidence)
    near = 0.02 * (ends[1] - ends[0])
    found = (low, high, ml_low, ml_high)
    return PsychometricFit(
        Estimate(*(10.0**each for each in (float(mass @ axis), low, high))),
        Estimate(*(10.0**each for each in (best, ml_low, ml_high))),
        Estimate(*(10.0**e for e in (float(slope_mass @ log_slope), slope_low, slope_high))),
        float(_marginal(posterior, 2) @ grid.guesses),
        float(_marginal(posterior, 3) @ grid.lapses),
        trials,
        bool(min(found) <= ends[0] + near or max(found) >= ends[1] - near),
    )

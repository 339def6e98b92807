"""Whether effects differ from zero over units, and how much people differ by chance.

How much people differ in what might be a cause: by chance, beside what all have in common.

One finger's cutoff rises faster with speed than another's. That is no error of the model, but
what else looks a little like it must be tested as if it could be that.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Final

import numpy as np
from numpy.typing import NDArray

from frictus_hardware.arrays import FloatArray
from frictus_service.discovery.evidence.observation_table import LEAST_UNITS

ROUNDS: Final = 40
"""Of expectation and maximisation; where there is no difference it keeps falling."""


DETERMINED: Final = 1e-3
"""Eigenvalue, of the largest, from which a mean is fitted: of effects no two alike."""


@dataclass(frozen=True, slots=True)
class RandomEffects:
    """Random effects of signatures over units.

    Attributes
    ----------
    difference : ndarray, shape (k,)
        Standard deviation between units of each signature's coefficient; 0 for a signature
        that no unit has.
    coefficients : ndarray, shape (n_units, k)
        Most likely ones of each unit, given that they scatter so.
    """

    difference: FloatArray
    coefficients: FloatArray


def estimate_random_effects(
    readings: Sequence[FloatArray], signatures: Sequence[FloatArray]
) -> RandomEffects:
    """Return how units differ in the coefficients of signatures.

    Maximum likelihood by expectation and maximisation (Laird & Ware 1982): coefficients of a
    unit are normal around means that are the same for all, independent of each other.

    Parameters
    ----------
    readings : sequence of ndarray, shape (n,)
        Of each unit; whitened, and what is its own projected out.
    signatures : sequence of ndarray, shape (n, k)
        Likewise.
    """
    grams = np.array([each.T @ each for each in signatures])
    along = np.array([each.T @ rest for each, rest in zip(signatures, readings, strict=True)])
    size = np.sqrt(np.einsum("ujj->j", grams) / len(grams))
    shown = size > 0.0
    difference, coefficients = np.zeros(size.size), np.zeros(along.shape)
    if shown.any():
        scale = size[shown]
        grams = grams[:, shown][:, :, shown] / np.multiply.outer(scale, scale)
        variance, values = _maximised(grams, along[:, shown] / scale)
        difference[shown] = np.sqrt(variance) / scale
        coefficients[:, shown] = values / scale
    return RandomEffects(difference, coefficients)


def _maximised(grams: FloatArray, along: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return variances, (k,), and coefficients, (n_units, k).

    Parameters
    ----------
    grams : ndarray, shape (n_units, k, k)
    along : ndarray, shape (n_units, k)
    """
    eye = np.eye(along.shape[1])
    variance = np.ones(along.shape[1])
    own = np.zeros(along.shape)
    mean = np.zeros(along.shape[1])
    for _ in range(ROUNDS):
        root = np.sqrt(variance)
        # (1 + D G D)^-1, well-conditioned also where a variance vanishes.
        inner = np.linalg.inv(eye + root[:, np.newaxis] * grams * root)
        posterior = root[:, np.newaxis] * inner * root
        weighted = grams - grams @ posterior @ grams
        rest = along - np.einsum("ujk,uk->uj", grams @ posterior, along)
        mean = _solved(weighted.sum(axis=0), rest.sum(axis=0))
        own = np.einsum("ujk,uk->uj", posterior, along - grams @ mean)
        variance = np.mean(own**2 + np.einsum("ujj->uj", posterior), axis=0)
    return variance, mean + own


def _solved(gram: FloatArray, along: FloatArray) -> FloatArray:
    """Return the solution of normal equations; where they say next to nothing, the smallest."""
    size = np.sqrt(np.diagonal(gram))
    scaled = gram / np.multiply.outer(size, size)
    found: FloatArray = np.linalg.lstsq(scaled, along / size, rcond=DETERMINED)[0] / size
    return found


PRIOR_DEGREES: Final = 4.0
"""How much the variance that the noise alone would give counts, in degrees of freedom. A few
units agree by chance now and then; their t would be the largest of all."""

MOST_FOR_ALL_FLIPS: Final = 11
RANDOM_FLIPS: Final = 5_000


@dataclass(frozen=True, slots=True)
class Significance:
    """Of every effect; arrays of shape (n_effects,).

    Attributes
    ----------
    t : ndarray
        Moderated; NaN where fewer than `LEAST_UNITS` units say something.
    p : ndarray
        Corrected for all that were tested together: share of flips whose largest |t| is as
        large. NaN where t is.
    level : float
        The smallest p that so many units can reach, of an effect of either sign.
    """

    t: FloatArray
    p: FloatArray
    level: float


def signs(n_units: int, rng: np.random.Generator) -> FloatArray:
    """Return sign flips, the identity first; all of them up to 11 units, else random ones.

    Parameters
    ----------
    n_units : int
        Participants, or blocks of their trials.
    rng : numpy.random.Generator

    Returns
    -------
    ndarray, shape (n_flips, n_units)
    """
    if n_units <= MOST_FOR_ALL_FLIPS:
        return np.array(list(product((1.0, -1.0), repeat=n_units)))
    flips = rng.choice((-1.0, 1.0), size=(RANDOM_FLIPS, n_units))
    flips[0] = 1.0
    return flips


def largest_of_flips(
    estimates: FloatArray,
    information: FloatArray,
    flips: FloatArray,
    accuracy: FloatArray | float = 0.0,
    positive: NDArray[np.bool_] | None = None,
) -> Significance:
    """Test every effect; exact under the null that each unit's effects could have either sign.

    A mean within the accuracy of the measurement counts as none, and one beyond it for what it
    is beyond.

    Parameters
    ----------
    estimates : ndarray, shape (n_units, n_effects)
        NaN where a unit says nothing.
    information : ndarray, shape (n_units, n_effects)
        Inverse variance that the noise alone gives each.
    flips : ndarray, shape (n_flips, n_units)
        From `signs`.
    accuracy : ndarray, shape (n_effects,), or float
        Of every effect's mean, systematic errors included.
    positive : ndarray of bool, shape (n_effects,), or None
        Those that are tested for being above zero, not for being other than zero.
    """
    known = np.isfinite(estimates)
    count = known.sum(axis=0)
    mean = np.where(known, estimates, 0.0).sum(axis=0) / np.maximum(count, 1)
    estimates = estimates - np.clip(mean, -accuracy, accuracy)
    t = np.full(estimates.shape[1], np.nan)
    p = np.full(estimates.shape[1], np.nan)
    tested = count >= LEAST_UNITS
    if tested.any():
        values = np.where(known, estimates, 0.0)[:, tested]
        expected = _expected(information[:, tested], known[:, tested])
        flipped = _moderated(values, count[tested], expected, flips)
        # A mean within the accuracy is none, rounding or not.
        t[tested] = np.where(np.abs(flipped[0]) < 1e-9, 0.0, flipped[0])
        upward = np.zeros(tested.size, dtype=np.bool_) if positive is None else positive
        flipped = np.where(upward[tested], flipped, np.abs(flipped))
        largest = flipped.max(axis=1)
        seen = flipped[0] - 1e-9 * np.abs(flipped[0])  # ties are ties, rounding or not
        p[tested] = np.mean(largest[:, np.newaxis] >= seen, axis=0)
    return Significance(t, p, 2.0 / flips.shape[0])


def standard_error(estimates: FloatArray, information: FloatArray) -> FloatArray:
    """Return the moderated standard error of each effect's mean, (n_effects,); NaN untested."""
    known = np.isfinite(estimates)
    count = known.sum(axis=0)
    error = np.full(estimates.shape[1], np.nan)
    tested = count >= LEAST_UNITS
    values = np.where(known, estimates, 0.0)[:, tested]
    expected = _expected(information[:, tested], known[:, tested])
    mean = values.sum(axis=0) / count[tested]
    scatter = np.sum(values**2, axis=0) - count[tested] * mean**2
    variance = (PRIOR_DEGREES * expected + np.maximum(scatter, 0.0)) / (
        PRIOR_DEGREES + count[tested] - 1
    )
    error[tested] = np.sqrt(variance / count[tested])
    return error


def critical_t(
    estimates: FloatArray, information: FloatArray, flips: FloatArray, level: float
) -> float:
    """Return the |t| that the largest of all effects exceeds by chance at a level.

    Means are taken out first: it is what there would be without effects. Infinite where no
    effect is tested.

    Parameters
    ----------
    estimates, information : ndarray, shape (n_units, n_effects)
    flips : ndarray, shape (n_flips, n_units)
    level : float
        Family-wise.
    """
    known = np.isfinite(estimates)
    tested = known.sum(axis=0) >= LEAST_UNITS
    if not tested.any():
        return np.inf
    values = np.where(known, estimates, 0.0)[:, tested]
    count = known[:, tested].sum(axis=0)
    centred = np.where(known[:, tested], values - values.sum(axis=0) / count, 0.0)
    expected = _expected(information[:, tested], known[:, tested])
    flipped = np.abs(_moderated(centred, count, expected, flips))
    return float(np.quantile(flipped.max(axis=1), 1.0 - level))


def _expected(information: FloatArray, known: NDArray[np.bool_]) -> FloatArray:
    """Return the variance of an estimate that the noise alone gives, mean over units."""
    with np.errstate(divide="ignore"):
        variance = np.where(known, 1.0 / information, 0.0)
    expected: FloatArray = variance.sum(axis=0) / known.sum(axis=0)
    return expected


def _moderated(
    values: FloatArray, count: NDArray[np.int64], expected: FloatArray, flips: FloatArray
) -> FloatArray:
    """Return t of each flip and effect, (n_flips, n_effects)."""
    square = np.sum(values**2, axis=0)  # does not change with signs
    mean = (flips @ values) / count
    scatter = np.maximum(square - count * mean**2, 0.0)
    variance = (PRIOR_DEGREES * expected + scatter) / (PRIOR_DEGREES + count - 1)
    found: FloatArray = mean / np.sqrt(variance / count)
    return found

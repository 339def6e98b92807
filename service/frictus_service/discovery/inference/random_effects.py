"""How much people differ in what might be a cause: by chance, beside what all have in common.

One finger's cutoff rises faster with speed than another's. That is no error of the model, but
what else looks a little like it must be tested as if it could be that.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from frictus_hardware.arrays import FloatArray

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

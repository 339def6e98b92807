"""How readings scatter: by themselves, and together where a condition or a person deviates.

Between the conditions of one participant gain and cutoff deviate from any law by some per cent.
That is no noise of a reading: all tones of the condition share it. Tones within a condition
tell delays from cutoffs a hundred times better than conditions tell laws.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Final

import numpy as np

from frictus_hardware.arrays import FloatArray, IntArray
from frictus_service.discovery.evidence.residuals import Layout, by_kind, huber, scatters
from frictus_service.discovery.inference.significance import (
    RandomEffects,
    estimate_random_effects,
)
from frictus_service.discovery.problem.problem import UnwhitenedUnit
from frictus_service.discovery.projection import (
    ROUNDING,
    hardly_left,
    inverse_of,
    left_singular,
    orthogonal_to,
    orthonormal,
)

ROUNDS: Final = 3
"""Scatter and fit follow from each other."""
LEAST_SEEN: Final = 1e-6
"""Square of a deviation's signature beside what is a unit's own, below which there is none."""
LEAST_FREE: Final = 0.1
"""Share of a reading that a fit leaves free, from which its scatter can still be told."""
LEAST_SHARING: Final = 3
"""Units that have a condition, from which it is known what is common to them."""
DEVIATIONS: Final = (0.0, 0.01, 0.02, 0.035, 0.05, 0.07, 0.1, 0.15, 0.2, 0.3)
"""Standard deviations of ln gain or ln cutoff between conditions that are tried."""


@dataclass(frozen=True, slots=True)
class Whitening:
    """From readings to what has unit variance and no correlation.

    Attributes
    ----------
    weight : ndarray, shape (n,)
        One over the scatter, outliers less.
    basis : ndarray, shape (n, k)
        Orthonormal, in weighted readings: along these they scatter more.
    shrink : ndarray, shape (k,)
        By which they are divided there.
    deviation : ndarray, shape (n_kinds,)
        Of the conditions, from which both follow.
    difference : ndarray, shape (n_random,)
        Of the random effects between units, from which both follow, too.
    random_coefficients : ndarray, shape (n_random,)
        Predicted coefficients of the random effects of this unit.
    """

    weight: FloatArray
    basis: FloatArray
    shrink: FloatArray
    deviation: FloatArray
    difference: FloatArray
    random_coefficients: FloatArray

    @classmethod
    def of(
        cls,
        raw: UnwhitenedUnit,
        weight: FloatArray,
        deviation: FloatArray,
        difference: FloatArray | None = None,
    ) -> "Whitening":
        """Return the whitening of a unit of which it is known how readings scatter.

        Parameters
        ----------
        raw : UnwhitenedUnit
            Readings, nuisance and effect signatures.
        weight : ndarray, shape (n,)
        deviation : ndarray, shape (n_kinds,)
        difference : ndarray, shape (n_random,), or None
            Standard deviation of each random effect between units.
        """
        alike = np.zeros(raw.random_effects.shape[1])
        difference = alike if difference is None else difference
        deviating = raw.deviating * np.resize(deviation, raw.deviating.shape[1])
        columns = np.hstack([deviating, raw.random_effects * difference])
        left, values = left_singular(_times(columns, weight))
        kept = values > 1e-6
        shrink = np.sqrt(1.0 + np.square(values[kept]))
        return cls(weight, left[:, kept], shrink, deviation, difference, alike)

    @property
    def log_determinant(self) -> float:
        """Of the map: the larger, the less do readings scatter."""
        return float(np.log(self.weight).sum() - np.log(self.shrink).sum())

    def __call__(self, columns: FloatArray) -> FloatArray:
        """Return columns, shape (n,) or (n, m), whitened."""
        weighted = (columns.T * self.weight).T
        along = self.basis.T @ weighted
        return weighted + self.basis @ (((1.0 / self.shrink - 1.0) * along.T).T)


Whiten = Callable[[Sequence[Layout], Sequence[UnwhitenedUnit]], list[Whitening]]
"""From layouts and units to the whitening of each unit, as `whiten`."""


def whiten(
    layouts: Sequence[Layout],
    raws: Sequence[UnwhitenedUnit],
    noise: Sequence[FloatArray] | None = None,
) -> list[Whitening]:
    """Return the whitening of each unit; scatters and deviations are those of all.

    Parameters
    ----------
    layouts : sequence of Layout
        Of each unit.
    raws : sequence of UnwhitenedUnit
        Of each unit.
    noise : sequence of ndarray, shape (n,), or None
        Standard deviations of the readings, of which those of one kind are off by one factor.
        None: readings of one tone and kind scatter alike.
    """
    weights = _weights(layouts, raws, noise)
    rests = []
    for raw, weight in zip(raws, weights, strict=True):
        fitted = np.hstack([raw.own, raw.chosen, raw.random_effects])
        basis = orthonormal(_times(fitted, weight))
        along = np.hstack(
            [(raw.readings * weight)[:, np.newaxis], _times(raw.deviating, weight)]
        )
        rests.append(orthogonal_to(basis, along))
    deviation = _deviations(rests, [raw.condition for raw in raws], raws[0].n_kinds)
    plain = [
        Whitening.of(raw, weight, deviation) for raw, weight in zip(raws, weights, strict=True)
    ]
    found = _random_effects(raws, plain)
    return [
        replace(
            Whitening.of(raw, weight, deviation, found.difference),
            random_coefficients=random_coefficients,
        )
        for raw, weight, random_coefficients in zip(
            raws, weights, found.coefficients, strict=True
        )
    ]


def _random_effects(
    raws: Sequence[UnwhitenedUnit], whitenings: Sequence[Whitening]
) -> RandomEffects:
    """Return the random effects, beside what all units have in common."""
    readings, signatures = [], []
    for raw, whitening in zip(raws, whitenings, strict=True):
        basis = orthonormal(whitening(np.hstack([raw.own, raw.chosen[:, raw.common]])))
        rest, whole = whitening(raw.readings), whitening(raw.random_effects)
        left = orthogonal_to(basis, whole)
        left[:, hardly_left(left, whole)] = 0.0
        readings.append(orthogonal_to(basis, rest))
        signatures.append(left)
    return estimate_random_effects(readings, signatures)


def _times(columns: FloatArray, weight: FloatArray) -> FloatArray:
    return columns * weight[:, np.newaxis]


def _weights(
    layouts: Sequence[Layout],
    raws: Sequence[UnwhitenedUnit],
    noise: Sequence[FloatArray] | None,
) -> list[FloatArray]:
    """Return what each reading is multiplied with."""
    if noise is None:
        noise = [np.ones(raw.readings.size) for raw in raws]
    else:
        layouts = [by_kind(layout) for layout in layouts]
    rests = [raw.readings - np.median(raw.readings) for raw in raws]
    for _ in range(ROUNDS):
        relative = [rest / sd for rest, sd in zip(rests, noise, strict=True)]
        found = [
            np.hypot(scatter * sd, raw.accuracy / 2.0)
            for scatter, sd, raw in zip(scatters(layouts, relative), noise, raws, strict=True)
        ]
        weights = [huber(rest, sd) / sd for rest, sd in zip(rests, found, strict=True)]
        rests = [_rest(raw, weight) for raw, weight in zip(raws, weights, strict=True)]
    return weights


def _rest(raw: UnwhitenedUnit, weight: FloatArray) -> FloatArray:
    """Return what a fit with own deviations of every condition leaves, scaled to scatter."""
    basis = orthonormal(_times(np.hstack([raw.own, raw.chosen, raw.deviating]), weight))
    free = 1.0 - np.einsum("ij,ij->i", basis, basis)
    left = orthogonal_to(basis, raw.readings * weight)
    rest: FloatArray = left / weight / np.sqrt(np.maximum(free, LEAST_FREE))
    return rest


def _deviations(
    rests: Sequence[FloatArray], conditions: Sequence[IntArray], n_kinds: int
) -> FloatArray:
    """Return the deviations of each kind under which the readings are most likely.

    Parameters
    ----------
    rests : sequence of ndarray, shape (n, 1 + n_deviating)
        Readings and signatures of deviations, weighted, fit projected out.
    conditions : sequence of ndarray of int, shape (n_conditions,)
        Number of each condition of each unit; -1: it is no other unit's.
    n_kinds : int
        How many kinds deviate per condition.
    """
    products = [(rest[:, 1:].T @ rest[:, 1:], rest[:, 1:].T @ rest[:, 0]) for rest in rests]
    if max(float(np.max(np.diagonal(gram), initial=0.0)) for gram, _ in products) < LEAST_SEEN:
        return np.zeros(n_kinds)  # a unit of one condition has its deviation as its own
    products = _beside_common(products, conditions, n_kinds)
    tried = [np.array(each) for each in product(DEVIATIONS, repeat=min(n_kinds, 2))]
    if n_kinds > 2:  # all but the first alike: the skin's three
        tried = [np.append(each[:1], np.full(n_kinds - 1, each[1])) for each in tried]
    return max(tried, key=lambda each: _likelihood(products, each))


def _beside_common(
    products: Sequence[tuple[FloatArray, FloatArray]],
    conditions: Sequence[IntArray],
    n_kinds: int,
) -> list[tuple[FloatArray, FloatArray]]:
    """Return the products without what a condition has in common in all units.

    That is a misfit and no scatter. Taken for scatter, a step of a quarter between two speeds,
    the same in all people, made every condition so uncertain that it was not seen.

    Parameters
    ----------
    products : sequence of (ndarray, ndarray)
        Of each unit: inner products of the signatures of deviations, and with the readings.
    conditions, n_kinds
        As for `_deviations`.
    """
    numbers, counts = np.unique(np.concatenate(conditions), return_counts=True)
    shared = numbers[(numbers >= 0) & (counts >= LEAST_SHARING)]
    if not shared.size:
        return list(products)
    size = shared.size * n_kinds
    gram, along = np.zeros((size, size)), np.zeros(size)
    places = []
    for (own_gram, own_along), condition in zip(products, conditions, strict=True):
        mine = np.flatnonzero(np.isin(condition, shared))
        theirs = np.searchsorted(shared, condition[mine])
        kinds = np.arange(n_kinds)
        columns = (mine[:, np.newaxis] * n_kinds + kinds).ravel()
        there = (theirs[:, np.newaxis] * n_kinds + kinds).ravel()
        gram[np.ix_(there, there)] += own_gram[np.ix_(columns, columns)]
        along[there] += own_along[columns]
        places.append((columns, there))
    common = inverse_of(gram, ROUNDING) @ along
    lost = np.sqrt(len(products) / (len(products) - 1.0))  # the mean is theirs
    return [
        (own_gram, lost * (own_along - own_gram[:, columns] @ common[there]))
        for (own_gram, own_along), (columns, there) in zip(products, places, strict=True)
    ]


def _likelihood(
    products: Sequence[tuple[FloatArray, FloatArray]], deviation: FloatArray
) -> float:
    """Return the log-likelihood of deviations, but for a constant."""
    total = 0.0
    for gram, along in products:
        size = np.resize(deviation, along.size)
        inner = np.eye(along.size) + size[:, np.newaxis] * gram * size
        total -= 0.5 * float(np.linalg.slogdet(inner)[1])
        total += 0.5 * float((size * along) @ np.linalg.solve(inner, size * along))
    return total

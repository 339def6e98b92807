"""The linear problem behind a discovery: readings of each unit, and what could explain them.

A unit is a participant, or a block of a participant's trials where there are too few people.
Everything is whitened: one reading is one standard deviation of its noise.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from frictus_service.discovery.significance import (
    Significance,
    critical_t,
    largest_of_flips,
    standard_error,
)

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

LEAST_SHARE: Final = 1e-3
"""What own parameters and causes already named leave of a signature, as a share of its square,
below which a unit says nothing about it."""


@dataclass(frozen=True, slots=True)
class Unit:
    """Readings of one unit.

    Attributes
    ----------
    readings : ndarray, shape (n,)
        Measured less simulated.
    own : ndarray, shape (n, n_own)
        Signatures of what everybody has of their own: gain, cutoff.
    effects : ndarray, shape (n, n_effects)
        Signatures of what is looked for: the causes of the catalogue.
    generic : ndarray, shape (n, n_patterns)
        Patterns without a cause.
    accuracy, generic_accuracy : ndarray, shape (n_effects,), (n_patterns,)
        Coefficient at which each shows as much as measuring is accurate.
    positive : ndarray of bool, shape (n_effects,)
        Those whose coefficient cannot be negative.
    """

    readings: FloatArray
    own: FloatArray
    effects: FloatArray
    generic: FloatArray
    accuracy: FloatArray
    generic_accuracy: FloatArray
    positive: BoolArray

    def only(self, effects: Sequence[int]) -> "Unit":
        """Return the unit with some of its effects."""
        kept = list(effects)
        return replace(
            self,
            effects=self.effects[:, kept],
            accuracy=self.accuracy[kept],
            positive=self.positive[kept],
        )

    def beyond(self, chosen: Sequence[int]) -> "Unit":
        """Return the unit with chosen effects as its own, in which patterns are looked for."""
        own = np.column_stack([self.own, self.effects[:, list(chosen)]])
        return Unit(
            self.readings,
            own,
            effects=self.generic,
            generic=self.generic[:, :0],
            accuracy=self.generic_accuracy,
            generic_accuracy=self.generic_accuracy[:0],
            positive=np.zeros(self.generic.shape[1], dtype=np.bool_),
        )


@dataclass(frozen=True, slots=True)
class Left:
    """What is left of all units once some signatures have been projected out.

    Attributes
    ----------
    along : ndarray, shape (n_units, n_effects)
        Readings along what is left of each signature.
    information : ndarray, shape (n_units, n_effects)
        Square of what is left of each signature: inverse variance of its coefficient; 0 where
        the unit says nothing.
    accuracy : ndarray, shape (n_effects,)
        Mean over units.
    positive : ndarray of bool, shape (n_effects,)
    """

    along: FloatArray
    information: FloatArray
    accuracy: FloatArray
    positive: BoolArray

    def significance(self, flips: FloatArray) -> Significance:
        """Return whether each effect differs from zero over units, see `largest_of_flips`."""
        return largest_of_flips(
            self.estimates, self.information, flips, self.accuracy, self.positive
        )

    def critical(self, flips: FloatArray, level: float) -> float:
        """Return the |t| that the largest of all effects exceeds by chance at a level."""
        return critical_t(self.estimates, self.information, flips, level)

    def detectable(self, critical: float, power: float) -> FloatArray:
        """Return how large each effect must be to exceed a |t|, power in standard errors more.

        Parameters
        ----------
        critical : float
        power : float
        """
        error = standard_error(self.estimates, self.information)
        size: FloatArray = self.accuracy + (critical + power) * error
        return size

    @property
    def estimates(self) -> FloatArray:
        """Coefficient of each signature by itself, (n_units, n_effects); NaN where unknown."""
        with np.errstate(divide="ignore", invalid="ignore"):
            found: FloatArray = np.where(
                self.information > 0.0, self.along / self.information, np.nan
            )
        return found


def leave(units: Sequence[Unit], chosen: Sequence[int] = ()) -> Left:
    """Project own parameters and chosen effects out of readings and signatures.

    Parameters
    ----------
    units : sequence of Unit
    chosen : sequence of int
        Columns of `Unit.effects`.
    """
    parts = [_leave(unit, list(chosen)) for unit in units]
    along, information = (np.stack(part) for part in zip(*parts, strict=True))
    accuracy = np.mean([unit.accuracy for unit in units], axis=0)
    return Left(along, information, accuracy, units[0].positive)


def _leave(unit: Unit, chosen: list[int]) -> tuple[FloatArray, FloatArray]:
    effects, readings = _projected(unit, chosen)
    return effects.T @ readings, np.einsum("ij,ij->j", effects, effects)


def _projected(unit: Unit, chosen: list[int]) -> tuple[FloatArray, FloatArray]:
    """Return what is left of signatures, 0 where it is next to nothing, and of readings."""
    basis = orthonormal(np.column_stack([unit.own, unit.effects[:, chosen]]))
    effects = unit.effects - basis @ (basis.T @ unit.effects)
    readings = unit.readings - basis @ (basis.T @ unit.readings)
    whole = np.einsum("ij,ij->j", unit.effects, unit.effects)
    silent = np.einsum("ij,ij->j", effects, effects) <= LEAST_SHARE * whole
    silent[chosen] = True
    effects[:, silent] = 0.0
    return effects, readings


def orthonormal(columns: FloatArray) -> FloatArray:
    """Return an orthonormal basis of what columns span; dependent ones add nothing.

    Parameters
    ----------
    columns : ndarray, shape (n, k)
    """
    size = np.sqrt(np.einsum("ij,ij->j", columns, columns))
    scaled = columns[:, size > 0.0] / size[size > 0.0]
    if not scaled.shape[1]:
        return np.zeros((columns.shape[0], 0))
    left, values, _ = np.linalg.svd(scaled, full_matrices=False)
    basis: FloatArray = left[:, values > 1e-9 * values[0]]
    return basis


def joint(units: Sequence[Unit], chosen: Sequence[int]) -> FloatArray:
    """Return coefficients of several effects fitted together, (n_units, n_chosen).

    Parameters
    ----------
    units : sequence of Unit
    chosen : sequence of int
        NaN where a unit does not determine one.
    """
    columns = []
    for position, effect in enumerate(chosen):
        others = [other for k, other in enumerate(chosen) if k != position]
        columns.append(leave(units, others).estimates[:, effect])
    return np.column_stack(columns) if columns else np.zeros((len(units), 0))


def held_out_gain(left: Left) -> FloatArray:
    """Return by how much each effect makes each unit more likely.

    Log-likelihood, in nats, of readings whose noise has variance one; the effect's size is the
    other units' mean, weighted by their information.

    Parameters
    ----------
    left : Left

    Returns
    -------
    ndarray, shape (n_units, n_effects)
        0 where the unit, or all others, say nothing.
    """
    along = left.along.sum(axis=0) - left.along
    information = left.information.sum(axis=0) - left.information
    with np.errstate(divide="ignore", invalid="ignore"):
        size = np.where(information > 0.0, along / information, 0.0)
    gain: FloatArray = size * left.along - 0.5 * size**2 * left.information
    return gain


def similarity(units: Sequence[Unit], chosen: Sequence[int] = ()) -> FloatArray:
    """Return the cosine between what is left of any two signatures, over all units.

    Parameters
    ----------
    units : sequence of Unit
    chosen : sequence of int
        Projected out, as in `leave`.

    Returns
    -------
    ndarray, shape (n_effects, n_effects)
        In [-1, 1]; 0 where nothing is left.
    """
    parts = [_projected(unit, list(chosen))[0] for unit in units]
    gram = np.sum([part.T @ part for part in parts], axis=0)
    size = np.sqrt(np.diagonal(gram))
    scale = np.multiply.outer(size, size)
    with np.errstate(divide="ignore", invalid="ignore"):
        cosine: FloatArray = np.where(scale > 0.0, gram / scale, 0.0)
    return np.clip(cosine, -1.0, 1.0)

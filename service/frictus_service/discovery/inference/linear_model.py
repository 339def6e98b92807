"""The linear problem behind a discovery: readings of each unit, and what could explain them.

A unit is a participant, or a block of a participant's trials where there are too few people.
Everything is whitened: one reading is one standard deviation of its noise.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from frictus_hardware.arrays import BoolArray, FloatArray
from frictus_service.discovery.evidence.observation_table import LEAST_UNITS
from frictus_service.discovery.inference.significance import (
    PRIOR_DEGREES,
    Significance,
    critical_t,
    largest_of_flips,
    standard_error,
)
from frictus_service.discovery.projection import (
    LEAST_SHARE,
    hardly_left,
    orthogonal_to,
    orthonormal,
)


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
        Coefficient at which each shows as much as measuring is accurate; NaN where it does not
        show at all.
    positive, squared : ndarray of bool, shape (n_effects,)
        Those whose coefficient cannot be negative; is the square of a parameter.
    """

    readings: FloatArray
    own: FloatArray
    effects: FloatArray
    generic: FloatArray
    accuracy: FloatArray
    generic_accuracy: FloatArray
    positive: BoolArray
    squared: BoolArray

    def only(self, effects: Sequence[int]) -> "Unit":
        """Return the unit with some of its effects."""
        kept = list(effects)
        return replace(
            self,
            effects=self.effects[:, kept],
            accuracy=self.accuracy[kept],
            positive=self.positive[kept],
            squared=self.squared[kept],
        )

    def and_own(self, columns: FloatArray) -> "Unit":
        """Return the unit with more that is its own."""
        return replace(self, own=np.column_stack([self.own, columns]))

    def beyond(self, chosen: Sequence[int]) -> "Unit":
        """Return the unit with chosen effects as its own, in which patterns are looked for."""
        own = np.column_stack([self.own, self.effects[:, list(chosen)]])
        return replace(self, own=own).looking_for(self.generic, self.generic_accuracy)

    def looking_for(self, columns: FloatArray, accuracy: FloatArray) -> "Unit":
        """Return the unit with other signatures to look for, of either sign.

        Parameters
        ----------
        columns : ndarray, shape (n, m)
        accuracy : ndarray, shape (m,)
        """
        none = np.zeros(accuracy.size, dtype=np.bool_)
        return replace(self, effects=columns, accuracy=accuracy, positive=none, squared=none)


@dataclass(frozen=True, slots=True)
class ProjectedUnits:
    """What is left of all units once some signatures have been projected out.

    Attributes
    ----------
    along : ndarray, shape (n_units, n_effects)
        Readings along what is left of each signature.
    information : ndarray, shape (n_units, n_effects)
        Square of what is left of each signature: inverse variance of its coefficient; 0 where
        the unit says nothing.
    accuracy : ndarray, shape (n_effects,)
        Mean over the units that say something.
    positive, squared : ndarray of bool, shape (n_effects,)
    """

    along: FloatArray
    information: FloatArray
    accuracy: FloatArray
    positive: BoolArray
    squared: BoolArray

    def significance(self, flips: FloatArray) -> Significance:
        """Return whether each effect differs from zero over units, see `largest_of_flips`."""
        return largest_of_flips(*self.tested, flips, self.margin, self.positive)

    def critical(self, flips: FloatArray, level: float) -> float:
        """Return the |t| that the largest of all effects exceeds by chance at a level."""
        return critical_t(*self.tested, flips, level)

    def detectable(self, critical: float, power: float) -> FloatArray:
        """Return how large each effect must be to exceed a |t|, power in standard errors more.

        Parameters
        ----------
        critical : float
            Of |t|, from `critical`.
        power : float
            Quantile of the normal distribution.
        """
        size = self.margin + (critical + power) * standard_error(*self.tested)
        return np.where(self.squared, np.square(size), size)

    @property
    def tested(self) -> tuple[FloatArray, FloatArray]:
        """Return what is tested, and its information: parameters, and not their squares.

        People differ in a parameter; its square is as skewed as it is large.
        """
        value, noise = self.estimates, np.full(self.information.shape, np.nan)
        np.divide(1.0, self.information, out=noise, where=self.information > 0.0)
        root = np.sign(value) * np.sqrt(np.abs(value))
        slope = 2.0 * np.maximum(np.abs(root), noise**0.25)
        value = np.where(self.squared, root, value)
        noise = np.where(self.squared, noise / slope**2, noise)
        return value, np.where(self.information > 0.0, 1.0 / noise, 0.0)

    @property
    def margin(self) -> FloatArray:
        """Within what a mean of what is tested counts as none, (n_effects,)."""
        return np.where(self.squared, np.sqrt(self.accuracy), self.accuracy)

    @property
    def estimates(self) -> FloatArray:
        """Coefficient of each signature by itself, (n_units, n_effects); NaN where unknown."""
        with np.errstate(divide="ignore", invalid="ignore"):
            found: FloatArray = self.along / self.information
        return np.where(self.information > 0.0, found, np.nan)


def project_out(units: Sequence[Unit], chosen: Sequence[int] = ()) -> ProjectedUnits:
    """Project own parameters and chosen effects out of readings and signatures.

    Parameters
    ----------
    units : sequence of Unit
        Whitened readings and signatures of each participant or block.
    chosen : sequence of int
        Columns of `Unit.effects`.
    """
    parts = [_leave(unit, list(chosen)) for unit in units]
    along, information = (np.stack(part) for part in zip(*parts, strict=True))
    hardly = ~telling_of(information)
    along[hardly], information[hardly] = 0.0, 0.0
    told = np.array([unit.accuracy for unit in units])
    accuracy = mean_of_known(np.where(information > 0.0, told, np.nan))
    return ProjectedUnits(along, information, accuracy, units[0].positive, units[0].squared)


def telling_of(information: FloatArray) -> BoolArray:
    """Return which units count, (n_units, n_effects): each of them once.

    One that is vaguer than all others together does not, as who did three of thirty trials:
    their mean would scatter as it does. The six that say most always count.

    Parameters
    ----------
    information : ndarray, shape (n_units, n_effects)
        Inverse variance of the coefficient; 0 where a unit says nothing.
    """
    ordered = -np.sort(-information, axis=0)
    others = np.maximum(np.count_nonzero(information, axis=0) - 1, 0)
    median = np.take_along_axis(ordered, (others // 2)[np.newaxis], axis=0)[0]
    sixth = ordered[min(LEAST_UNITS, len(ordered)) - 1]
    least = np.minimum(median / np.maximum(others, 1), sixth)
    telling: BoolArray = (information > LEAST_SHARE * median) & (information >= least)
    return telling


def _leave(unit: Unit, chosen: list[int]) -> tuple[FloatArray, FloatArray]:
    effects, readings = _projected(unit, chosen)
    return effects.T @ readings, np.einsum("ij,ij->j", effects, effects)


def _projected(unit: Unit, chosen: list[int]) -> tuple[FloatArray, FloatArray]:
    """Return what is left of signatures, 0 where it is next to nothing, and of readings."""
    effects, readings = beside(unit, chosen)
    silent = hardly_left(effects, unit.effects)
    silent[chosen] = True
    effects[:, silent] = 0.0
    return effects, readings


def beside(unit: Unit, chosen: Sequence[int] = ()) -> tuple[FloatArray, FloatArray]:
    """Return signatures and readings, with what is the unit's own projected out.

    Parameters
    ----------
    unit : Unit
        Whitened readings and signatures.
    chosen : sequence of int
        Effects that are projected out, too.

    Returns
    -------
    ndarray, shape (n, n_effects)
    ndarray, shape (n,)
    """
    basis = orthonormal(np.column_stack([unit.own, unit.effects[:, list(chosen)]]))
    return orthogonal_to(basis, unit.effects), orthogonal_to(basis, unit.readings)


def joint(units: Sequence[Unit], chosen: Sequence[int]) -> FloatArray:
    """Return coefficients of several effects fitted together, (n_units, n_chosen).

    Parameters
    ----------
    units : sequence of Unit
        Whitened readings and signatures of each participant or block.
    chosen : sequence of int
        NaN where a unit does not determine one.
    """
    columns = []
    for position, effect in enumerate(chosen):
        others = [other for k, other in enumerate(chosen) if k != position]
        columns.append(project_out(units, others).estimates[:, effect])
    return np.column_stack(columns) if columns else np.zeros((len(units), 0))


def mean_of_known(estimates: FloatArray) -> FloatArray:
    """Return means over units, shape (n_effects,); 0 where no unit knows.

    Parameters
    ----------
    estimates : ndarray, shape (n_units, n_effects)
        NaN where a unit says nothing.
    """
    known = np.isfinite(estimates)
    total = np.where(known, estimates, 0.0).sum(axis=0)
    mean: FloatArray = total / np.maximum(known.sum(axis=0), 1)
    return mean


def held_out_gain(left: ProjectedUnits) -> FloatArray:
    """Return by how much each effect makes each unit more likely.

    Log-likelihood, in nats, of the unit's own coefficient where the others' mean is expected,
    over that where none is. It scatters as the others do, and as noise alone would at least.

    Parameters
    ----------
    left : ProjectedUnits

    Returns
    -------
    ndarray, shape (n_units, n_effects)
        0 where the unit, or all others, say nothing.
    """
    tested, information = left.tested
    known = information > 0.0
    value = np.where(known, np.nan_to_num(tested), 0.0)
    with np.errstate(divide="ignore"):
        noise = np.where(known, 1.0 / information, 0.0)
    # Sums of the others are not those of all less one: beside a large one, nothing is left.
    others = ~np.eye(len(value), dtype=np.bool_)
    count = np.maximum(others @ known.astype(np.float64), 1.0)
    mean = (others @ value) / count
    apart = [np.where(known, value - each, 0.0) for each in mean]
    scatter = np.array(
        [np.square(a[o]).sum(axis=0) for a, o in zip(apart, others, strict=True)]
    )
    expected = (others @ noise) / count
    variance = (PRIOR_DEGREES * expected + scatter) / (PRIOR_DEGREES + count - 1)
    variance = np.maximum(variance * (1.0 + 1.0 / count), np.finfo(float).tiny)
    gain: FloatArray = (value * mean - 0.5 * mean**2) / variance
    return np.where(known & (known.sum(axis=0) > 1), gain, 0.0)


def similarity(units: Sequence[Unit], chosen: Sequence[int] = ()) -> FloatArray:
    """Return the cosine between what is left of any two signatures, over all units.

    Parameters
    ----------
    units : sequence of Unit
        Whitened readings and signatures of each participant or block.
    chosen : sequence of int
        Projected out, as in `project_out`.

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

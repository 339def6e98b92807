"""By how many nats a model predicts units better, each model with the scatter it leaves.

A unit's coefficients are normal about a mean, with a covariance that is estimated from units:
what is predicted of another one is Student's t. The base model expects a mean of zero, and the
scatter about zero; the extended one the others' mean, and the scatter about that. The rest of a
unit's readings is as likely under both, so that the ratio of the two densities is that of its
data (a proper score: Gneiting and Raftery 2007; the density: Gelman et al., Bayesian Data
Analysis, 3rd ed., section 3.6). With the extended model's scatter for both, a base model that
is off by a hundred of its standard errors would be less likely by thousands of nats.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy import special, stats

from frictus_hardware.arrays import BoolArray, FloatArray, IntArray
from frictus_service.discovery.inference.joint_gain import fitted_together
from frictus_service.discovery.inference.linear_model import Unit
from frictus_service.discovery.inference.significance import PRIOR_DEGREES

DRAWS: Final = 4000
"""Of other studies."""
SINGULAR: Final = 1e-6
"""Variance, of that of the units, that no direction of a covariance falls below."""
LEAST_TELLING: Final = 2
"""Units that know of a scatter."""

Interval = tuple[float, float]


@dataclass(frozen=True, slots=True)
class UnitCoefficients:
    """Coefficients of the same effects in several units.

    Attributes
    ----------
    value : ndarray, shape (n_units, k)
        NaN where a unit says nothing.
    noise : ndarray, shape (n_units, k, k)
        Covariances that the readings alone give them.
    """

    value: FloatArray
    noise: FloatArray

    @classmethod
    def of(cls, units: Sequence[Unit], chosen: Sequence[int]) -> "UnitCoefficients":
        """Return the coefficients of some effects, fitted together in each unit.

        Parameters
        ----------
        units : sequence of Unit
            Whitened readings and signatures of each participant or block.
        chosen : sequence of int
            One at least.
        """
        return cls(*fitted_together(units, chosen))

    @property
    def held_out(self) -> FloatArray:
        """Nats by which each unit is likelier, predicted from the others, (n_units,)."""
        every = np.arange(len(self.value))
        return np.array([self._gain(self.value[unit], every != unit) for unit in every])

    def of_fresh(self, fresh: "UnitCoefficients") -> FloatArray:
        """Return the nats by which units of another study are likelier, (n_fresh,)."""
        every = np.ones(len(self.value), dtype=np.bool_)
        return np.array([self._gain(value, every) for value in fresh.value])

    def interval_of_another(self, n_units: int, rng: np.random.Generator) -> Interval | None:
        """Return between what the nats of another study lie in 95 %; None of fewer than two.

        Other studies are drawn from what is known of mean and covariance (normal and inverse
        Wishart), and scored as they would be: densities of a few units are too skewed for an
        interval from the scatter of their logarithms.

        Parameters
        ----------
        n_units : int
            Of the other study, that differ in their noise as these do.
        rng : numpy.random.Generator
            Of the draws.
        """
        known = np.isfinite(self.value)
        kept = np.flatnonzero(known.any(axis=0))
        telling = np.asarray(known[:, kept].all(axis=1))
        if telling.sum() < LEAST_TELLING:
            return None
        nats = _Scatter.of(self, telling, kept).drawn(n_units, rng)
        low, high = np.quantile(nats, (0.025, 0.975)).tolist()
        return low, high

    def _gain(self, value: FloatArray, used: BoolArray) -> float:
        """Return the nats of one unit, predicted from those that are used.

        Where none of them knows all that the unit knows, what fewest know is not predicted: the
        nats are those of the rest. 0 where none of them knows anything of it.
        """
        known = np.isfinite(self.value) & used[:, np.newaxis]
        kept = np.flatnonzero(np.isfinite(value) & known.any(axis=0))
        while kept.size and not known[:, kept].all(axis=1).any():
            kept = np.delete(kept, np.argmin(known[:, kept].sum(axis=0)))
        if not kept.size:
            return 0.0
        telling = np.asarray(known[:, kept].all(axis=1))
        return float(_Scatter.of(self, telling, kept).nats(value[kept]))


@dataclass(frozen=True, slots=True)
class _Scatter:
    """What units say of the coefficients of another one.

    Attributes
    ----------
    scale : ndarray, shape (k,)
        By which coefficients are divided, so that rounding does not know their units.
    mean : ndarray, shape (k,)
    about_mean, about_zero : ndarray, shape (k, k)
        Sums of squares, the noise counted as `PRIOR_DEGREES` units.
    degrees : float
        Of the sum about the mean; one more about zero.
    covariance : ndarray, shape (k, k)
        Of units as they are; what the noise alone gives may be too much.
    relative : ndarray, shape (n,)
        Standard deviation of each unit over that of all, from its own noise.
    """

    scale: FloatArray
    mean: FloatArray
    about_mean: FloatArray
    about_zero: FloatArray
    degrees: float
    covariance: FloatArray
    relative: FloatArray

    @classmethod
    def of(cls, units: UnitCoefficients, telling: BoolArray, kept: IntArray) -> "_Scatter":
        """Return the scatter of some effects over the units that know all of them."""
        value = units.value[telling][:, kept]
        noise = units.noise[telling][:, kept][:, :, kept]
        n = len(value)
        expected, mean = noise.mean(axis=0), value.mean(axis=0)
        apart = (value - mean).T @ (value - mean)
        about_mean = PRIOR_DEGREES * expected + apart
        degrees = PRIOR_DEGREES + n - 1
        scale = np.sqrt(np.diagonal(about_mean))
        squares = np.multiply.outer(scale, scale)
        about_zero = PRIOR_DEGREES * expected + value.T @ value
        own = np.einsum("ujj->uj", noise)
        typical = np.maximum(np.diagonal(expected), np.finfo(float).tiny)
        covariance = apart / max(n - 1, 1)
        of_noise = 1.0 / np.maximum(np.diagonal(covariance) / typical, 1.0)
        relative = 1.0 + np.mean(of_noise * (own / typical - 1.0), axis=1)
        return cls(
            scale,
            mean / scale,
            about_mean / squares,
            about_zero / squares,
            degrees,
            covariance / squares + SINGULAR * np.eye(len(kept)),
            np.sqrt(np.maximum(relative, 0.0)),
        )

    def nats(self, value: FloatArray) -> FloatArray:
        """Return the nats of units, (...), from their coefficients, (..., k)."""
        z, wider = value / self.scale, 1.0 + 1.0 / self.relative.size
        extended = _log_t(z - self.mean, self.about_mean * wider, self.degrees)
        return extended - _log_t(z, self.about_zero, self.degrees + 1.0)

    def drawn(self, n_units: int, rng: np.random.Generator) -> FloatArray:
        """Return the nats of other studies, each of so many units, (DRAWS,)."""
        k, n = self.mean.size, self.relative.size
        freedom = max(n - 1, k)
        covariance = stats.invwishart.rvs(
            freedom, freedom * self.covariance, size=DRAWS, random_state=rng
        )
        root = np.linalg.cholesky(np.reshape(covariance, (DRAWS, k, k)))
        means = self.mean + np.einsum("dij,dj->di", root, rng.standard_normal((DRAWS, k))) / (
            np.sqrt(n)
        )
        apart = np.einsum("dij,duj->dui", root, rng.standard_normal((DRAWS, n_units, k)))
        apart *= rng.choice(self.relative, (DRAWS, n_units, 1))
        total: FloatArray = self.nats((means[:, np.newaxis] + apart) * self.scale).sum(axis=1)
        return total


def _log_t(off: FloatArray, squares: FloatArray, degrees: float) -> FloatArray:
    """Return the log density of Student's t at (..., k), whose scale is the mean of squares."""
    k = off.shape[-1]
    inverse = np.linalg.pinv(squares, rcond=1e-14, hermitian=True)
    distance = np.einsum("...i,ij,...j->...", off, inverse, off)
    constant = special.gammaln((degrees + k) / 2.0) - special.gammaln(degrees / 2.0)
    constant -= 0.5 * (k * np.log(np.pi) + float(np.linalg.slogdet(squares)[1]))
    found: FloatArray = constant - 0.5 * (degrees + k) * np.log1p(distance)
    return found

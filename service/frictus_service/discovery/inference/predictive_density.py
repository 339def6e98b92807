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

import numpy as np
from scipy import special, stats

from frictus_hardware.arrays import BoolArray, FloatArray
from frictus_service.discovery.inference.linear_model import Unit, fitted_together
from frictus_service.discovery.inference.significance import PRIOR_DEGREES


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
        value, noise = zip(
            *(fitted_together(each, list(chosen)) for each in units), strict=True
        )
        return cls(np.stack(value), np.stack(noise))

    @property
    def held_out(self) -> FloatArray:
        """Nats by which each unit is likelier, predicted from the others, (n_units,)."""
        every = np.arange(len(self.value))
        return np.array([self._gain(self.value[unit], every != unit) for unit in every])

    def of_fresh(self, fresh: "UnitCoefficients") -> FloatArray:
        """Return the nats by which units of another study are likelier, (n_fresh,)."""
        every = np.ones(len(self.value), dtype=np.bool_)
        return np.array([self._gain(value, every) for value in fresh.value])

    def _gain(self, value: FloatArray, used: BoolArray) -> float:
        """Return the nats of one unit, predicted from those that are used."""
        known = np.isfinite(self.value[used])
        kept = np.flatnonzero(np.isfinite(value) & known.any(axis=0))
        telling = known[:, kept].all(axis=1)
        n = int(telling.sum())
        if not kept.size or not n:
            return 0.0
        values = self.value[used][telling][:, kept]
        noise = self.noise[used][telling][:, kept][:, :, kept].mean(axis=0)
        mean = values.mean(axis=0)
        about_mean = PRIOR_DEGREES * noise + (values - mean).T @ (values - mean)
        about_zero = PRIOR_DEGREES * noise + values.T @ values
        degrees = PRIOR_DEGREES + n - 1
        extended = _log_t(value[kept] - mean, about_mean * (1.0 + 1.0 / n), degrees)
        return extended - _log_t(value[kept], about_zero, degrees + 1.0)


def _log_t(off: FloatArray, squares: FloatArray, degrees: float) -> float:
    """Return the log density of Student's t, whose scale is the mean of squares."""
    k = off.size
    scale = np.sqrt(np.diagonal(squares))  # so that units of effects do not matter to rounding
    correlation = squares / np.multiply.outer(scale, scale)
    z = off / scale
    distance = float(z @ np.linalg.lstsq(correlation, z, rcond=1e-12)[0])
    log_det = float(np.linalg.slogdet(correlation)[1]) + 2.0 * float(np.log(scale).sum())
    constant = special.gammaln((degrees + k) / 2.0) - special.gammaln(degrees / 2.0)
    found = constant - 0.5 * k * np.log(np.pi) - 0.5 * log_det
    return float(found - 0.5 * (degrees + k) * np.log1p(distance))


def interval_of_another(nats: FloatArray, n_units: int) -> tuple[float, float]:
    """Return where the nats of all units of another study lie, in 95 % of such studies.

    Parameters
    ----------
    nats : ndarray, shape (n,)
        Of held-out units, two at least.
    n_units : int
        Of the other study.
    """
    n = nats.size
    half = float(stats.t.ppf(0.975, n - 1)) * float(nats.std(ddof=1))
    half *= float(np.sqrt(1.0 / n + 1.0 / n_units))
    mean = float(nats.mean())
    return n_units * (mean - half), n_units * (mean + half)

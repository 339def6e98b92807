"""What the cutoff's wandering about the law costs: a mixture over its size.

From one condition or trial to the next the finger is not quite the same; how much so is not
known, and two of them do not tell it. Every size is tried and weighed by how well it explains
what was measured.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy import optimize, stats

from frictus_hardware.arrays import FloatArray
from frictus_service.calibration.errors import EstimateError

SIZES: Final = np.concatenate([[0.0], np.geomspace(0.0005, 0.5, 25)])
"""Standard deviations of ln cutoff about the law."""
EXPECTED: Final = 0.05
"""Half of the people are taken to wander less (half-Cauchy prior)."""
UNDETERMINED: Final = (
    "the trials do not determine gain, cutoff at two speeds and delay: measure at two speeds "
    "and three tones at least, or give a prior"
)
_ENDS: Final = np.array([[1.0, 0.9], [0.9, 1.0]])
"""Correlation of the wandering of the law's two ends. Below 1, so that the slope is taken from
far speeds, and not from small changes of speed within a condition."""


@dataclass(frozen=True, slots=True)
class Mixture:
    """Normal distributions of a person's `coordinates`, one per size of the wandering.

    Attributes
    ----------
    weights : ndarray, shape (n,)
    means : ndarray, shape (n, 4)
    covariances : ndarray, shape (n, 4, 4)
    """

    weights: FloatArray
    means: FloatArray
    covariances: FloatArray

    @property
    def mean(self) -> FloatArray:
        """Mean of the whole, shape (4,)."""
        mean: FloatArray = self.weights @ self.means
        return mean

    @property
    def covariance(self) -> FloatArray:
        """Covariance of the whole, shape (4, 4)."""
        away = self.means - self.mean
        spread = np.einsum("ki,kj->kij", away, away) + self.covariances
        whole: FloatArray = np.einsum("k,kij->ij", self.weights, spread)
        return whole

    @property
    def wandering(self) -> float:
        """Mean size of the wandering."""
        return float(self.weights @ SIZES)

    def half_width(self, contrast: FloatArray) -> float:
        """Return half of the central 95 % interval of a combination of parameters.

        Parameters
        ----------
        contrast : ndarray, shape (4,)
        """
        away = (self.means - self.mean) @ contrast
        scale = np.sqrt(np.einsum("i,kij,j->k", contrast, self.covariances, contrast))

        def outside(half: float) -> float:
            both = stats.norm.sf((half - away) / scale) + stats.norm.sf((half + away) / scale)
            return float(self.weights @ both) - 0.05

        reach = float(np.max(np.abs(away) + 5.0 * scale))
        return float(optimize.brentq(outside, 0.0, reach))


def mixture(
    at: FloatArray,
    score: FloatArray,
    own: FloatArray,
    pull: FloatArray,
    information: FloatArray,
    away: FloatArray,
) -> Mixture:
    """Weigh every size of the wandering by how well it explains the groups of trials.

    Parameters
    ----------
    at : ndarray, shape (4,)
        Where score and information were taken; the law is linear about it.
    score : ndarray, shape (n_groups, 4)
    own : ndarray, shape (n_groups, 4, 4)
        Information of each group of trials that wander together, without wandering.
    pull : ndarray, shape (4,)
        Score of the prior.
    information : ndarray, shape (4, 4)
        Of the prior; zero without one.
    away : ndarray, shape (4, 4)
        How far from the prior's mean a person is taken to be, for the intervals: mean square.
    """
    log_weights, means, covariances = [], [], []
    for size in SIZES:
        evidence, softer, weaker = wandered(score, own, float(size))
        data = weaker.sum(axis=0)
        root = root_of_inverse(data + information)
        covariance = root @ root.T
        total = softer.sum(axis=0) + pull
        means.append(at + covariance @ total)
        covariances.append(covariance @ (data + information @ away @ information) @ covariance)
        explained = 0.5 * total @ covariance @ total + np.linalg.slogdet(root)[1]
        log_weights.append(evidence + explained - np.log1p((size / EXPECTED) ** 2))
    weights = np.exp(np.array(log_weights) - max(log_weights)) * np.gradient(SIZES)
    return Mixture(weights / weights.sum(), np.array(means), np.array(covariances))


def wandered(
    score: FloatArray, own: FloatArray, size: float
) -> tuple[float, FloatArray, FloatArray]:
    """Return the evidence, scores and information of groups whose cutoff wanders by a size.

    Parameters
    ----------
    score : ndarray, shape (n_groups, 4)
    own : ndarray, shape (n_groups, 4, 4)
    size : float
        Standard deviation of ln cutoff between groups.
    """
    spread = size**2 * _ENDS
    growth = np.eye(2) + spread @ own[:, :2, :2]
    share = np.linalg.solve(growth, np.broadcast_to(spread, growth.shape))
    taken = np.einsum("gia,gab->gib", own[:, :, :2], share)
    along = np.einsum("ga,gab,gb->", score[:, :2], share, score[:, :2])
    evidence = 0.5 * float(along - np.sum(np.linalg.slogdet(growth)[1]))
    softer = score - np.einsum("gib,gb->gi", taken, score[:, :2])
    weaker = own - np.einsum("gib,gbj->gij", taken, own[:, :2, :])
    return evidence, softer, weaker


def root_of_inverse(information: FloatArray) -> FloatArray:
    """Return R with ``R R' = information^-1``.

    Raises
    ------
    EstimateError
        If the information leaves a parameter open.
    """
    scale = np.sqrt(np.maximum(np.diag(information), np.finfo(float).tiny))
    values, vectors = np.linalg.eigh(information / np.outer(scale, scale))
    if not values[0] > 1e-9:
        raise EstimateError(UNDETERMINED)
    root: FloatArray = (vectors / np.sqrt(values)) / scale[:, np.newaxis]
    return root

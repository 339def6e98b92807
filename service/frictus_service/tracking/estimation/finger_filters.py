"""What is known of a finger that may wander: Kalman filters, one per size of the wandering.

A person has a law; the gain of each contact lies about it, gain and cutoff of each stroke. How
much so differs from person to person, and is not known beforehand: an estimate that allows for
too much of it is slow and its intervals too wide, one that allows for too little believes in a
finger that was. So a few sizes are filtered side by side, and each counts as well as it has
predicted what was felt next.

Magill 1965, Optimal adaptive estimation of sampled stochastic processes, IEEE Trans. Automatic
Control 10.
"""

from dataclasses import dataclass, replace
from itertools import product
from typing import Final, Self

import numpy as np

from frictus_hardware.arrays import FloatArray
from frictus_service.calibration import coordinates
from frictus_service.calibration.coordinates import Prior
from frictus_service.calibration.posterior import ENDS

WALKS: Final = np.array(
    [[1e-4, 1e-4, 3e-5, 3e-9], [6e-4, 6e-4, 2e-4, 2e-8], [9e-3, 9e-3, 1.5e-2, 3e-7]]
)
"""Standard deviation of the law's random walk in a second, shape (3, 4): it stays, or wanders
within minutes, or 2 % a minute is followed at once."""
CONTACTS: Final = np.array([0.01, 0.10])
"""By which ln gain of a contact lies about the person's; the second as simulated participants'
(`WithinPersonScatter`)."""
STROKES: Final = np.array([[0.001, 0.004], [0.05, 0.05]])
"""By which ln gain and ln cutoff of a stroke lie about those of the contact, shape (2, 2): the
gain may depend on the direction, and the cutoff does as simulated participants' does."""
COMMON: Final = np.array([0.1, 0.9])
"""Share of people with each size of `CONTACTS`, and of `STROKES`, before anything was felt:
most scatter. With equal shares 78 % of 95 % intervals of a person's gain held after one
contact."""
UNSTEADY: Final = 6.0
"""No size of the walk is less probable than the best one by more, in nats, for the same sizes
of the others: a finger that begins to drift is followed as soon as it has shown so much."""
UNUSUAL: Final = 25.0
"""Likewise sizes of contacts and strokes, which are a person's. With 12, strokes that differed
were forgotten after two that happened to be alike: 80 % of 95 % intervals of a cutoff held
after six. With 100, a law to which a finger had jumped was half believed after eight."""
LAW: Final = coordinates.SIZE
STATE: Final = LAW + 4
"""The person's law in `calibration.coordinates`, and how far off it are now: the contact's
gain, the stroke's gain, and the stroke's cutoff at both ends of the speeds."""
COLUMNS: Final = np.array([0, 1, 2, 3, 2, 2, 0, 1])
"""Of the coordinates, along which each part of the state changes the response."""
FELT: Final = np.eye(LAW)[:, COLUMNS]
"""From the state to the law that an update feels, shape (4, 8)."""
NOW: Final = FELT * (np.arange(STATE) <= LAW)
"""From the state to the law of this contact, without what the next stroke will not have."""
PERSON: Final = FELT * (np.arange(STATE) < LAW)
"""From the state to the person's law."""
_WHICH: Final = np.array(list(product(range(3), range(2), range(2))))
"""Of the sizes of walk, contacts and strokes, by filter; the last allows for most."""
_COMMON: Final = np.log(COMMON)[_WHICH[:, 1:]].sum(axis=1)
_WALKED: Final = np.square(WALKS)[_WHICH[:, 0]]
_SCATTER: Final = np.zeros((len(_WHICH), STATE, STATE))
"""Covariance of what contacts and strokes draw anew, by filter."""
_SCATTER[:, LAW, LAW] = np.square(CONTACTS)[_WHICH[:, 1]]
_SCATTER[:, LAW + 1, LAW + 1] = np.square(STROKES[_WHICH[:, 2], 0])
_SCATTER[:, LAW + 2 :, LAW + 2 :] = np.multiply.outer(np.square(STROKES[_WHICH[:, 2], 1]), ENDS)
_NEW_CONTACT: Final = (np.arange(STATE) != LAW).astype(float)
_NEW_STROKE: Final = (np.arange(STATE) <= LAW).astype(float)
"""What is kept of the state when a contact, or a stroke, begins."""


def renewed(
    mean: FloatArray, covariance: FloatArray, kept: FloatArray, drawn: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return mean and covariance of a state that is in part drawn anew.

    Parameters
    ----------
    mean : ndarray, shape (..., n)
    covariance : ndarray, shape (..., n, n)
    kept : ndarray, shape (n,)
        Share of each part's value that is kept: 1 all, 0 none.
    drawn : ndarray, shape (..., n, n)
        Covariance to which what is not kept goes back; that of a stationary process.
    """
    both = np.outer(kept, kept)
    return mean * kept, covariance * both + drawn * (1.0 - both)


@dataclass(frozen=True, slots=True)
class FingerFilters:
    """One filter per combination of sizes of `WALKS`, `CONTACTS` and `STROKES`.

    Attributes
    ----------
    log_evidence : ndarray, shape (n,)
        How well each has predicted; the best is 0.
    means : ndarray, shape (n, 8)
    covariances : ndarray, shape (n, 8, 8)
    """

    log_evidence: FloatArray
    means: FloatArray
    covariances: FloatArray

    @classmethod
    def begin(cls, prior: Prior) -> Self:
        """Return what is known before anything was felt.

        Parameters
        ----------
        prior : Prior
            Of a new person.
        """
        means = np.tile(np.append(prior.mean, np.zeros(STATE - LAW)), (len(_WHICH), 1))
        covariances = _SCATTER.copy()
        covariances[:, :LAW, :LAW] = prior.covariance
        return cls(_COMMON - _COMMON.max(), means, covariances)

    @property
    def weights(self) -> FloatArray:
        """How much each filter counts, shape (n,), of sum 1."""
        weights = np.exp(self.log_evidence)
        share: FloatArray = weights / weights.sum()
        return share

    def of(self, combination: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return mean and covariance of combinations of the state, over all filters.

        Parameters
        ----------
        combination : ndarray, shape (m, 8)
            Such as `FELT` and `NOW`.
        """
        weights = self.weights
        means = self.means @ combination.T
        mean = weights @ means
        away = means - mean
        within = combination @ np.tensordot(weights, self.covariances, 1) @ combination.T
        return mean, within + (weights[:, np.newaxis] * away).T @ away

    def advanced(self, seconds: float, new_contact: bool) -> Self:
        """Return what is still known after some time.

        Parameters
        ----------
        seconds : float
            Since the last update.
        new_contact : bool
            Whether the finger left the screen meanwhile.
        """
        law = np.arange(LAW)
        covariances = self.covariances.copy()
        covariances[:, law, law] += _WALKED * max(seconds, 0.0)
        later = replace(self, covariances=covariances)
        return later._renewed(_NEW_CONTACT) if new_contact else later

    def of_another_stroke(self) -> Self:
        """Return what is known of another stroke."""
        return self._renewed(_NEW_STROKE)

    def _renewed(self, kept: FloatArray) -> Self:
        means, covariances = renewed(self.means, self.covariances, kept, _SCATTER)
        return replace(self, means=means, covariances=covariances)

    def seen(
        self, score: FloatArray, information: FloatArray, at: FloatArray
    ) -> tuple[Self, float, float]:
        """Return what is known after an update, how likely it was, and how strange.

        Parameters
        ----------
        score : ndarray, shape (4,)
            Of the law that was felt.
        information : ndarray, shape (4, 4)
        at : ndarray, shape (4,)
            Where they were taken; the law is linear about it.

        Returns
        -------
        FingerFilters
        float
            Log-likelihood of the update, less that of a law exactly at `at`.
        float
            Squared distance of what is known now from what was known before, in standard
            deviations of the filter that allows for most.
        """
        off = at - self.means @ FELT.T
        pull = (score + off @ information) @ FELT
        seen = FELT.T @ information @ FELT
        growth = np.eye(STATE) + seen @ self.covariances
        gained = np.linalg.solve(growth.swapaxes(1, 2), self.covariances).swapaxes(1, 2)
        covariances = 0.5 * (gained + gained.swapaxes(1, 2))
        step = np.einsum("kij,kj->ki", covariances, pull)
        explained = np.einsum("ki,ki->k", pull, step)
        missed = np.einsum("ki,ij,kj->k", off, information, off) + 2.0 * off @ score
        evidence = 0.5 * (explained - missed - np.linalg.slogdet(growth)[1])
        strange = float(step[-1] @ (pull[-1] - seen @ step[-1]))
        after = self.log_evidence + evidence
        likely = np.logaddexp.reduce(after) - np.logaddexp.reduce(self.log_evidence)
        found = type(self)(_remembered(after), self.means + step, covariances)
        return found, float(likely), strange


def _remembered(log_evidence: FloatArray) -> FloatArray:
    """Return the evidence that counts later, by filter; the best is 0."""
    by_walk = log_evidence.reshape(len(WALKS), -1)
    best = by_walk.max(axis=0)
    by_walk = np.maximum(by_walk - best, -UNSTEADY)
    kept: FloatArray = by_walk + np.maximum(best - best.max(), -UNUSUAL)
    return kept.ravel()

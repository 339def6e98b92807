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

WALKS: Final = np.array([[6e-4, 6e-4, 2e-4, 2e-8], [9e-3, 9e-3, 1.5e-2, 3e-7]])
"""Standard deviation of the law's random walk in a second, shape (2, 4): it stays, or 2 % a
minute is followed at once."""
CONTACTS: Final = np.array([0.01, 0.10])
"""By which ln gain of a contact lies about the person's; the second as simulated participants'
(`WithinPersonScatter`)."""
STROKES: Final = np.array([[0.001, 0.01], [0.05, 0.05]])
"""By which ln gain and ln cutoff of a stroke lie about those of the contact, shape (2, 2): the
gain may depend on the direction, and the cutoff does as simulated participants' does."""
FURTHEST_BEHIND: Final = 12.0
"""No filter's evidence is less than the best one's by more, in nats: so a finger that begins to
change is followed as soon as it has shown so much. With half of it two strokes that happen to
be alike made believe that all are: 70 % of 95 % intervals held after six strokes."""
LAW: Final = coordinates.SIZE
STATE: Final = LAW + 4
"""The person's law in `calibration.coordinates`, and how far off it are now: the contact's
gain, the stroke's gain, and the stroke's cutoff at both ends of the speeds."""
COLUMNS: Final = np.array([0, 1, 2, 3, 2, 2, 0, 1])
"""Of the coordinates, along which each part of the state changes the response."""
_CONTACT: Final = slice(LAW, LAW + 1)
_STROKE: Final = slice(LAW + 1, STATE)
FELT: Final = np.eye(LAW)[:, COLUMNS]
"""From the state to the law that an update feels, shape (4, 8)."""
NOW: Final = FELT * (np.arange(STATE) <= LAW)
"""From the state to the law of this contact, without what the next stroke will not have."""
PERSON: Final = FELT * (np.arange(STATE) < LAW)
"""From the state to the person's law."""
_WHICH: Final = np.array(list(product(range(2), repeat=3)))
"""Of the sizes of walk, contacts and strokes, by filter; the last allows for most."""
_WALKED: Final = np.square(WALKS)[_WHICH[:, 0]]
_OF_CONTACT: Final = np.square(CONTACTS)[_WHICH[:, 1], np.newaxis, np.newaxis]
_OF_STROKE: Final = np.zeros((len(_WHICH), 3, 3))
_OF_STROKE[:, 0, 0] = np.square(STROKES[_WHICH[:, 2], 0])
_OF_STROKE[:, 1:, 1:] = np.multiply.outer(np.square(STROKES[_WHICH[:, 2], 1]), ENDS)


@dataclass(frozen=True, slots=True)
class FingerFilters:
    """One filter per combination of two sizes each of `WALKS`, `CONTACTS` and `STROKES`.

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
        covariances = np.zeros((len(_WHICH), STATE, STATE))
        covariances[:, :LAW, :LAW] = prior.covariance
        covariances[:, _CONTACT, _CONTACT] = _OF_CONTACT
        covariances[:, _STROKE, _STROKE] = _OF_STROKE
        return cls(np.zeros(len(_WHICH)), means, covariances)

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
        return later._renewed(_CONTACT, _OF_CONTACT) if new_contact else later

    def of_another_stroke(self) -> Self:
        """Return what is known of another stroke."""
        return self._renewed(_STROKE, _OF_STROKE)

    def _renewed(self, part: slice, covariance: FloatArray) -> Self:
        """Return what is known with a part of the state drawn anew."""
        means, covariances = self.means.copy(), self.covariances.copy()
        means[:, part] = 0.0
        covariances[:, part], covariances[:, :, part] = 0.0, 0.0
        covariances[:, part, part] = covariance
        return replace(self, means=means, covariances=covariances)

    def seen(
        self, score: FloatArray, information: FloatArray, at: FloatArray
    ) -> tuple[Self, float]:
        """Return what is known after an update, and how strange it was.

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
        log_evidence = self.log_evidence + evidence
        log_evidence = np.maximum(log_evidence - log_evidence.max(), -FURTHEST_BEHIND)
        strange = float(step[-1] @ (pull[-1] - seen @ step[-1]))
        return type(self)(log_evidence, self.means + step, covariances), strange

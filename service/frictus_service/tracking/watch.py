"""Evidence that the model in force is wrong, valid whenever somebody looks at it.

For each cause and each side an e-process: a likelihood ratio, averaged over sizes beyond what
is tolerated, against the model at the edge of what is tolerated. Under a model within the
tolerance its expectation is at most 1 at every time, so that it ever exceeds 1/a has a chance
of at most a (Ville's inequality). A process begins every ten seconds, and they share what one
would have: a change late in a session is found as soon as one at its beginning.

Ramdas, Grünwald, Vovk, Shafer 2023, Game-theoretic statistics and safe anytime-valid inference.
"""

from dataclasses import dataclass
from typing import Final, Literal, Self

import numpy as np
from scipy.special import log_ndtr

from frictus_hardware.arrays import FloatArray
from frictus_service.calibration.coordinates import inverse
from frictus_service.calibration.posterior import EXPECTED, wandered
from frictus_service.calibration.score_information import GainScatter, scores
from frictus_service.tracking.law_estimate import Batch, LawEstimate

Cause = Literal["gain", "cutoff", "delay"]
CAUSES: Final[tuple[Cause, ...]] = ("gain", "cutoff", "delay")
INSTRUMENT: Final = frozenset({"delay"})
"""Causes that are the rig's and never the finger's."""
DIRECTIONS: Final = np.array([[0, 0, 1, 0], [1, 1, 0, 0], [0, 0, 0, 1]], dtype=float)
"""Of each cause in `calibration.coordinates`."""
TOLERATED: Final = np.array([0.15, 0.10, 15e-6])
"""ln gain, ln cutoff, s: smaller errors raise no alarm."""
EXPECTED_SIZE: Final = np.array([0.3, 0.5, 100e-6])
"""Beyond what is tolerated: standard deviation of the sizes that are tried."""
LEVEL: Final = 0.01
"""Chance that a session in which the model is right ever raises an alarm."""
ALARM: Final = float(np.log(2 * len(CAUSES) / LEVEL))
"""Of a cause's log evidence: causes and sides share the level."""
BEGIN_BATCHES: Final = 20
MOST: Final = 64
"""Processes of a cause that are followed; beyond, that with the least evidence ends."""


@dataclass(frozen=True, slots=True)
class Watch:
    """The processes so far; arrays of shape (n_begun, 2, n_causes).

    Attributes
    ----------
    batches : int
        That were taken.
    begun : int
        Processes that have begun, ended ones too.
    log_share : ndarray, shape (n_begun,)
        Of the chance of an alarm, that each process has.
    score, information : ndarray
        At the edge of what is tolerated; the sides are too large and too small.
    """

    batches: int
    begun: int
    log_share: FloatArray
    score: FloatArray
    information: FloatArray

    @classmethod
    def begin(cls) -> Self:
        """Return the watch over a model that was just put in force."""
        nothing = np.zeros((0, 2, len(CAUSES)))
        return cls(0, 0, np.zeros(0), nothing, nothing)

    def seen(self, batch: Batch, at: FloatArray, estimate: LawEstimate) -> Self:
        """Return the watch after one more batch.

        Parameters
        ----------
        batch : Batch
            That the estimate has not seen.
        at : ndarray, shape (4,)
            The model in force, in `calibration.coordinates`.
        estimate : LawEstimate
            Before the batch.
        """
        share, score, information = self.log_share, self.score, self.information
        begun = self.begun
        if self.batches % BEGIN_BATCHES == 0:
            begun += 1
            # The shares 6 / (pi k)^2 of all that will ever begin sum to 1.
            share = np.append(share, np.log(6.0) - 2.0 * np.log(np.pi * begun))
            fresh = np.zeros((1, 2, len(CAUSES)))
            score, information = (
                np.concatenate([each, fresh]) for each in (score, information)
            )
        if share.size > MOST:
            weakest = int(np.argmin(_log_evidence(share, score, information).max(axis=(1, 2))))
            share, score, information = (
                np.delete(each, weakest, axis=0) for each in (share, score, information)
            )
        own, known = _efficient(batch, at, estimate)
        sides = np.stack([own, -own]) - TOLERATED * known
        return type(self)(self.batches + 1, begun, share, score + sides, information + known)

    @property
    def log_evidence(self) -> FloatArray:
        """Of each cause against the model in force, nats, shape (n_causes,).

        At `ALARM` and above the model is wrong by more than what is tolerated.
        """
        if not self.log_share.size:
            return np.zeros(len(CAUSES))
        each = _log_evidence(self.log_share, self.score, self.information)
        total: FloatArray = np.logaddexp.reduce(each, axis=0).max(axis=0)
        return total

    @property
    def alarms(self) -> tuple[Cause, ...]:
        """Causes with an alarm."""
        return tuple(
            cause
            for cause, evidence in zip(CAUSES, self.log_evidence, strict=True)
            if evidence >= ALARM
        )


def _log_evidence(
    log_share: FloatArray, score: FloatArray, information: FloatArray
) -> FloatArray:
    """Return the logarithm of share times the ratio, averaged over half-normal sizes."""
    variance = np.square(EXPECTED_SIZE)
    width = 1.0 + variance * information
    found: FloatArray = (
        log_share[:, np.newaxis, np.newaxis]
        + np.log(2.0)
        - 0.5 * np.log(width)
        + 0.5 * variance * np.square(score) / width
        + log_ndtr(EXPECTED_SIZE * score / np.sqrt(width))
    )
    return found


def _efficient(
    batch: Batch, at: FloatArray, estimate: LawEstimate
) -> tuple[FloatArray, FloatArray]:
    """Return the efficient score and information of each cause: what the others cannot say.

    Taken where the model in force holds for the cause, and the estimate for the others, so that
    a cutoff that is off by far is not seen as a delay.
    """
    data = batch.rows(estimate.noise_n2)
    every = np.ones(data.tone_hz.size)
    found = np.empty((2, len(CAUSES)))
    for number, along in enumerate(DIRECTIONS):
        where = np.where(along > 0.0, at, estimate.mean)
        raw = scores(data, where, GainScatter(0.0, estimate.gain_scatter), every)
        _, score, own = wandered(*raw, EXPECTED)
        pull, known = DIRECTIONS @ score[0], DIRECTIONS @ own[0] @ DIRECTIONS.T
        covariance = inverse(known)
        information = 1.0 / covariance[number, number]
        found[:, number] = information * (covariance[number] @ pull), information
    return found[0], found[1]

"""What each batch of windows says of deviations from a law that nobody can foresee from it.

Score and information of a deviation in the innovations of a Kalman filter over all that may
vary while the model is right: the law where it is free, the gain of a contact, and gain and
cutoff of a stroke. What is constant within a stroke and differs from the last says little of
its own: the filter knows that a further stroke may differ as much. It follows a deviation in
part; what it will have made of it is taken out of its direction (the generalised likelihood
ratio of Willsky and Jones). So, the increments of score and information are those of a
martingale under the model.

Willsky and Jones 1976, A generalized likelihood ratio approach to the detection and estimation
of jumps in linear systems, IEEE Trans. Automatic Control 21.
"""

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final, Self

import numpy as np

from frictus_hardware.arrays import ComplexArray, FloatArray, IntArray
from frictus_service.calibration.posterior import ENDS, wandered
from frictus_service.calibration.score_information import GainScatter, linearised
from frictus_service.tracking.estimation.batch import Batch
from frictus_service.tracking.estimation.finger_filters import (
    CONTACTS,
    LAW,
    STATE,
    STROKES,
    renewed,
)
from frictus_service.tracking.estimation.law_estimate import CUTOFF_PER_WINDOW, LawEstimate

GAIN_LASTS_S: Final = 30.0
"""The gain of a contact wanders about the law within this time: what a contact of minutes says
of it counts as so many short ones."""
GAIN_OF_A_STROKE: Final = 0.02
"""Standard deviation of ln gain between strokes of a contact. The estimate allows for more:
what depends on the direction is to be named, and not to be followed."""
CUTOFF_PER_BATCH: Final = 0.03
"""Of ln cutoff between the batches of one stroke."""
UNITS: Final = np.array([1.0, 1.0, 1.0, 1e-4])
"""Of the coordinates within the filter: all deviations are then about one."""
WIDE: Final = 1.0
"""Standard deviation of a free parameter before anything was felt, in `UNITS`."""
SYSTEMATIC: Final = 0.01
"""Relative error of a band that no average makes smaller: its mean frequency stands for its
lines, and a window is not infinitely long."""
TAIL: Final = 5.0
"""Degrees of freedom of the t distribution whose weights tame outlying windows."""
WANDERING: Final = np.zeros((STATE - LAW, STATE - LAW))
"""Covariance of what is off the law; of the cutoff's ends as `calibration.posterior` has it."""
WANDERING[0, 0] = CONTACTS[-1] ** 2
WANDERING[1, 1] = GAIN_OF_A_STROKE**2
WANDERING[2:, 2:] = STROKES[-1, 1] ** 2 * ENDS


@dataclass(frozen=True, slots=True)
class Nuisance:
    """A Kalman filter over what may vary; `n` is the size of its state, `d` of deviations.

    Attributes
    ----------
    mean : ndarray, shape (n,)
        In `UNITS`.
    covariance : ndarray, shape (n, n)
    absorbed : ndarray, shape (n, d)
        What the filter has made of each deviation.
    """

    mean: FloatArray
    covariance: FloatArray
    absorbed: FloatArray

    @classmethod
    def begin(cls, mean: FloatArray, sd: FloatArray, deviations: int) -> Self:
        """Return the filter before a first batch, at the law.

        Parameters
        ----------
        mean, sd : ndarray, shape (4 + n_effects,)
            Of the law in `UNITS` and of effects where they may vary too; zero for what does
            not vary.
        deviations : int
            How many are tested.
        """
        size = mean.size + STATE - LAW
        fixed = np.r_[:LAW, STATE:size]
        whole, covariance = np.zeros(size), np.zeros((size, size))
        whole[fixed] = mean
        covariance[fixed, fixed] = np.square(sd)
        covariance[LAW:STATE, LAW:STATE] = WANDERING
        return cls(whole, covariance, np.zeros((size, deviations)))

    def advanced(self, seconds: float, new_contact: bool, new_stroke: bool) -> Self:
        """Return the filter some time later: it forgets what was of a contact or a stroke.

        Parameters
        ----------
        seconds : float
            Since the last batch.
        new_contact : bool
            Whether the finger left the screen meanwhile.
        new_stroke : bool
            Whether it turned.
        """
        kept, drawn = np.ones(self.mean.size), np.zeros_like(self.covariance)
        drawn[LAW:STATE, LAW:STATE] = WANDERING
        lasted = float(np.exp(-max(seconds, 0.0) / GAIN_LASTS_S))
        kept[LAW] = 0.0 if new_contact else lasted
        kept[LAW + 1 : STATE] = 0.0 if new_contact or new_stroke else 1.0
        mean, covariance = renewed(self.mean, self.covariance, kept, drawn)
        return replace(
            self, mean=mean, covariance=covariance, absorbed=self.absorbed * kept[:, np.newaxis]
        )

    def seen(
        self, score: FloatArray, information: FloatArray, at: FloatArray
    ) -> tuple[Self, FloatArray, FloatArray]:
        """Return the filter after a batch, and what the batch says of the deviations.

        Parameters
        ----------
        score : ndarray, shape (n + d,)
            Of what varies and then of the deviations.
        information : ndarray, shape (n + d, n + d)
        at : ndarray, shape (n,)
            Where they were taken.

        Returns
        -------
        Nuisance
        score : ndarray, shape (d,)
        information : ndarray, shape (d, d)
        """
        n = self.mean.size
        pull = score - information[:, :n] @ (self.mean - at)
        # A deviation is seen less what the filter has already made of it.
        mixed = information[:n, n:] - information[:n, :n] @ self.absorbed
        left = information[n:, n:] - self.absorbed.T @ information[:n, n:]
        left -= mixed.T @ self.absorbed
        own = pull[n:] - self.absorbed.T @ pull[:n]
        growth = np.eye(n) + information[:n, :n] @ self.covariance
        gained = np.linalg.solve(growth.T, self.covariance).T
        covariance = 0.5 * (gained + gained.T)
        after = replace(
            self,
            mean=self.mean + covariance @ pull[:n],
            covariance=covariance,
            absorbed=self.absorbed + covariance @ mixed,
        )
        return (
            after,
            own - mixed.T @ (covariance @ pull[:n]),
            left - mixed.T @ covariance @ mixed,
        )


def batch_score(
    batch: Batch, estimate: LawEstimate, further: ComplexArray, part: IntArray
) -> tuple[FloatArray, FloatArray, float]:
    """Return score and information of each part of a batch, and the batch's certainty.

    As `calibration.score_information.scores`, with further columns, and with the cutoff's
    wandering from part to part.

    Parameters
    ----------
    batch : Batch
        That the estimate has not seen.
    estimate : LawEstimate
        Before the batch.
    further : ndarray of complex, shape (n_windows, n_bands, n_further)
        d ln H of each.
    part : ndarray of int, shape (n_windows,)
        Number of each window's part, rising from 0.

    Returns
    -------
    score : ndarray, shape (n_parts, 4 + n_further)
        Of the coordinates in `UNITS`, then of the further columns.
    information : ndarray, shape (n_parts, 4 + n_further, 4 + n_further)
    certainty : float
        Sum over real and imaginary parts of the inverse of their relative variances.
    """
    data = batch.rows(estimate.noise_n2, estimate.mean)
    residual, law, certainty = linearised(data, estimate.mean)
    certainty = certainty / (1.0 + certainty * SYSTEMATIC**2)
    table = np.column_stack([law * UNITS, further[batch.heard], residual])
    spread = GainScatter(0.0, estimate.gain_scatter).segment
    first = np.diff(data.segment, prepend=-1) != 0
    starts, place = np.flatnonzero(first), np.cumsum(first) - 1
    certainty = certainty * _tamed(residual, certainty, starts, place)
    total = np.add.reduceat(certainty, starts)
    weighted = certainty[:, np.newaxis] * table.real
    means = np.add.reduceat(weighted, starts, axis=0) / total[:, np.newaxis]
    root = np.sqrt(certainty)[:, np.newaxis]
    imaginary, real = root * table.imag, root * (table.real - means[place])
    means = means / np.sqrt(1.0 / total + spread**2)[:, np.newaxis]
    limits = [*starts.tolist(), certainty.size]
    moments = np.array(
        [
            imaginary[low:high].T @ imaginary[low:high] + real[low:high].T @ real[low:high]
            for low, high in pairwise(limits)
        ]
    )
    moments += means[:, :, np.newaxis] * means[:, np.newaxis, :]
    _, score, information = wandered(
        moments[:, :-1, -1], moments[:, :-1, :-1], CUTOFF_PER_WINDOW
    )
    # Every window has rows, those of its strongest band, so that there are as many as parts.
    begins = np.flatnonzero(np.diff(part, prepend=-1))
    _, score, information = wandered(
        np.add.reduceat(score, begins), np.add.reduceat(information, begins), CUTOFF_PER_BATCH
    )
    return score, information, 2.0 * float(certainty.sum())


def _tamed(
    residual: ComplexArray, certainty: FloatArray, starts: IntArray, place: IntArray
) -> FloatArray:
    """Return weights of rows, at most 1; less for a window that a knock makes scatter.

    Those of a t distribution (`calibration.score_information`), by window.
    """
    total = np.add.reduceat(certainty, starts)
    middle = (np.add.reduceat(certainty * residual.real, starts) / total)[place]
    scatter = np.add.reduceat(certainty * np.square(np.abs(residual - middle)), starts)
    expected = 2.0 * np.bincount(place)
    weight: FloatArray = np.minimum((TAIL + expected) / (TAIL + scatter), 1.0)[place]
    return weight

"""QUEST+: the level whose answer is expected to leave the least uncertainty comes next.

Watson 2017, QUEST+: A general multidimensional Bayesian adaptive psychometric method, Journal
of Vision 17(3):10.
"""

import numpy as np
from numpy.typing import ArrayLike

from frictus.errors import ArgumentError
from frictus.experiment.psychometrics.psychometric import FloatArray, ParameterGrid


class QuestPlus:
    """Bayesian adaptive procedure over a grid of candidate functions.

    The expected entropy after a trial at level x is, with the posterior p over the candidates
    and the likelihood L(r, x) of response r,

        H(x) = sum_r [ q log q - sum L p log(L p) ],   q = sum L p,

    of which everything but two products of a matrix and a vector is computed once.

    Parameters
    ----------
    levels : array_like, shape (n_levels,)
        Levels to choose from, above 0.
    grid : ParameterGrid
        Candidate functions.
    trials : int
        After which the procedure is finished.
    """

    def __init__(self, levels: ArrayLike, grid: ParameterGrid, trials: int) -> None:
        self.levels = np.asarray(levels, float)
        self.grid = grid
        self.posterior = grid.prior
        self._trials = trials
        self._done = 0
        positive = grid.probabilities(self.levels)
        self._likelihood = np.stack([positive, 1.0 - positive])
        logarithm = np.log(np.maximum(self._likelihood, 1e-300))
        self._entropy = self._likelihood * logarithm
        self._allowed = np.ones(self.levels.size, bool)

    @property
    def finished(self) -> bool:
        """Whether all trials are done."""
        return self._done >= self._trials

    def expected_entropy(self) -> FloatArray:
        """Return the entropy expected after a trial at each level, nats, shape (n_levels,)."""
        p = self.posterior
        evidence = self._likelihood @ p
        inside = self._entropy @ p + self._likelihood @ (p * np.log(np.maximum(p, 1e-300)))
        expected = np.sum(evidence * np.log(np.maximum(evidence, 1e-300)) - inside, axis=0)
        return np.asarray(expected, np.float64)

    def next_level(self) -> float:
        """Return the level to present."""
        expected = np.where(self._allowed, self.expected_entropy(), np.inf)
        return float(self.levels[int(np.argmin(expected))])

    def update(self, level: float, positive: bool) -> None:
        """Take in an answer.

        Parameters
        ----------
        level : float
            Level as rendered, above 0; need not be one of `levels`.
        positive : bool
            Correct, or "yes", or "different".
        """
        predicted = self.grid.probabilities([level])[0]
        joint = self.posterior * (predicted if positive else 1.0 - predicted)
        self.posterior = joint / np.sum(joint)
        self._done += 1

    def exclude(self, level: float) -> None:
        """Propose no level from here on up: the rig cannot render it.

        Parameters
        ----------
        level : float
            The lowest level that is not rendered whole.

        Raises
        ------
        ArgumentError
            If none is left.
        """
        self._allowed &= self.levels < level
        if not self._allowed.any():
            raise ArgumentError(
                f"the rig renders no level from {np.min(self.levels):g} on: lower them"
            )

"""Procedures that choose the next level: constant stimuli, a staircase, QUEST+."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from frictus.errors import ArgumentError
from frictus.experiment.psychometrics.psychometric import FloatArray, ParameterGrid


class Staircase:
    """An n-down m-up staircase on a logarithmic axis.

    n right answers in a row lower the level, m wrong ones raise it: Levitt 1971, Transformed
    up-down methods in psychoacoustics, J. Acoust. Soc. Am. 49, 467-477.

    Parameters
    ----------
    start : float
        First level, above 0.
    low, high : float
        Least and greatest level.
    down, up : int
        Positive answers in a row that lower the level; negative ones that raise it.
    steps_db : sequence of float
        Step before the first reversal, the second and so on, 20 log10 of the ratio of levels;
        the last one stays.
    reversals : int
        After which the procedure is finished.
    trials : int
        After which it is finished at the latest.
    """

    def __init__(
        self,
        start: float,
        low: float,
        high: float,
        down: int,
        up: int,
        steps_db: Sequence[float],
        reversals: int,
        trials: int,
    ) -> None:
        self.level = start
        self._low, self._high = low, high
        self._down, self._up = down, up
        self._steps_db = tuple(steps_db)
        self._wanted, self._trials = reversals, trials
        self._done = 0
        self._in_a_row = 0
        self._direction = 0
        self.reversals: list[float] = []

    @property
    def finished(self) -> bool:
        """Whether it has turned often enough, or all trials are done."""
        return len(self.reversals) >= self._wanted or self._done >= self._trials

    def next_level(self) -> float:
        """Return the level to present."""
        return self.level

    def update(self, level: float, positive: bool) -> None:
        """Take in an answer.

        Parameters
        ----------
        level : float
            Level as rendered, from which the next step is taken.
        positive : bool
            Correct, or "yes", or "different".
        """
        self._done += 1
        self._in_a_row = max(self._in_a_row, 0) + 1 if positive else min(self._in_a_row, 0) - 1
        if self._in_a_row == self._down:
            self._move(level, -1)
        elif self._in_a_row == -self._up:
            self._move(level, +1)

    def _move(self, level: float, direction: int) -> None:
        self._in_a_row = 0
        if self._direction == -direction:
            self.reversals.append(level)
        self._direction = direction
        step_db = self._steps_db[min(len(self.reversals), len(self._steps_db) - 1)]
        moved = level * 10.0 ** (direction * step_db / 20.0)
        self.level = min(max(moved, self._low), self._high)

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
        _check_rendered(level, self._low)
        step = 10.0 ** (-self._steps_db[-1] / 20.0)
        self._high = min(self._high, max(level * step, self._low))
        self.level = min(self.level, self._high)


class QuestPlus:
    """Bayesian adaptive procedure over a grid of candidate functions.

    The level whose answer is expected to leave the least uncertainty comes next: Watson 2017,
    QUEST+: A general multidimensional Bayesian adaptive psychometric method, Journal of Vision
    17(3):10. The expected entropy after a trial at level x is, with the posterior p over the
    candidates and the likelihood L(r, x) of response r,

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


class ConstantStimuli:
    """The method of constant stimuli: each level once in every block, in an order drawn before.

    Parameters
    ----------
    levels : sequence of float
        The levels, above 0.
    repeats : int
        How often each is presented.
    rng : numpy.random.Generator
        Draws the order.
    """

    def __init__(self, levels: Sequence[float], repeats: int, rng: np.random.Generator) -> None:
        blocks = [rng.permutation(np.asarray(levels, float)) for _ in range(repeats)]
        self._left = [float(level) for block in blocks for level in block]
        self._lowest = min(levels)

    @property
    def finished(self) -> bool:
        """Whether all trials are done."""
        return not self._left

    def next_level(self) -> float:
        """Return the level to present."""
        return self._left[0]

    def update(self, level: float, positive: bool) -> None:
        """Go on to the next level.

        Parameters
        ----------
        level : float
            Level as rendered.
        positive : bool
            The answer; the order does not depend on it.
        """
        self._left.pop(0)

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
        _check_rendered(level, self._lowest)
        self._left = [each for each in self._left if each < level]


def _check_rendered(level: float, lowest: float) -> None:
    """Refuse that from a level on nothing is rendered, where this leaves none."""
    if level <= lowest:
        raise ArgumentError(
            f"the rig renders none of the levels from {lowest:g} on: lower them"
        )

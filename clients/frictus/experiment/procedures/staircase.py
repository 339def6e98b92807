"""Transformed staircases: n right answers in a row lower the level, m wrong ones raise it.

Levitt 1971, Transformed up-down methods in psychoacoustics, J. Acoust. Soc. Am. 49, 467-477.
"""

from collections.abc import Sequence

from frictus.errors import ArgumentError


class Staircase:
    """An n-down m-up staircase on a logarithmic axis.

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
        step = 10.0 ** (-self._steps_db[-1] / 20.0)
        if level <= self._low:
            raise ArgumentError(
                f"the rig renders none of the levels from {self._low:g} on: lower them"
            )
        self._high = min(self._high, max(level * step, self._low))
        self.level = min(self.level, self._high)

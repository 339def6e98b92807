"""The method of constant stimuli: every level equally often, in an order drawn in advance."""

from collections.abc import Sequence

import numpy as np

from frictus.errors import ArgumentError


class ConstantStimuli:
    """Each level once in every block, shuffled within the block.

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
        if level <= self._lowest:
            raise ArgumentError(
                f"the rig renders none of the levels from {self._lowest:g} on: lower them"
            )
        self._left = [each for each in self._left if each < level]

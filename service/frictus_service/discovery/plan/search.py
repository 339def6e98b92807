"""The cheapest additions that let a programme show what it does not, or tell apart."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Final

import numpy as np

from frictus_service.discovery.decision.decision import ALIKE
from frictus_service.discovery.plan.ability import Ability, ability_of
from frictus_service.discovery.plan.assumptions import Assumptions
from frictus_service.discovery.plan.extras import EXTRAS, Extra
from frictus_service.discovery.plan.programme import Programme
from frictus_service.discovery.plan.setup import Setup

HELPFUL: Final = 0.9
"""An addition that leaves more of a problem than that is not tried together with others."""
MOST_PAIRS: Final = 12
"""Of additions that are tried together for one problem, the cheapest first."""


@dataclass(frozen=True, slots=True)
class Shortcoming:
    """Two effects that look alike, or one that is not shown as small as is wanted.

    Attributes
    ----------
    effects : tuple of str
        One or two ids.
    rows, columns : tuple of int
        Candidates of the first; of the second, empty where there is one.
    wanted : float
        Coefficient to be shown, of one.
    """

    effects: tuple[str, ...]
    rows: tuple[int, ...]
    columns: tuple[int, ...] = ()
    wanted: float = np.nan

    def left(self, ability: Ability | None) -> float:
        """Return how much of the problem is left: solved below 1.

        Parameters
        ----------
        ability : Ability or None
            What the programme shows; None: nothing can be tested.
        """
        if ability is None:
            return np.inf
        if self.columns:
            cosines = ability.cosine[np.ix_(self.rows, self.columns)]
            apart = 1.0 - float(np.abs(cosines).max())
            return float(np.sqrt((1.0 - ALIKE) / apart)) if apart > 0.0 else np.inf
        return float(ability.detectable[list(self.rows)].max()) / self.wanted


@dataclass(frozen=True, slots=True)
class Tried:
    """Additions, what they cost, and what the programme shows with them."""

    extras: tuple[Extra, ...]
    finger_s: float
    ability: Ability | None


Judge = Callable[[Programme], Ability | None]


def remedies(
    programme: Programme,
    setup: Setup,
    assumptions: Assumptions,
    problems: Sequence[Shortcoming],
    seed: int,
) -> list[Tried | None]:
    """Return for each problem the cheapest addition, or two, that solves it; None if none does.

    Parameters
    ----------
    programme : Programme
        All trials of everybody, in order.
    setup : Setup
        Base model, rig and candidates.
    assumptions : Assumptions
        How readings scatter and people differ.
    problems : sequence of Shortcoming
        What is not shown, or not told apart.
    seed : int
        Of everything random; the same seed gives the same result.
    """
    if not problems:
        return []
    few = programme.few()

    def judged(extras: tuple[Extra, ...]) -> Tried | None:
        changed = _changed(few, extras, seed)
        if changed is None:
            return None
        cost = changed.finger_s - few.finger_s
        return Tried(extras, cost, ability_of(changed, setup, assumptions, seed))

    now = ability_of(few, setup, assumptions, seed)
    singles = [tried for extra in EXTRAS if (tried := judged((extra,))) is not None]
    known: dict[tuple[str, ...], Tried | None] = {}

    def both(first: Tried, second: Tried) -> Tried | None:
        extras = first.extras + second.extras
        key = tuple(extra.id for extra in extras)
        if key not in known:
            known[key] = judged(extras)
        return known[key]

    return [
        _cheapest(problem, singles) or _cheapest_pair(problem, now, singles, both)
        for problem in problems
    ]


def _changed(programme: Programme, extras: Sequence[Extra], seed: int) -> Programme | None:
    rng = np.random.default_rng(seed)
    changed: Programme | None = programme
    for extra in extras:
        if changed is not None:
            changed = extra.change(changed, rng)
    return changed


def _cheapest(problem: Shortcoming, tried: Sequence[Tried]) -> Tried | None:
    """Return the cheapest that solves a problem."""
    solved = [each for each in tried if problem.left(each.ability) < 1.0]
    return min(solved, key=lambda each: each.finger_s, default=None)


def _cheapest_pair(
    problem: Shortcoming,
    now: Ability | None,
    singles: Sequence[Tried],
    both: Callable[[Tried, Tried], Tried | None],
) -> Tried | None:
    """Return the cheapest two that solve a problem, of those that each help a little."""
    before = problem.left(now)
    helpful = [
        each
        for each in singles
        if problem.left(each.ability) < HELPFUL * before or each.finger_s == 0.0
    ]
    by_cost = sorted(
        combinations(helpful, 2), key=lambda two: two[0].finger_s + two[1].finger_s
    )
    for first, second in by_cost[:MOST_PAIRS]:
        tried = both(first, second)
        if tried is not None and problem.left(tried.ability) < 1.0:
            return tried
    return None

"""The cheapest additions that let a programme show what it does not, or name why none does."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, pairwise, product
from typing import Final

import numpy as np

from frictus_service.discovery.decision.naming import ALIKE
from frictus_service.discovery.plan.ability import Ability, ability_of
from frictus_service.discovery.plan.assumptions import Assumptions
from frictus_service.discovery.plan.documents import Setup
from frictus_service.discovery.plan.programme import PlannedTrial, Programme
from frictus_service.discovery.plan.rows import FULL_VPP

Change = Callable[[Programme, np.random.Generator], Programme | None]

SLOW_MM_S: Final = (5.0, 10.0)
LOW_HZ, LOWER_HZ, HIGH_HZ, HIGHER_HZ = 30.0, 10.0, 1900.0, 2900.0
WEAK_VPP: Final = (75.0, 110.0)
BLOCK_SHARE: Final = 0.25
MORE_PEOPLE: Final = 4
OTHER_SPEEDS_MM_S: Final = (20.0, 100.0)
OTHER_FORCES_N: Final = (0.2, 0.6)


@dataclass(frozen=True, slots=True)
class Extra:
    """An addition.

    Attributes
    ----------
    id, words : str
        As the document names it, and as people read it.
    change : callable
        Returns None where it adds nothing to a programme.
    """

    id: str
    words: str
    change: Change


def _levels(own: Sequence[PlannedTrial]) -> tuple[list[float], list[float], list[float]]:
    """Return tones, speeds and forces that a participant has; rising."""
    tones = sorted({tone for trial in own for tone in trial.tones_hz})
    return (
        tones,
        sorted({trial.speed_mm_s for trial in own}),
        sorted({trial.force_n for trial in own}),
    )


def _middle(values: Sequence[float]) -> float:
    return values[len(values) // 2]


def _crossed(
    own: Sequence[PlannedTrial],
    tones: Sequence[tuple[float, ...]],
    speeds: Sequence[float],
    forces: Sequence[float],
    drive_vpp: float | None = None,
) -> list[PlannedTrial]:
    """Return all combinations, drive and length as the participant's trials have them."""
    driven = [trial.drive_vpp for trial in own if trial.tones_hz]
    full = max(driven, default=FULL_VPP) if drive_vpp is None else drive_vpp
    seconds = float(np.median([trial.seconds for trial in own]))
    return [
        PlannedTrial(speed, force, each, full if each else 0.0, seconds)
        for each, speed, force in product(tones, speeds, forces)
    ]


def _adding(more: Callable[[Sequence[PlannedTrial]], Sequence[PlannedTrial]]) -> Change:
    """Return the change that adds trials, nothing where there are none to add."""

    def change(programme: Programme, rng: np.random.Generator) -> Programme | None:
        if not all(more(own) for own in programme.people):
            return None
        return programme.with_more(more, rng)

    return change


def _tone(own: Sequence[PlannedTrial], tone_hz: float) -> list[PlannedTrial]:
    _, speeds, forces = _levels(own)
    return _crossed(own, [(tone_hz,)], speeds, [_middle(forces)])


def _between(own: Sequence[PlannedTrial]) -> list[PlannedTrial]:
    tones, speeds, forces = _levels(own)
    widest = sorted(pairwise(tones), key=lambda gap: gap[0] / gap[1])[:2]
    new = [(round(float(np.sqrt(low * high)), 1),) for low, high in widest]
    return _crossed(own, new, speeds, [_middle(forces)])


def _lower(own: Sequence[PlannedTrial], tone_hz: float) -> list[PlannedTrial]:
    lowest = min(_levels(own)[0], default=0.0)
    return _tone(own, tone_hz) if lowest > 1.1 * tone_hz else []


def _higher(own: Sequence[PlannedTrial], tone_hz: float) -> list[PlannedTrial]:
    highest = max(_levels(own)[0], default=np.inf)
    return _tone(own, tone_hz) if highest < tone_hz / 1.1 else []


def _weaker(own: Sequence[PlannedTrial]) -> list[PlannedTrial]:
    tones, speeds, forces = _levels(own)
    present = {trial.drive_vpp for trial in own}
    return [
        trial
        for drive in WEAK_VPP
        if drive not in present
        for trial in _crossed(
            own, [(t,) for t in tones], [_middle(speeds)], [_middle(forces)], drive
        )
    ]


def _slower(own: Sequence[PlannedTrial]) -> list[PlannedTrial]:
    tones, speeds, forces = _levels(own)
    new = [speed for speed in SLOW_MM_S if speed < 0.7 * speeds[0]]
    trials = _crossed(own, [(tone,) for tone in tones], new, [_middle(forces)])
    return [replace(trial, seconds=max(trial.seconds, 8.0)) for trial in trials]


def _other(own: Sequence[PlannedTrial], which: str) -> list[PlannedTrial]:
    """Return trials at two further speeds, or forces, where there is one."""
    tones, speeds, forces = _levels(own)
    asked = [(tone,) for tone in tones]
    if which == "speeds" and len(speeds) == 1:
        return _crossed(own, asked, OTHER_SPEEDS_MM_S, [_middle(forces)])
    if which == "forces" and len(forces) == 1:
        return _crossed(own, asked, [_middle(speeds)], OTHER_FORCES_N)
    return []


def _three_at_once(own: Sequence[PlannedTrial]) -> list[PlannedTrial]:
    tones, speeds, forces = _levels(own)
    if len(tones) < 3:
        return []
    return _crossed(own, [(tones[0], _middle(tones), tones[-1])], speeds, forces)


def _blank(own: Sequence[PlannedTrial]) -> list[PlannedTrial]:
    _, speeds, forces = _levels(own)
    return _crossed(own, [()], speeds, forces)


def _block_again(programme: Programme, rng: np.random.Generator) -> Programme | None:
    """Return conditions of one end of a session at the other end, too.

    What was run already gets a session of its own, which the last ones begin.
    """
    if programme.shuffled:
        return None
    backward = programme.done

    def more(own: Sequence[PlannedTrial]) -> list[PlannedTrial]:
        ordered = sorted(own, key=lambda trial: trial.minutes, reverse=backward)
        return ordered[: max(1, round(BLOCK_SHARE * len(own)))]

    return programme.with_more(more, rng)


def _random_order(programme: Programme, rng: np.random.Generator) -> Programme | None:
    if programme.shuffled or programme.done:
        return None
    return programme.randomised(rng)


def _more_people(programme: Programme, rng: np.random.Generator) -> Programme | None:
    people = programme.people
    count = programme.participants + MORE_PEOPLE
    shown = people if len(people) < programme.participants else (*people, *people)[:count]
    return replace(programme, participants=count, people=shown)


EXTRAS: Final = (
    Extra("random_order", "all trials in random order", _random_order),
    Extra(
        "block_again",
        "the first quarter of the trials again at the end (of a study that was run: the last "
        "quarter again, in a further session)",
        _block_again,
    ),
    Extra(
        "two_tones", "a tone in each of the two widest gaps, at every speed", _adding(_between)
    ),
    Extra(
        "tone_30", "a tone of 30 Hz at every speed", _adding(lambda own: _lower(own, LOW_HZ))
    ),
    Extra(
        "tone_10", "a tone of 10 Hz at every speed", _adding(lambda own: _lower(own, LOWER_HZ))
    ),
    Extra(
        "tone_1900",
        "a tone of 1.9 kHz at every speed",
        _adding(lambda own: _higher(own, HIGH_HZ)),
    ),
    Extra(
        "tone_2900",
        "a tone of 2.9 kHz at every speed",
        _adding(lambda own: _higher(own, HIGHER_HZ)),
    ),
    Extra("weaker", "every tone at 75 and at 110 Vpp, in one condition", _adding(_weaker)),
    Extra("slow", "every tone at 5 and at 10 mm/s, in one force", _adding(_slower)),
    Extra(
        "speeds",
        "every tone at 20 and at 100 mm/s, in one force",
        _adding(lambda own: _other(own, "speeds")),
    ),
    Extra(
        "forces",
        "every tone at 0.2 and at 0.6 N, at one speed",
        _adding(lambda own: _other(own, "forces")),
    ),
    Extra("three_tones", "three tones at once in every condition", _adding(_three_at_once)),
    Extra("blanks", "a trial without drive in every condition", _adding(_blank)),
    Extra("people", f"{MORE_PEOPLE} more participants", _more_people),
    Extra("repeat", "all trials once more", _adding(lambda own: own)),
)
"""In the order in which equally cheap ones are tried."""


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

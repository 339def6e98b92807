"""From a programme to the document: what it shows, what looks alike, what to add."""

from collections.abc import Callable, Mapping
from importlib.metadata import version
from itertools import combinations
from typing import Final

import numpy as np

from frictus_hardware.physics.effects import EFFECTS
from frictus_service.discovery.catalogue.causes import cause_of, separating_experiment
from frictus_service.discovery.evidence.observation_table import LEAST_TRIALS, LEAST_UNITS
from frictus_service.discovery.plan.ability import Ability, ability_of, unit_count
from frictus_service.discovery.plan.assumptions import Assumptions
from frictus_service.discovery.plan.documents import (
    Addition,
    Plan,
    PlannedEffect,
    PlannedPair,
    Setup,
    Shown,
)
from frictus_service.discovery.plan.programme import Programme, stretches_of, tones_in
from frictus_service.discovery.plan.search import Shortcoming, Tried, remedies
from frictus_service.discovery.problem.candidates import Candidate

WEAK: Final = 0.7
"""Cosine from which two signatures are told apart only where both are strong."""


def plan(
    programme: Programme,
    setup: Setup,
    assumptions: Assumptions,
    wanted: Mapping[str, float],
    source: str,
    *,
    seed: int = 0,
    tell: Callable[[str], None] | None = None,
) -> Plan:
    """Return what a programme shows, what looks alike in it, and the cheapest additions.

    Parameters
    ----------
    programme : Programme
        All trials of everybody, in order.
    setup : Setup
        Base model, rig and candidates.
    assumptions : Assumptions
        How readings scatter and people differ.
    wanted : mapping of str to float
        Size of each effect that shall be shown, from `documents.wanted_sizes`.
    source : str
        What the programme was made from, for people.
    seed : int
        Of orders, of how fingers wander, and of studies without effects.
    tell : callable or None
        Told what it is at.
    """
    tell = tell or (lambda line: None)
    tell("what the design shows")
    ability = ability_of(programme, setup, assumptions, seed)
    faint = _faint(setup, ability, wanted)
    alike = _alike(setup, ability)
    problems = [*faint, *(pair for pair in alike if pair.left(ability) > 1.0)]
    tell("which further trials would help")
    found = dict(
        zip(problems, remedies(programme, setup, assumptions, problems, seed), strict=True)
    )
    units = unit_count(programme)
    tests = ability is not None and bool(np.isfinite(ability.critical))
    return Plan(
        code_version=version("frictus"),
        seed=seed,
        source=source,
        response=setup.response,
        participants=programme.participants,
        trials=round(len(programme.trials) / len(programme.people)),
        finger_s=programme.finger_s,
        units=units,
        compared="participants" if programme.participants >= LEAST_UNITS else "blocks",
        critical_t=ability.critical if ability is not None and tests else None,
        effects=tuple(
            _effect(setup.candidates, k, ability, wanted, found)
            for k in range(len(setup.candidates))
        ),
        pairs=tuple(_pair(pair, ability, found) for pair in alike if ability is not None),
        notes=(*_notes(programme, units, tests=tests), *_too_short(programme, setup)),
        assumptions=assumptions.source,
    )


def _faint(
    setup: Setup, ability: Ability | None, wanted: Mapping[str, float]
) -> list[Shortcoming]:
    """Return the effects that are not shown as small as is wanted."""
    found = [
        Shortcoming((each.effect,), (k,), wanted=_coefficient(each, wanted[each.effect]))
        for k, each in enumerate(setup.candidates)
    ]
    return [each for each in found if not each.left(ability) < 1.0]


def _alike(setup: Setup, ability: Ability | None) -> list[Shortcoming]:
    """Return the pairs of effects that look alike, most alike first."""
    if ability is None:
        return []
    of_effect: dict[str, list[int]] = {}
    for k, each in enumerate(setup.candidates):
        of_effect.setdefault(each.effect, []).append(k)
    pairs = [
        Shortcoming((a, b), tuple(of_effect[a]), tuple(of_effect[b]))
        for a, b in combinations(sorted(of_effect), 2)
    ]
    kept = [each for each in pairs if abs(_largest(each, ability)) > WEAK]
    return sorted(kept, key=lambda each: -each.left(ability))


def _coefficient(candidate: Candidate, dose: float) -> float:
    return dose**2 if candidate.squared else dose


def _dose(candidate: Candidate, coefficient: float) -> float:
    return float(np.sqrt(coefficient)) if candidate.squared else float(coefficient)


def _effect(
    candidates: tuple[Candidate, ...],
    place: int,
    ability: Ability | None,
    wanted: Mapping[str, float],
    found: Mapping[Shortcoming, Tried | None],
) -> PlannedEffect:
    candidate = candidates[place]
    effect = EFFECTS[candidate.effect]
    size = np.inf if ability is None else float(ability.detectable[place])
    seen = bool(np.isfinite(size))
    detectable = _dose(candidate, size) if seen else None
    shown: Shown = "no"
    if detectable is not None:
        small = detectable < wanted[candidate.effect]
        shown = "yes" if small else "larger only"
    error = None
    if ability is not None and seen and not candidate.squared:
        error = float(ability.standard_error[place])
    tried = next(
        (tried for one, tried in found.items() if one.rows == (place,) and not one.columns),
        None,
    )
    cheapest = None
    if tried is not None and tried.ability is not None:
        reached = _dose(candidate, float(tried.ability.detectable[place]))
        cheapest = _addition(tried, reached)
    return PlannedEffect(
        id=candidate.effect,
        parameter=candidate.parameter,
        unit=next(p.unit for p in effect.parameters if p.name == candidate.parameter),
        held=dict(candidate.held),
        shown=shown,
        wanted=wanted[candidate.effect],
        detectable=detectable,
        standard_error=error,
        needs=None if seen or ability is None else cause_of(candidate.effect).visible_with,
        cheapest=cheapest,
    )


def _pair(
    pair: Shortcoming, ability: Ability, found: Mapping[Shortcoming, Tried | None]
) -> PlannedPair:
    first, second = pair.effects
    tried = found.get(pair)
    return PlannedPair(
        between=(first, second),
        cosine=_largest(pair, ability),
        separable="no" if pair.left(ability) > 1.0 else "weakly",
        separating_experiment=separating_experiment(first, second),
        cheapest=None
        if tried is None or tried.ability is None
        else _addition(tried, _largest(pair, tried.ability)),
    )


def _largest(pair: Shortcoming, ability: Ability) -> float:
    """Return the cosine of largest size between two effects."""
    cosines = ability.cosine[np.ix_(pair.rows, pair.columns)].ravel()
    return float(cosines[np.argmax(np.abs(cosines))])


def _addition(tried: Tried, reaches: float) -> Addition:
    return Addition(
        additions=tuple(extra.words for extra in tried.extras),
        finger_s=max(tried.finger_s, 0.0),
        reaches=reaches,
    )


def _notes(programme: Programme, units: int, *, tests: bool) -> tuple[str, ...]:
    people, notes = programme.participants, []
    if units < LEAST_UNITS:
        notes.append(
            f"Nothing can be tested: {people} participants with these trials make {units} "
            f"units to compare. Accepted: {LEAST_UNITS} participants, or fewer whose trials "
            f"make {LEAST_UNITS} blocks of {LEAST_TRIALS} each."
        )
    elif people < LEAST_UNITS:
        notes.append(
            f"{people} participant{'s' if people > 1 else ''}, below {LEAST_UNITS}: blocks of "
            "their trials take the role of people. What is found holds for these people only."
        )
    if units >= LEAST_UNITS and not tests:
        notes.append(
            "This design shows none of the effects: what they change, everybody's own "
            "parameters can do at these tones, speeds and forces."
        )
    for name, levels in (
        ("speed", {trial.speed_mm_s for trial in programme.trials}),
        ("force", {trial.force_n for trial in programme.trials}),
    ):
        if len(levels) == 1:
            notes.append(
                f"All trials have one target {name}: this design shows nothing that depends on "
                f"{name}, whatever fingers do of themselves."
            )
    return tuple(notes)


def _too_short(programme: Programme, setup: Setup) -> list[str]:
    """Return the note on trials of which no tone can be measured."""
    trials = programme.trials
    stretches = stretches_of(trials, programme.span_mm)
    enough = {
        stretches[place].trial for place, _ in tones_in(trials, stretches, setup.sample_rate_hz)
    }
    short = [trial for k, trial in enumerate(trials) if trial.tones_hz and k not in enough]
    if not short:
        return []
    each = max(short, key=lambda trial: trial.speed_mm_s)
    return [
        f"{len(short)} of {len(trials)} trials say nothing of the response: no third of a "
        f"stroke is long enough, as of {min(each.tones_hz):g} Hz at {each.speed_mm_s:g} mm/s. "
        "Accepted: three periods of the lowest tone."
    ]

"""Which of the causes with an alarm are named: the strongest, and what it leaves of the others.

A cause changes the response in ways that others share in part, and so one true cause raises
several alarms. The one with the most evidence is named; the others are judged again with it
accounted for, and named too where their evidence is an alarm still (forward selection).
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from frictus_hardware.arrays import FloatArray
from frictus_service.tracking.evidence.signatures import (
    EFFECT_CAUSES,
    LAW_CAUSES,
    LAW_SIZES,
    PATTERN_SIZE,
    PATTERNS,
    SHAPED,
    SIZES,
    EvidencePattern,
)
from frictus_service.tracking.evidence.sums import UNMODELLED, Sums, log_ratio
from frictus_service.tracking.evidence.watch import (
    ALARM,
    CAUSES,
    MAINS,
    UNKNOWN,
    ModelWatch,
)

ALIKE: Final = 3.0
"""Nats: a cause with so little less evidence than the named one cannot be told from it."""


@dataclass(frozen=True, slots=True)
class NamedAlarm:
    """A cause that is named.

    Attributes
    ----------
    cause : str
        One of `watch.CAUSES`.
    size : float
        Dose so far, in the unit of the cause; NaN where there is none.
    alike : tuple of str
        Causes with an alarm that cannot be told from it.
    where : EvidencePattern or None
        Of what is unknown: the octave, part and covariate in which it is largest.
    """

    cause: str
    size: float
    alike: tuple[str, ...] = ()
    where: EvidencePattern | None = None


def named_alarms(watch: ModelWatch) -> tuple[NamedAlarm, ...]:
    """Return the causes that are named, the first with the most evidence.

    Parameters
    ----------
    watch : ModelWatch
        Over the model in force.
    """
    if not watch.raised:
        return ()
    evidence = dict(zip(CAUSES, watch.log_evidence.tolist(), strict=True))
    raised = {name for name in watch.raised if evidence[name] >= ALARM} or set(watch.raised)
    sums, each = watch.sums, watch.sums.log_evidence()
    effects = _selected(sums, each, [name for name in EFFECT_CAUSES if name in raised])
    unknown = UNKNOWN in raised
    if unknown and effects and evidence[UNKNOWN] > max(evidence[name] for name in effects):
        effects = []  # what no cause is made of says more than any of them
    found = [*effects]
    for number, name in enumerate(LAW_CAUSES):
        if name in raised and _law_left(sums, each, number, effects) >= ALARM:
            found.append(name)
    ends = ("cutoff", "speed_dependent_cutoff")
    if set(ends) <= set(found):  # the cutoff at the speeds explored: a slope, or alike at all
        found.remove(min(ends, key=lambda name: evidence[name]))
    found += [name for name in (MAINS, UNKNOWN) if name in raised]
    if not found:  # what accounts for an alarm was one once, and is none now
        found = [max(raised, key=lambda name: evidence[name])]
    found.sort(key=lambda name: -evidence[name])
    others = raised - set(found)
    return tuple(
        NamedAlarm(
            name,
            _size(sums, each, name),
            tuple(
                sorted(other for other in others if evidence[other] > evidence[name] - ALIKE)
            ),
            _where(sums, each) if name == UNKNOWN else None,
        )
        for name in found
    )


def _selected(sums: Sums, each: FloatArray, raised: list[str]) -> list[str]:
    """Return effects in the order in which they are selected."""
    chosen: list[str] = []
    while len(chosen) < len(raised):
        left = {
            name: _effect_left(sums, each, name, chosen)
            for name in raised
            if name not in chosen
        }
        best = max(left, key=lambda name: left[name])
        if chosen and left[best] < ALARM:
            break
        chosen.append(best)
    return chosen


def _effect_left(sums: Sums, each: FloatArray, name: str, given: list[str]) -> float:
    process, own, others = _strongest(each, name), _effect(name), [*map(_effect, given)]
    score, information = _conditional(
        sums.score[process], sums.information[process], own, others
    )
    edge = SIZES[name].tolerated / SIZES[name].expected
    slack = UNMODELLED * np.sqrt(sums.certainty[process] * max(float(information), 0.0))
    ratio = log_ratio(score, information, edge, slack * SHAPED[own])
    return float(sums.log_share[process, CAUSES.index(name)] + ratio)


def _law_left(sums: Sums, each: FloatArray, number: int, given: list[str]) -> float:
    if not given:
        return np.inf
    process, own = _strongest(each, LAW_CAUSES[number]), len(EFFECT_CAUSES)
    score, information = _conditional(
        sums.law_score[process, number],
        sums.law_information[process, number],
        own,
        [*map(_effect, given)],
    )
    edge = LAW_SIZES[number].tolerated / LAW_SIZES[number].expected
    return float(sums.log_share[process, number] + log_ratio(score, information, edge))


def _conditional(
    score: FloatArray, information: FloatArray, own: int, others: list[int]
) -> tuple[FloatArray, FloatArray]:
    """Return score and information of one deviation with others accounted for."""
    if not others:
        return score[own], information[own, own]
    block = information[np.ix_(others, others)] + 1e-9 * np.eye(len(others))
    share = np.linalg.solve(block, information[others, own])
    return (
        score[own] - share @ score[others],
        information[own, own] - share @ information[others, own],
    )


def _size(sums: Sums, each: FloatArray, name: str) -> float:
    process = _strongest(each, name)
    if name in LAW_CAUSES:
        number = LAW_CAUSES.index(name)
        score = sums.law_score[process, number, -1]
        information = sums.law_information[process, number, -1, -1]
        unit = LAW_SIZES[number].expected
    elif name in SIZES:
        own = _effect(name)
        score, information = sums.score[process, own], sums.information[process, own, own]
        unit = SIZES[name].expected
    elif name == UNKNOWN:
        own = int(np.argmax(sums.patterns()[process]))
        score = sums.pattern_score[process, own]
        information = sums.pattern_information[process, own]
        unit = PATTERN_SIZE.expected
    else:
        return float("nan")
    return float(unit * score / max(float(information), 1e-9))


def _where(sums: Sums, each: FloatArray) -> EvidencePattern:
    return PATTERNS[int(np.argmax(sums.patterns()[_strongest(each, UNKNOWN)]))]


def _strongest(each: FloatArray, name: str) -> int:
    return int(np.argmax(each[:, CAUSES.index(name)]))


def _effect(name: str) -> int:
    return EFFECT_CAUSES.index(name)

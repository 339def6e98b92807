"""What a reader must know first: what could not be tested, and why."""

import re
from collections import Counter
from collections.abc import Sequence
from typing import Final

from frictus_service.discovery.evidence.observation_table import (
    LEAST_TRIALS,
    LEAST_UNITS,
    ResponseName,
    UnitAssignment,
    telling_of,
)
from frictus_service.discovery.evidence.trial_evidence import TrialEvidence

_NUMBER: Final = re.compile(r"[-+±]?\d[\d.,e+-]*")
"""Which the same reason gives anew for every trial."""


def caveats_on(
    evidence: Sequence[TrialEvidence],
    usable: Sequence[TrialEvidence],
    compared: Sequence[TrialEvidence],
    units: UnitAssignment,
    response: ResponseName,
) -> tuple[str, ...]:
    """Return the notes.

    Parameters
    ----------
    evidence, usable, compared : sequence of TrialEvidence
        All trials of the study, those that can be used, and those of people who are compared.
    units : UnitAssignment
        Which trial belongs to which unit.
    response : {'friction', 'mobility'}
    """
    return (
        *_left_out(evidence, usable),
        *_people(usable, compared, response),
        *_design(compared),
        *_units(compared, units),
    )


def _people(
    usable: Sequence[TrialEvidence], compared: Sequence[TrialEvidence], response: ResponseName
) -> list[str]:
    """Return who is left out, and why."""
    kept = {one.observed.info.participant for one in compared}
    telling = telling_of(usable, response)
    out = sorted({one.observed.info.participant for one in usable} - kept)
    notes = []
    for words, names in (
        ("no usable trial says anything", [name for name in out if not telling[name]]),
        (
            f"fewer than {LEAST_TRIALS} usable trials, as many as a block of them needs where "
            "blocks take the role of people, say anything",
            [name for name in out if telling[name]],
        ),
    ):
        if names:
            notes.append(f"Left out: {', '.join(names)}: {words} of the {response} response.")
    return notes


def _left_out(evidence: Sequence[TrialEvidence], used: Sequence[TrialEvidence]) -> list[str]:
    missing = len(evidence) - len(used)
    if not missing:
        return []
    told = [one.observed.reasons[0] for one in evidence if one.observed.reasons]
    if not told:
        return [
            f"{missing} of {len(evidence)} trials are not used: they hold no steady sweep "
            "of which speed, force and position are known."
        ]
    kinds = [_NUMBER.sub("", reason) for reason in told]
    kind, count = Counter(kinds).most_common(1)[0]
    example = told[kinds.index(kind)]
    return [
        f"{missing} of {len(evidence)} trials are not used; most often ({count} times) for a "
        f"reason like this: {example}."
    ]


def _design(used: Sequence[TrialEvidence]) -> list[str]:
    infos = [one.observed.info for one in used]
    notes = []
    for name, levels in (
        ("speed", {info.speed_mm_s for info in infos}),
        ("force", {info.force_n for info in infos}),
    ):
        if len(levels) == 1:
            notes.append(
                f"All trials have one target {name}: nothing that depends on {name} can be "
                "named beyond what it varies within a trial."
            )
    return notes


def _units(used: Sequence[TrialEvidence], units: UnitAssignment) -> list[str]:
    people = len(set(units.participant))
    if len(units.names) < LEAST_UNITS:
        return [
            f"Nothing was tested: {len(used)} usable trials of {people} participants make "
            f"{len(units.names)} units to compare. Accepted: {LEAST_UNITS} participants, or "
            f"fewer whose trials make {LEAST_UNITS} blocks of {LEAST_TRIALS} each; measure "
            "more."
        ]
    if units.held_out == "blocks":
        return [
            f"{people} participant{'s' if people > 1 else ''}, below {LEAST_UNITS}: blocks of "
            "their trials take the role of people. What is found holds for these people only."
        ]
    return []

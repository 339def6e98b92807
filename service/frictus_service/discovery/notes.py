"""What a reader must know first: what could not be tested, and why."""

import re
from collections import Counter
from collections.abc import Sequence
from typing import Final

from frictus_service.discovery.evidence import TrialEvidence
from frictus_service.discovery.significance import LEAST_UNITS
from frictus_service.discovery.table import LEAST_TRIALS, Units

_NUMBER: Final = re.compile(r"[-+±]?\d[\d.,e+-]*")
"""Which the same reason gives anew for every trial."""


def notes_on(
    evidence: Sequence[TrialEvidence], used: Sequence[TrialEvidence], units: Units
) -> tuple[str, ...]:
    """Return the notes.

    Parameters
    ----------
    evidence, used : sequence of TrialEvidence
        All trials of the study, and those that can be used.
    units : Units
    """
    return (*_left_out(evidence, used), *_design(used), *_units(used, units))


def _left_out(evidence: Sequence[TrialEvidence], used: Sequence[TrialEvidence]) -> list[str]:
    missing = len(evidence) - len(used)
    if not missing:
        return []
    told = [one.observed.reasons[0] for one in evidence if one.observed.reasons]
    if not told:
        return [f"{missing} of {len(evidence)} trials are not used: they hold no steady sweep."]
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


def _units(used: Sequence[TrialEvidence], units: Units) -> list[str]:
    people = len(set(units.participant))
    if len(units.names) < LEAST_UNITS:
        return [
            f"Nothing was tested: {len(used)} usable trials of {people} participants make "
            f"{len(units.names)} units to compare. Accepted: {LEAST_UNITS} participants, or "
            f"fewer with {LEAST_UNITS * LEAST_TRIALS} trials together; measure more."
        ]
    if units.held_out == "blocks":
        return [
            f"{people} participant{'s' if people > 1 else ''}, below {LEAST_UNITS}: blocks of "
            "their trials take the role of people. What is found holds for these people only."
        ]
    return []

"""Which trials say nothing, all reasons for it, and how many more are needed."""

import re
from collections.abc import Iterable, Sequence
from typing import Final

import numpy as np

from frictus_service.discovery.document import TrialsLeftOut
from frictus_service.discovery.evidence.observation_table import (
    LEAST_TRIALS,
    LEAST_UNITS,
    ResponseName,
    UnitAssignment,
    telling_of,
)
from frictus_service.discovery.evidence.trial_evidence import TrialEvidence
from frictus_service.errors import Exclusion
from frictus_service.identification.observation.observe import (
    NO_SKIN,
    count_reasons,
    list_reasons,
)

NOT_PLACED: Final = "there is no steady sweep of which speed, force and position are known"
NO_DRIVE: Final = "there is no drive, from which friction could follow"
SKIN_MISSING: Final = re.compile(r"of (accel_m_s2|skin_velocity_m_s) are missing$")
FEW: Final = "its participant has too few trials that say anything of the response"
NO_ROWS: Final = "no response could be measured where speed, force and position are known"


def account_for(
    evidence: Sequence[TrialEvidence],
    usable: Sequence[TrialEvidence],
    compared: Sequence[TrialEvidence],
    units: UnitAssignment,
    response: ResponseName,
) -> list[str]:
    """Return what is left out, why, and what is missing where nothing can be tested.

    Parameters
    ----------
    evidence, usable, compared : sequence of TrialEvidence
        All trials of the study, those that can be used, and those of people who are compared.
    units : UnitAssignment
        Which trial belongs to which unit.
    response : {'friction', 'mobility'}
    """
    return [
        *_left_out(evidence, usable),
        *_people(usable, compared, response),
        *_silent(usable, response),
        *_untested(usable, compared, units, response),
    ]


def _left_out(evidence: Sequence[TrialEvidence], usable: Sequence[TrialEvidence]) -> list[str]:
    kept = {id(one) for one in usable}
    missing = [one for one in evidence if id(one) not in kept]
    if not missing:
        return []
    told = list_reasons(one.observed.reasons or (NOT_PLACED,) for one in missing)
    return [f"{len(missing)} of {len(evidence)} trials are not used: {told}."]


def trials_left_out(
    evidence: Sequence[TrialEvidence],
    usable: Sequence[TrialEvidence],
    compared: Sequence[TrialEvidence],
    response: ResponseName,
) -> tuple[TrialsLeftOut, ...]:
    """Return all reasons for which trials are not compared, the most frequent first.

    Parameters
    ----------
    evidence, usable, compared, response
        As for `account_for`.
    """
    may, kept = {id(one) for one in usable}, {id(one) for one in compared}
    telling = {one.observed.info.participant for one in compared}
    reasons: list[Sequence[str]] = []
    for one in evidence:
        if id(one) in kept:
            continue
        if id(one) not in may:
            reasons.append(one.observed.reasons or (NOT_PLACED,))
        elif one.observed.info.participant in telling or not telling_of([one], response):
            reasons.append(why_silent(one, response))
        else:
            reasons.append((FEW,))
    return _counted(reasons)


def unreadable(excluded: Sequence[Exclusion]) -> tuple[TrialsLeftOut, ...]:
    """Return why trials are left out before they are read, the most frequent reason first.

    Parameters
    ----------
    excluded : sequence of Exclusion
        Of the study.
    """
    return _counted((f"{one.field}: {one.reason}",) for one in excluded)


def _counted(reasons: Iterable[Sequence[str]]) -> tuple[TrialsLeftOut, ...]:
    counted = count_reasons(reasons)
    return tuple(TrialsLeftOut(reason=one.example, trials=one.trials) for one in counted)


def _silent(usable: Sequence[TrialEvidence], response: ResponseName) -> list[str]:
    """Return why trials that may be used give no response; blank trials are meant to."""
    silent = [one for one in usable if not telling_of([one], response)]
    driven = [one for one in silent if one.observed.info.tones_hz]
    # Where no trial answers, blank ones are the reason.
    meant = driven if driven or len(silent) < len(usable) else silent
    if not meant:
        return []
    told = list_reasons(why_silent(one, response) for one in meant)
    trials = f"{len(meant)} usable trial{'' if len(meant) == 1 else 's'}"
    return [f"{trials} without a {response} response: {told}."]


def why_silent(one: TrialEvidence, response: ResponseName) -> tuple[str, ...]:
    """Return why a trial that may be used gives no response.

    Parameters
    ----------
    one : TrialEvidence
        The evidence of the trial.
    response : {'friction', 'mobility'}
    """
    if response == "mobility" and NO_SKIN in one.observed.notes:
        return (NO_SKIN,)
    if not one.observed.rows.tone_hz.size:
        noted = [note for note in one.observed.notes if _explains(note)]
        if noted:
            return tuple(noted)
        if not one.observed.info.tones_hz:
            return (NO_DRIVE,)
    elif response == "friction" and not one.observed.info.tones_hz:
        return (NO_DRIVE,)
    if response == "mobility":
        lacking = [note for note in one.observed.notes if SKIN_MISSING.search(note)]
        return tuple(lacking) or (NO_ROWS,)
    return (NO_ROWS,)


def _explains(note: str) -> bool:
    return note.endswith("left out") or note.startswith("broadband")


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


def _untested(
    usable: Sequence[TrialEvidence],
    compared: Sequence[TrialEvidence],
    units: UnitAssignment,
    response: ResponseName,
) -> list[str]:
    """Return what makes a study of too few trials one that can be tested."""
    if len(units.names) >= LEAST_UNITS:
        return []
    people = len(set(units.participant))
    telling = telling_of(usable, response)
    more = missing_trials(list(telling.values()))
    durations = [one.statistics.duration_s for one in usable if one.statistics is not None]
    lasting = f", {more * float(np.median(durations)):.0f} s" if durations else ""
    others = LEAST_UNITS - len(telling)
    return [
        f"Nothing was tested: {len(compared)} usable trials of {people} participants make "
        f"{len(units.names)} units to compare. Accepted: {LEAST_UNITS} participants, or "
        f"fewer whose trials make {LEAST_UNITS} blocks of {LEAST_TRIALS} each. To do: measure "
        f"{more} more trials that give a {response} response{lasting}, or "
        f"{others} more participant{'' if others == 1 else 's'}."
    ]


def missing_trials(telling: Sequence[int]) -> int:
    """Return how many trials more make as many blocks as a test needs.

    Parameters
    ----------
    telling : sequence of int
        Trials of each person that say something; the next go to whoever needs fewest.
    """
    blocks = LEAST_UNITS - sum(count // LEAST_TRIALS for count in telling)
    begun = sorted(LEAST_TRIALS - count % LEAST_TRIALS for count in telling)
    each = [*begun, *[LEAST_TRIALS] * max(blocks, 0)]
    return sum(each[: max(blocks, 0)])

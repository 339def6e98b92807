"""What a reader of an identification must know before its figures."""

from collections.abc import Sequence

from frictus_service.identification.documents import (
    ConditionResult,
    ParticipantResult,
    StudySummary,
)
from frictus_service.identification.inference.effects import Centre
from frictus_service.identification.inference.statistics import LEAST_FOR_FLIPS

MANY_LEFT_OUT = 0.2


def notes_on(
    study: StudySummary,
    conditions: Sequence[ConditionResult],
    participants: Sequence[ParticipantResult],
    centre: Centre,
) -> tuple[str, ...]:
    """Return sentences, the gravest first.

    Parameters
    ----------
    study : StudySummary
        Path, hash and counts.
    conditions : sequence of ConditionResult
        One entry each.
    participants : sequence of ParticipantResult
        One entry each.
    centre : Centre
        Speed and force at which effects are evaluated.
    """
    return tuple(
        [
            *_on_speeds(participants, centre),
            *_on_people(study, participants),
            *_on_conditions(study, conditions),
            *_on_laws(participants),
        ]
    )


def _on_speeds(participants: Sequence[ParticipantResult], centre: Centre) -> list[str]:
    if "speed" not in centre.effects:
        return [
            f"One speed only ({centre.speed_mm_s:g} mm/s): there is no speed law. Gain and "
            "cutoff hold at this speed; measure at two speeds at least for a law."
        ]
    one = [p.participant for p in participants if p.friction and p.friction.law is None]
    return [f"No speed law of {', '.join(one)}: one speed only."] if one else []


def _on_people(study: StudySummary, participants: Sequence[ParticipantResult]) -> list[str]:
    out = []
    lost = sorted({c.participant for c in study.counts} - {p.participant for p in participants})
    if lost:
        out.append(f"Nothing of {', '.join(lost)} can be used: no valid trial.")
    n = len(participants)
    if n == 1:
        out.append(
            "One participant: intervals are of this person, from repeats; nothing is said of "
            "people in general."
        )
    elif n < LEAST_FOR_FLIPS:
        out.append(
            f"{n} participants: exact sign-flip tests need {LEAST_FOR_FLIPS} (with "
            f"{n} the smallest possible p is 1/{2 ** (n - 1)}); only t tests are given."
        )
    return out


def _on_conditions(study: StudySummary, conditions: Sequence[ConditionResult]) -> list[str]:
    out = []
    left_out = sum(bool(trial.tones_hz) for trial in study.excluded)
    driven = study.trials - sum(count.without_drive for count in study.counts)
    if driven and left_out > MANY_LEFT_OUT * driven:
        out.append(f"{left_out} of {driven} driven trials are not used.")
    if all(c.mobility is None for c in conditions):
        out.append("No mobility: nothing measured the skin at enough tones up to its limit.")
    if all(c.friction is None for c in conditions):
        out.append("No friction response: no condition has enough tones.")
    short = sum(1 for c in conditions if c.missing)
    if short:
        out.append(f"{short} of {len(conditions)} conditions lack a fit; reasons stand there.")
    far = sum(1 for c in conditions if c.outlier)
    if far:
        out.append(
            f"{far} of {len(conditions)} conditions lie far from their participant's others; "
            "they are used, and estimates without them stand beside."
        )
    return out


def _on_laws(participants: Sequence[ParticipantResult]) -> list[str]:
    negative = [
        p.participant
        for p in participants
        if p.friction and p.friction.law and p.friction.law.cutoff_0_hz.value <= 0.0
    ]
    if not negative:
        return []
    return [
        f"The cutoff of {', '.join(negative)}, continued to rest, is not positive: their laws "
        "hold between the measured speeds and cannot be stored as models."
    ]

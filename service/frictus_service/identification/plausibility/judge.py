"""From trials to findings: each participant is judged from all of their trials together."""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from frictus_service.identification.observation.observe import course_of, observe_along
from frictus_service.identification.observation.response import TrialObservations
from frictus_service.identification.plausibility.checks import CHECKS, Check
from frictus_service.identification.plausibility.finding import Finding
from frictus_service.identification.plausibility.pool import (
    Pool,
    ResponseName,
    TrialRecord,
    turned_trials,
)
from frictus_service.identification.plausibility.trial_statistics import statistics_of
from frictus_service.study.trial import StudyInfo, Trial

OF_FORCE: Final = (
    *("normal_sign", "force_unit", "force_target", "friction_sign", "friction_unit"),
    *("friction_axis", "force_axis", "drive_sign", "mobility_sign", "skin_unit", "skin_delay"),
    "position_delay",
)
CONSEQUENCES: Final = {
    "motion_axis": (
        *("speed_unit", "speed_target", "skin_direction", "skin_scale", "position_delay"),
    ),
    "normal_axis": ("normal_flips", *OF_FORCE),
    "normal_flips": OF_FORCE,
    "normal_sign": ("force_target",),
    "force_unit": ("force_target", "skin_unit", "friction_unit"),
    "speed_unit": ("speed_target", "skin_scale"),
    "friction_unit": ("skin_unit",),
    "friction_axis": ("force_axis", "skin_unit", "skin_delay", "mobility_sign", "drive_sign"),
    "force_axis": ("skin_unit", "skin_delay", "mobility_sign", "drive_sign"),
    "skin_axis": (
        *("skin_unit", "skin_delay", "mobility_sign", "skin_direction", "skin_scale"),
        "position_delay",
    ),
    "skin_scale": ("skin_unit",),
    "carrier": ("stamps", "stamps_missing", "skin_unit", "skin_delay", "position_delay"),
    "stamps": ("skin_scale", "speed_unit", "position_delay"),
}
"""By check: what it explains, which is then not said."""

SIGNS: Final = ("friction_sign", "drive_sign", "mobility_sign", "skin_direction")
"""Each compares two of force, skin and position, and trips where one of the two is turned."""

OF_SKIN: Final = ("mobility_sign", "skin_axis", "skin_direction", "skin_scale", "skin_unit")
"""Where these alone trip, it is the skin's sensor."""


def diagnose(findings: Sequence[Finding]) -> tuple[Finding, ...]:
    """Return the findings that no other one explains, those that stop first.

    Parameters
    ----------
    findings : sequence of Finding
        In the order of the checks.
    """
    explained = {
        consequence
        for cause in findings
        if cause.severity == "stop"
        for consequence in CONSEQUENCES.get(cause.code, ())
    }
    left = [each for each in findings if each.code not in explained]
    turned = _turned({each.code for each in left if each.severity == "stop"})
    told = [
        replace(each, remedy=turned) if turned and each.code in SIGNS else each for each in left
    ]
    return tuple(sorted(told, key=lambda finding: finding.severity != "stop"))


def without_skin(findings: Sequence[Finding]) -> tuple[Finding, ...]:
    """Return the findings where the skin's sensor is not used: nothing stops that is its own.

    Parameters
    ----------
    findings : sequence of Finding
        From `diagnose`.
    """
    if any(each.severity == "stop" and each.code not in OF_SKIN for each in findings):
        return tuple(findings)
    return tuple(
        replace(each, severity="warning", leaves_out=False) if each.code in OF_SKIN else each
        for each in findings
    )


def _turned(codes: set[str]) -> str | None:
    """Return which channel is turned, as what to do; None where no sign is wrong."""
    force_or_position = bool(codes & {"friction_sign", "drive_sign"})
    force_or_skin = "mobility_sign" in codes
    skin_or_position = "skin_direction" in codes
    if force_or_position and force_or_skin:
        return (
            "turn force_n along x: the sensor under the screen reports a force of the sign of "
            "the velocity"
        )
    if force_or_skin:
        return "turn accel_m_s2 or skin_velocity_m_s along x: force and positions agree"
    if force_or_position and skin_or_position:
        return (
            "turn position_mm along x (it rises to the right), or force_n and the skin's "
            "sensor, which agree"
        )
    if force_or_position:
        return (
            "turn force_n along x, or position_mm along x, or take off what the force sensor "
            "reports at rest"
        )
    return "turn the skin's sensor or position_mm along x" if skin_or_position else None


MOST: Final = 5
"""Participants that a sentence names."""


def judge_trial(
    trial: Trial, study: StudyInfo, observed: TrialObservations | None = None
) -> tuple[Finding, ...]:
    """Return what is implausible about one trial or one long recording.

    Parameters
    ----------
    trial : Trial
        As it was recorded.
    study : StudyInfo
        Its mount, its carrier and its screen voltage are used.
    observed : TrialObservations or None
        Of the trial, where they are known; of a trial without tones they should hold the rows
        from cross-spectra, or nothing is said of its mobility.
    """
    course = course_of(trial)
    if observed is None:
        observed = observe_along(course, trial, study)
    return judge_study([TrialRecord(observed, statistics_of(trial, study, course))])


def judge_study(
    trials: Sequence[TrialRecord], response: ResponseName | None = None
) -> tuple[Finding, ...]:
    """Return what is implausible about a study, what stops first.

    What concerns fewer than half of the participants is a warning that names them and leaves
    their trials out: the others can be used.

    Parameters
    ----------
    trials : sequence of TrialRecord
        All that could be read, in any order.
    response : {'friction', 'mobility'} or None
        What will be fitted; None: both. Friction alone does not need the skin's sensor: what is
        wrong with that is a warning then.
    """
    people: dict[str, list[TrialRecord]] = defaultdict(list)
    for each in trials:
        people[each.observed.info.participant].append(each)
    turned = [trial for own in people.values() for trial in turned_trials(own)]
    for name, own in people.items():
        people[name] = [one for one in own if one.observed.info.id not in turned]
    pools = {name: Pool.of(people[name]) for name in sorted(people)}
    found = [finding for check in CHECKS if (finding := _judged(check, pools)) is not None]
    if turned:
        found.append(_turned_in(turned))
    told = diagnose(found)
    return without_skin(told) if response == "friction" else told


def _turned_in(trials: Sequence[str]) -> Finding:
    return Finding(
        "friction_turned",
        "warning",
        "the lateral force is against the motion, unlike in the participant's other trials: "
        f"{', '.join(trials[:MOST])}{' and others' if len(trials) > MOST else ''} "
        f"({len(trials)} in all); accepted: 0",
        "turn force_n or position_mm along x in these trials, which are left out",
        tuple(trials),
        float(len(trials)),
        (0.0, 0.0),
        leaves_out=True,
    )


def _judged(check: Check, pools: dict[str, Pool]) -> Finding | None:
    values = {name: check.statistic(pool) for name, pool in pools.items()}
    off = {name: value for name, value in values.items() if not check.passes(value)}
    if not off:
        return None
    known = sum(not np.isnan(value) for value in values.values())
    value = float(np.median(list(off.values())))
    sentence = check.told(value)
    few = 2 * len(off) < known
    if len(off) < known:
        named = ", ".join(list(off)[:MOST]) + (" and others" if len(off) > MOST else "")
        sentence = f"of {named}: {sentence}"
    low, high = check.accepted
    return Finding(
        check.code,
        "warning" if few else check.severity,
        f"{sentence}; accepted: {range_text(low, high)}",
        check.advice(value),
        tuple(trial.observed.info.id for name in off for trial in pools[name].trials),
        value,
        check.accepted,
        leaves_out=few and check.severity == "stop",
    )


def range_text(low: float, high: float) -> str:
    """Return an accepted range in words."""
    if np.isinf(high):
        return f"{low:.3g} and more"
    return f"{low:.3g} to {high:.3g}"

"""From trials to findings: each participant is judged from all of their trials together."""

from collections import defaultdict
from collections.abc import Sequence
from typing import Final

import numpy as np

from frictus_service.identification.observation.observe import course_of, observe_along
from frictus_service.identification.observation.response import TrialObservations
from frictus_service.identification.plausibility.checks import CHECKS, Check
from frictus_service.identification.plausibility.diagnosis import diagnose, without_skin
from frictus_service.identification.plausibility.finding import Finding
from frictus_service.identification.plausibility.pool import Pool, ResponseName, TrialRecord
from frictus_service.identification.plausibility.trial_statistics import statistics_of
from frictus_service.study.trial import StudyInfo, Trial

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
    pools = {name: Pool.of(people[name]) for name in sorted(people)}
    found = [finding for check in CHECKS if (finding := _judged(check, pools)) is not None]
    told = diagnose(found)
    return without_skin(told) if response == "friction" else told


def _judged(check: Check, pools: dict[str, Pool]) -> Finding | None:
    values = {name: check.statistic(pool) for name, pool in pools.items()}
    off = {name: value for name, value in values.items() if not check.passes(value)}
    if not off:
        return None
    known = sum(not np.isnan(value) for value in values.values())
    value = float(np.median(list(off.values())))
    sentence = check.sentence.format(value=value)
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

"""Positions that come late: by how much, and whether it is the touch sensor that delays them.

A touch sensor is late by the same time at every speed and with every finger. What else makes
positions follow the nail is not: the pad stays behind where a stroke turns until the skin is
stretched, by a length, and so for a time that is the longer the slower the finger is.
"""

from collections import defaultdict
from collections.abc import Sequence
from typing import Final

import numpy as np

from frictus_service.identification.plausibility.judge import judge_study
from frictus_service.identification.plausibility.pool import TrialRecord

LEAST_TRIALS: Final = 12
"""That tell a delay."""
SAME_S: Final = 5e-3
"""Within which delays are one; of a trial's own, a quarter is off by 1 to 3 ms."""
LEAST_SPEED_RATIO: Final = 1.25
"""Of the faster half of the trials to the slower one, by their medians."""
MOST_OTHERS: Final = 0.25
"""Share of the participants whose delay may be another one: of few trials each."""
STEP_S: Final = 1e-4
"""To which a delay is rounded: it is known no better."""


def sensor_delay_s(trials: Sequence[TrialRecord]) -> float:
    """Return by how much the touch sensor of a study is late; 0 where that cannot be said.

    Parameters
    ----------
    trials : sequence of TrialRecord
        All that could be read, in any order.

    Returns
    -------
    float
        In s, to 0.1 ms; negative where positions come early. 0 where the check `position_delay`
        accepts it or another finding explains it, and where friction and the skin's sensor,
        people, or slow and fast trials, do not show the same.
    """
    found_s = []
    for source in ("late_by_friction_s", "late_by_skin_s"):
        told = [each for each in trials if np.isfinite(_late_s(each, source))]
        if len(told) < LEAST_TRIALS:
            continue
        late_s = float(np.median([_late_s(each, source) for each in told]))
        if source == "late_by_friction_s" and late_s < 0.0:
            continue  # as rests at turns make it
        found_s.append(late_s if _is_of_sensor(told, source, late_s) else 0.0)
    if not found_s or abs(found_s[0] - found_s[-1]) > SAME_S or not any(found_s):
        return 0.0
    if not any(each.code == "position_delay" for each in judge_study(trials)):
        return 0.0
    return round(found_s[0] / STEP_S) * STEP_S


def _late_s(trial: TrialRecord, source: str) -> float:
    return float(getattr(trial.statistics, source))


def _is_of_sensor(trials: Sequence[TrialRecord], source: str, usual_s: float) -> bool:
    """Return whether a delay is that of most people, and of slow and fast trials."""
    of_person: dict[str, list[float]] = defaultdict(list)
    for each in trials:
        of_person[each.observed.info.participant].append(_late_s(each, source))
    people_s = np.array([np.median(own) for own in of_person.values()])
    if np.mean(np.abs(people_s - usual_s) > SAME_S) > MOST_OTHERS:
        return False
    swept = [each for each in trials if np.isfinite(each.observed.mean_speed_mm_s)]
    swept.sort(key=lambda each: each.observed.mean_speed_mm_s)
    half = len(swept) // 2
    if not half:
        return False
    slower_s, faster_s = (
        float(np.median([_late_s(each, source) for each in part]))
        for part in (swept[:half], swept[half:])
    )
    slower_mm_s, faster_mm_s = (
        float(np.median([each.observed.mean_speed_mm_s for each in part]))
        for part in (swept[:half], swept[half:])
    )
    alike = abs(faster_s - slower_s) <= SAME_S
    return alike and faster_mm_s >= LEAST_SPEED_RATIO * slower_mm_s

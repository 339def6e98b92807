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
        accepts it or another finding explains it, and where people, or slow and fast trials, do
        not show the same.
    """
    late_s = np.array([each.statistics.positions_late_s for each in trials])
    speed = np.array([each.observed.mean_speed_mm_s for each in trials])
    known = np.isfinite(late_s) & np.isfinite(speed)
    if np.count_nonzero(known) < LEAST_TRIALS:
        return 0.0
    if not any(each.code == "position_delay" for each in judge_study(trials)):
        return 0.0
    of_person: dict[str, list[float]] = defaultdict(list)
    for each, told in zip(trials, known.tolist(), strict=True):
        if told:
            of_person[each.observed.info.participant].append(each.statistics.positions_late_s)
    late_s, speed = late_s[known], speed[known]
    usual_s = float(np.median(late_s))
    people_s = np.array([np.median(own) for own in of_person.values()])
    others = float(np.mean(np.abs(people_s - usual_s) > SAME_S))
    slow, fast = np.array_split(np.argsort(speed, kind="stable"), 2)
    slower_s, faster_s = float(np.median(late_s[slow])), float(np.median(late_s[fast]))
    one_speed = np.median(speed[fast]) < LEAST_SPEED_RATIO * np.median(speed[slow])
    if one_speed or abs(slower_s - faster_s) > SAME_S or others > MOST_OTHERS:
        return 0.0
    return round(usual_s / STEP_S) * STEP_S

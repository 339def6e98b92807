"""Positions that come late: by how much, and whether it is the touch sensor that delays them.

A touch sensor is late by the same time at every speed and with every finger. What else makes
positions follow the nail is not: the pad stays behind where a stroke turns until the skin is
stretched, by a length, and so for a time that is the longer the slower the finger is.
"""

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from frictus_hardware.arrays import FloatArray
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
    people = np.array([each.observed.info.participant for each in trials])
    speed_mm_s = np.array([each.observed.mean_speed_mm_s for each in trials])
    found_s = []
    for source in ("late_by_friction_s", "late_by_skin_s"):
        late_s = np.array([getattr(each.statistics, source) for each in trials])
        told = np.isfinite(late_s)
        if np.count_nonzero(told) < LEAST_TRIALS:
            continue
        usual_s = float(np.median(late_s[told]))
        if source == "late_by_friction_s" and usual_s < 0.0:
            continue  # as rests at turns make it
        is_sensors = _is_of_sensor(late_s[told], people[told], speed_mm_s[told])
        found_s.append(usual_s if is_sensors else 0.0)
    if not found_s or abs(found_s[0] - found_s[-1]) > SAME_S or not any(found_s):
        return 0.0
    if not any(each.code == "position_delay" for each in judge_study(trials)):
        return 0.0
    return round(found_s[0] / STEP_S) * STEP_S


def _is_of_sensor(late_s: FloatArray, people: NDArray[np.str_], speed_mm_s: FloatArray) -> bool:
    """Return whether a delay is that of most people, and of slow and fast trials.

    Parameters
    ----------
    late_s, people, speed_mm_s : ndarray, shape (n_trials,)
        Delay, participant and mean speed of each trial; NaN where there was no sweep.
    """
    people_s = np.array([np.median(late_s[people == name]) for name in np.unique(people)])
    if np.mean(np.abs(people_s - np.median(late_s)) > SAME_S) > MOST_OTHERS:
        return False
    swept = np.flatnonzero(np.isfinite(speed_mm_s))
    if swept.size < 2:
        return False
    swept = swept[np.argsort(speed_mm_s[swept], kind="stable")]
    halves = np.split(swept, [swept.size // 2])
    slower_s, faster_s = (np.median(late_s[half]) for half in halves)
    slower_mm_s, faster_mm_s = (np.median(speed_mm_s[half]) for half in halves)
    alike = abs(faster_s - slower_s) <= SAME_S
    return bool(alike and faster_mm_s >= LEAST_SPEED_RATIO * slower_mm_s)


def delay_text(late_s: float) -> str:
    """Return a delay in words, such as ``35.2 ms late``.

    Parameters
    ----------
    late_s : float
        In s; negative is early.
    """
    return f"{1e3 * abs(late_s):.1f} ms {'late' if late_s >= 0.0 else 'early'}"

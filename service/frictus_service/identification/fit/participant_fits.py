"""Each participant is fitted alone, with a delay and a scatter of trials of their own.

With a scatter that all share, one participant whose trials contradict each other (another
screen, a channel that is late in some) makes everybody's phases count for nothing: cutoffs of
the others came out up to 37 % wrong, and their intervals 20 times as wide.
"""

from dataclasses import replace
from typing import Any, Final

import numpy as np

from frictus_hardware.arrays import FloatArray, IntArray
from frictus_service.identification.fit import joint_fit
from frictus_service.identification.fit.grouped_errors import GroupVariances
from frictus_service.identification.fit.joint_fit import JointFit
from frictus_service.identification.fit.normal_equations import JointFitProblem, Spreads

BY_CONDITION: Final = (
    "log_parameters",
    "settled",
    "covariance",
    "delay_gradient",
    "rival_shift",
)
BY_TRIAL: Final = ("influence", "delay_influence")
BY_PERSON: Final = (
    "delay_s",
    "delay_variance",
    "delay_freedom",
    "freedom",
    "is_clustered",
    "rival_delay_shift_s",
)


def fit_each(
    problem: JointFitProblem, log_parameters: FloatArray, delay_s: FloatArray
) -> JointFit:
    """Fit the conditions of each participant, and return them together.

    Parameters
    ----------
    problem : JointFitProblem
        Law and rows of all participants.
    log_parameters : ndarray, shape (n_conditions, p)
        Where to begin.
    delay_s : ndarray, shape (n_people,)
        Where to begin.

    Returns
    -------
    JointFit
        Its scatter is the median of the participants', its `rival_deficit` the least of theirs.
    """
    sample = problem.sample
    alone = {
        person: joint_fit.fit(
            replace(problem, sample=sample.of_person(person)),
            log_parameters[sample.people == person],
            delay_s[[person]],
        )
        for person in np.unique(sample.people).tolist()
    }
    owners = {
        **dict.fromkeys(BY_CONDITION, sample.people),
        **dict.fromkeys(BY_TRIAL, sample.people[sample.condition_of_trial]),
        **dict.fromkeys(BY_PERSON, np.arange(delay_s.size)),
    }
    columns = {name: _column(alone, name, owner) for name, owner in owners.items()}
    least = min(own.rival_deficit for own in alone.values())
    return JointFit(**columns, spreads=_median_spreads(alone), rival_deficit=least)


def _column(alone: dict[int, JointFit], name: str, owner: IntArray) -> Any:
    """Return a field of all fits, each where it belongs; 0 of whom nothing is known."""
    parts = {person: getattr(own, name) for person, own in alone.items()}
    first = next(iter(parts.values()))
    out = np.zeros((owner.size, *first.shape[1:]), first.dtype)
    for person, part in parts.items():
        out[owner == person] = part
    return out


def _median_spreads(alone: dict[int, JointFit]) -> Spreads:
    def median(part: str, level: str) -> float:
        own = [getattr(getattr(each.spreads, part), level) for each in alone.values()]
        return float(np.median(own))

    size, phase = (
        GroupVariances(median(part, "inner"), median(part, "outer"))
        for part in ("size", "phase")
    )
    return Spreads(size, phase)

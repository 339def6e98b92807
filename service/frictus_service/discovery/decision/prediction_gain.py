"""How much better the extended model predicts what was not used to fit it."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from scipy import stats

from frictus_hardware.arrays import FloatArray
from frictus_service.discovery.document import Covariate, Gain, UnseenCondition
from frictus_service.discovery.evidence.evidence_rows import Subject, part_of
from frictus_service.discovery.evidence.residuals import Compared
from frictus_service.discovery.inference.linear_model import joint, mean_of_known
from frictus_service.discovery.inference.linearisation import Linearised, linearise
from frictus_service.discovery.inference.nuisance_refit import (
    refit_nuisance,
    with_refitted_nuisance,
)
from frictus_service.discovery.problem.problem import DiscoveryProblem

DB: Final = 20.0 / np.log(10.0)
DEGREES: Final = 180.0 / np.pi


def gain_of(
    problem: DiscoveryProblem,
    per_unit: FloatArray,
    before: tuple[Linearised, Sequence[int]],
    after: tuple[Linearised, Sequence[int]],
) -> Gain:
    """Return a gain as the document says it.

    Parameters
    ----------
    problem : DiscoveryProblem
        Data, base model and candidates.
    per_unit : ndarray, shape (n_units,)
        Held-out log-likelihood.
    before, after : tuple of Linearised and sequence of int
        Models and the effects in them.
    """
    total, n = float(per_unit.sum()), per_unit.size
    interval = None
    if n > 1:
        half = float(stats.t.ppf(0.975, n - 1)) * float(np.std(per_unit, ddof=1)) * np.sqrt(n)
        interval = (total - half, total + half)
    less, more = (rms_of(held_out(problem, *model)) for model in (before, after))
    return Gain(
        heldout_loglik=total,
        ci95=interval,
        residual_db=(less[0], more[0]),
        residual_deg=(less[1], more[1]),
    )


def held_out(
    problem: DiscoveryProblem, model: Linearised, effects: Sequence[int]
) -> list[Compared]:
    """Return what each unit's measurement is less its prediction.

    The coefficients of effects are the other units'; gain and cutoff are its own, fitted beside
    those coefficients.

    Parameters
    ----------
    problem : DiscoveryProblem
        Data, base model and candidates.
    model : Linearised
        A fitted model with the units about it.
    effects : sequence of int
        Numbers of candidates.
    """
    found = joint([unit.only(effects) for unit in model.units], range(len(effects)))
    others = np.array(
        [mean_of_known(np.delete(found, place, axis=0)) for place in range(len(found))]
    )
    fitted = refit_nuisance(problem, model, effects, others)
    return [
        problem.rest(subject, own, effects, row)
        for subject, own, row in zip(problem.subjects, fitted, others, strict=True)
    ]


def rms_of(rests: Sequence[Compared]) -> tuple[float, float]:
    """Return the RMS of what is left in size, dB, and in phase, degrees."""
    size = np.concatenate([rest.size for rest in rests])
    phase = np.concatenate([rest.phase for rest in rests])
    return (
        DB * float(np.sqrt(np.mean(np.square(size)))),
        DEGREES * float(np.sqrt(np.mean(np.square(phase)))),
    )


def unseen(problem: DiscoveryProblem, effects: Sequence[int]) -> list[UnseenCondition]:
    """Return how a speed and a force are predicted that nothing was fitted to.

    Parameters
    ----------
    problem : DiscoveryProblem
        Data, base model and candidates.
    effects : sequence of int
        Of the extended model.
    """
    found = []
    covariates: tuple[Covariate, ...] = ("speed", "force")
    for covariate in covariates:
        level = _middle(problem, covariate)
        if level is None:
            continue
        kept, left = _split(problem, covariate, level)
        scores = []
        for chosen in ((), tuple(effects)):
            model = with_refitted_nuisance(
                kept, linearise(kept, chosen, wanted=(), patterns=())
            )
            rests = [
                left.rest(subject, own, chosen, row)
                for subject, own, row in zip(
                    left.subjects, model.own, model.coefficients, strict=True
                )
            ]
            scores.append(rms_of(rests))
        (db, deg), (less_db, less_deg) = scores
        found.append(
            UnseenCondition(
                covariate=covariate,
                level=level,
                residual_db=(db, less_db),
                residual_deg=(deg, less_deg),
            )
        )
    return found


def targets_of(subject: Subject, covariate: str) -> FloatArray:
    """Return the target speed or force of each trial."""
    return subject.target_mm_s if covariate == "speed" else subject.target_n


def _middle(problem: DiscoveryProblem, covariate: str) -> float | None:
    """Return the middle level at which all show the response, None with fewer than three."""
    levels = [
        set(targets_of(subject, covariate)[np.unique(subject.trial)].tolist())
        for subject in problem.subjects
    ]
    shared = sorted(set.intersection(*levels))
    return float(shared[len(shared) // 2]) if len(shared) > 2 else None


def _split(
    problem: DiscoveryProblem, covariate: str, level: float
) -> tuple[DiscoveryProblem, DiscoveryProblem]:
    parts = []
    for inside in (False, True):
        subjects = tuple(
            part_of(subject, (targets_of(subject, covariate) == level) == inside)
            for subject in problem.subjects
        )
        parts.append(replace(problem, subjects=subjects))
    return parts[0], parts[1]

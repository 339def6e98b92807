"""How much better the extended model predicts what it was not fitted to, and what it leaves.

Likewise what it would cost to take another cause in the place of one that is named.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy import stats

from frictus_hardware.arrays import FloatArray
from frictus_service.discovery.document import Covariate, Gain, RivalCost, UnseenCondition
from frictus_service.discovery.evidence.evidence_rows import Subject, part_of
from frictus_service.discovery.evidence.residuals import Compared
from frictus_service.discovery.inference.linear_model import (
    Unit,
    held_out_gain,
    joint,
    mean_of_known,
    project_out,
)
from frictus_service.discovery.inference.linearisation import Linearised, columns_of, linearise
from frictus_service.discovery.inference.predictive_density import UnitCoefficients
from frictus_service.discovery.inference.selection import (
    refit_nuisance,
    select,
    with_refitted_nuisance,
)
from frictus_service.discovery.problem.candidates import Candidate, Pattern
from frictus_service.discovery.problem.problem import DiscoveryProblem

OMNIBUS: Final = 0.025
"""Family-wise, of all patterns: noticing something unknown in nothing is a false alarm too. Six
units cannot reach it: theirs is the smallest p there is, 0.031."""
MOST_PATTERNS: Final = 6
MOST_RIVALS: Final = 4
HALF: Final = 0.5
"""Of the largest misfit at any tone: where it is."""


@dataclass(frozen=True, slots=True)
class UnexplainedPattern:
    """Something reproducible that no cause in the model accounts for.

    Attributes
    ----------
    pattern : Pattern
        Channel, tones and covariate.
    number : int
        Of the pattern.
    tones : tuple of int
        Where it is largest; empty where the channel has none.
    p_value : float
        Family-wise, over all patterns.
    gain : ndarray, shape (n_units,)
        Held-out, beside the residues before it.
    mean : float
        Coefficient of the pattern, over units, beside all other residues.
    """

    pattern: Pattern
    number: int
    tones: tuple[int, ...]
    p_value: float
    gain: FloatArray
    mean: float


def find_unexplained(
    problem: DiscoveryProblem, model: Linearised, units: Sequence[Unit], flips: FloatArray
) -> list[UnexplainedPattern]:
    """Return the patterns that a model leaves, strongest first, each beside those before.

    Parameters
    ----------
    problem : DiscoveryProblem
        Data, base model and candidates.
    model : Linearised
        A fitted model with the units about it.
    units : sequence of Unit
        About the model; their effects are the patterns, all that is known is their own.
    flips : ndarray
        Shape (n_flips, n_units), of `signs`.
    """
    level = max(OMNIBUS, 2.0 / len(flips))
    found = select(lambda chosen: units, flips, level, most=MOST_PATTERNS).effects
    means = mean_of_known(joint(units, found))
    unexplained = []
    for place, pattern in enumerate(found):
        left = project_out(units, found[:place])
        unexplained.append(
            UnexplainedPattern(
                problem.patterns[pattern],
                pattern,
                _largest_at(problem, model, units, problem.patterns[pattern]),
                float(left.significance(flips).p[pattern]),
                held_out_gain(left)[:, pattern],
                float(means[place]),
            )
        )
    return unexplained


def _largest_at(
    problem: DiscoveryProblem, model: Linearised, units: Sequence[Unit], found: Pattern
) -> tuple[int, ...]:
    """Return the tones at which a misfit of this kind is half as large as anywhere, at least.

    Size and phase are taken together: a resonance turns the phase far from where it is.
    """
    if found.channel not in ("size", "phase"):
        return found.tones
    tones = sorted({tone for subject in problem.subjects for tone in subject.tone.tolist()})
    alone = [
        Pattern(channel, (tone,), found.covariate, found.form)
        for channel in ("size", "phase")
        for tone in tones
    ]
    columns = columns_of(
        problem, model, lambda unit: [each.of(problem.subjects[unit]) for each in alone]
    )
    bare = [
        unit.looking_for(effects, accuracy)
        for unit, (effects, accuracy) in zip(units, columns, strict=True)
    ]
    mean = mean_of_known(project_out(bare).estimates)
    size, phase = np.split(mean, 2)
    misfit = np.hypot(size, phase)
    return tuple(
        tone for tone, m in zip(tones, misfit, strict=True) if m >= HALF * misfit.max()
    )


DB: Final = 20.0 / np.log(10.0)
DEGREES: Final = 180.0 / np.pi


def gain_of(
    problem: DiscoveryProblem,
    found: UnitCoefficients,
    before: tuple[Linearised, Sequence[int]],
    after: tuple[Linearised, Sequence[int]],
    rng: np.random.Generator,
) -> Gain:
    """Return a gain as the document says it.

    Parameters
    ----------
    problem : DiscoveryProblem
        Data, base model and candidates.
    found : UnitCoefficients
        Of the effects whose gain it is.
    before, after : tuple of Linearised and sequence of int
        Models and the effects in them.
    rng : numpy.random.Generator
        Of the interval.
    """
    less, more = (rms_of(held_out(problem, *model)) for model in (before, after))
    telling = int(np.isfinite(found.value).any(axis=1).sum())  # the others gain nothing
    return Gain(
        heldout_loglik=float(found.held_out.sum()),
        ci95=found.interval_of_another(telling, rng),
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


def rival_costs(
    units: Sequence[Unit], candidates: Sequence[Candidate], named: int, others: Sequence[int]
) -> tuple[RivalCost, ...]:
    """Return the causes that would do best in a named one's place, the cheapest first.

    Of each cause the candidate that predicts held-out units best, to first order about the
    extended model and beside the other causes; its cost is what the named one predicts better,
    by unit.

    Parameters
    ----------
    units : sequence of Unit
        About the extended model.
    candidates : sequence of Candidate
        What the effects of the units are.
    named : int
        Number of the candidate whose place it is.
    others : sequence of int
        Candidates that stay in the model.
    """
    gain = held_out_gain(project_out(units, others))
    own, total = gain[:, named], gain.sum(axis=0)
    taken = {candidates[k].effect for k in (named, *others)}
    best: dict[str, int] = {}
    for k in np.argsort(-total).tolist():
        if candidates[k].effect not in taken and total[k] != 0.0:
            best.setdefault(candidates[k].effect, k)
    costs = []
    for name, k in list(best.items())[:MOST_RIVALS]:
        cost = own - gain[:, k]
        half = float(stats.t.ppf(0.975, cost.size - 1)) * float(stats.sem(cost))
        mean = float(cost.mean())
        costs.append(
            RivalCost(
                id=name,
                nats_per_unit=float(gain[:, k].mean()),
                cost=mean,
                ci95=(mean - half, mean + half),
            )
        )
    return tuple(costs)

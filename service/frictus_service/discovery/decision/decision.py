"""Which causes a model has, and what may be said of them."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from frictus_hardware.arrays import FloatArray
from frictus_service.discovery.decision.naming import (
    RIGHT_FAMILY,
    CauseDecision,
    SaidOfModel,
    of_family,
    say,
)
from frictus_service.discovery.decision.prediction_gain import (
    UnexplainedPattern,
)
from frictus_service.discovery.inference.joint_gain import joint_gain
from frictus_service.discovery.inference.linear_model import project_out
from frictus_service.discovery.inference.linearisation import (
    Linearised,
    linearise,
    misfit,
)
from frictus_service.discovery.inference.mode_fit import (
    fit_mode,
    likeliest_beside,
    modes_of,
    starts_of,
)
from frictus_service.discovery.inference.mode_shape import mode_in
from frictus_service.discovery.inference.selection import Selected, select
from frictus_service.discovery.inference.significance import Significance
from frictus_service.discovery.problem.problem import DiscoveryProblem
from frictus_service.identification.inference.statistics import mean_of

NAMING: Final = 0.05
"""Family-wise, of all causes of the catalogue."""
CLEARLY_BETTER: Final = 10.0
"""Sum of squares by which a cause must leave less than one that it replaces."""
ATTEMPTS: Final = 4
MODE_FITS: Final = 3
"""Of a mode: beside the causes selected with it, and up to two more."""


@dataclass(frozen=True, slots=True)
class Decision:
    """All that a discovery found.

    Attributes
    ----------
    problem : DiscoveryProblem
        In which a mode of the skin is where it was fitted.
    named : tuple of CauseDecision
        The causes, strongest first.
    unexplained : tuple of UnexplainedPattern
        What the causes leave, strongest first.
    base, extended : Linearised
        Fitted without causes, and with all of them.
    first : Significance
        Of all candidates about the base model.
    effects : tuple of int
        Candidates in the extended model.
    explained_share : float
        By the causes that extend the model.
    accuracy : ndarray, shape (n_candidates,)
        Coefficient at which each shows as much as measuring is accurate, about the base.
    """

    problem: DiscoveryProblem
    named: tuple[CauseDecision, ...]
    unexplained: tuple[UnexplainedPattern, ...]
    base: Linearised
    extended: Linearised
    first: Significance
    effects: tuple[int, ...]
    explained_share: float
    accuracy: FloatArray


def decide(problem: DiscoveryProblem, flips: FloatArray) -> Decision:
    """Select causes, look for what they leave, and drop those that explain too little.

    Parameters
    ----------
    problem : DiscoveryProblem
        Data, base model and candidates.
    flips : ndarray, shape (n_flips, n_units)
    """
    kinds = [candidate.effect for candidate in problem.candidates]
    problem, about, begin, banned = _with_fitted_mode(problem, flips, kinds)
    base = about(())
    for _ in range(ATTEMPTS):
        selected = _selected(about, flips, kinds, begin, banned)
        model = about(selected.effects)
        said = say(problem, base, model, flips)
        better = _better_of_like(problem, model, said.named, banned, about)
        if better != model.chosen:
            model = about(better)
            said = say(problem, base, model, flips)
        weak = untenable(problem, said)
        if not weak:
            break
        banned |= weak
    else:  # those that stood are named if they stand by themselves, or none is
        for effects in (tuple(k for k in model.chosen if k not in weak), ()):
            model = about(effects)
            said = say(problem, base, model, flips)
            if not untenable(problem, said):
                break
    named = list(said.named)
    extending = [each.candidate for each in named if each.in_model and not each.alike]
    if said.beyond_forms:
        named += of_family(said, set(model.chosen))
    explained, whole = (
        float(joint_gain(model.units, effects).sum()) for effects in (extending, model.chosen)
    )
    left = max(whole - explained, 0.0) + sum(
        float(each.gain.sum()) for each in said.unexplained
    )
    return Decision(
        problem=problem,
        named=tuple(named),
        unexplained=said.unexplained,
        base=base,
        extended=model,
        first=selected.first,
        effects=model.chosen,
        explained_share=explained / (explained + left) if explained + left > 0.0 else 1.0,
        accuracy=project_out(base.units).accuracy,
    )


Models = Callable[[Sequence[int]], Linearised]
"""From chosen candidates to the model fitted with them."""


def _with_fitted_mode(
    problem: DiscoveryProblem, flips: FloatArray, kinds: Sequence[str]
) -> tuple[DiscoveryProblem, Models, tuple[int, ...], set[int]]:
    """Return the problem with a mode fitted, its models, the mode, other modes.

    It is one that is significant, or else the likeliest cause of all. The fit begins beside
    the causes that were selected with the mode. Some of them may only stand in for what a mode
    in the wrong place leaves; all are selected anew beside it.
    Then it goes on beside what makes the readings likelier. Near the first mode the base model
    bends mass and stiffness so far that the fitted one does not show about it: it was seen
    already, and is judged about the model that has it.
    """
    about = _models_of(problem)
    first = _selected(about, flips, kinds).effects
    modes = modes_of(problem)
    mode = mode_in(problem.candidates, first)
    if mode is None and modes:
        mode = likeliest_beside(problem, about(first), first)
    if mode not in modes:
        return problem, about, (), set()
    rest = {each for each in modes if each != mode}
    others = tuple(each for each in first if each != mode)
    starts = starts_of(problem)
    for _ in range(MODE_FITS):
        problem = fit_mode(problem, about(()), starts, mode, others)
        about = _models_of(problem, about(()))
        more = likeliest_beside(problem, about(()), (mode, *others))
        if more is None:
            break
        starts, others = [problem.candidates[mode]], (*others, more)
    return problem, about, (mode,), rest


def _selected(
    about: Models,
    flips: FloatArray,
    kinds: Sequence[str],
    begin: Sequence[int] = (),
    banned: Collection[int] = (),
) -> Selected:
    """Return the causes, beside those to begin with that are not banned."""
    return select(
        lambda chosen: about(chosen).units,
        flips,
        NAMING,
        banned,
        kinds=kinds,
        begin=[each for each in begin if each not in banned],
    )


def _models_of(problem: DiscoveryProblem, start: Linearised | None = None) -> Models:
    """Return what fits a model with chosen candidates, each once."""
    known: dict[tuple[int, ...], Linearised] = {}

    def about(chosen: Sequence[int]) -> Linearised:
        key = tuple(chosen)
        if key not in known:
            known[key] = linearise(problem, key, start=known.get((), start))
        return known[key]

    return about


def _better_of_like(
    problem: DiscoveryProblem,
    model: Linearised,
    named: Sequence[CauseDecision],
    banned: Collection[int],
    about: Models,
) -> tuple[int, ...]:
    """Return the causes; one whose form does not fit gives way to one like it that fits better.

    Where effects are large, causes whose signatures are alike differ by more than signatures.
    """
    chosen = list(model.chosen)
    for each in named:
        if each.verdict == "confirmed" or each.candidate not in chosen:
            continue
        place = chosen.index(each.candidate)
        effect = problem.candidates[each.candidate].effect
        same = [k for k, other in enumerate(problem.candidates) if other.effect == effect]
        like = [k for k in (*_numbers(each.alike, each.near), *same) if k not in banned]
        tried = [(*chosen[:place], k, *chosen[place + 1 :]) for k in like if k not in chosen]
        left = {effects: misfit(problem, about(effects), model) for effects in tried}
        best = min(left, key=lambda effects: left[effects], default=None)
        now = misfit(problem, about(tuple(chosen)), model)
        if best is not None and left[best] < now - CLEARLY_BETTER:
            chosen = list(best)
    return tuple(chosen)


def _numbers(*found: Sequence[tuple[int, float]]) -> list[int]:
    return [candidate for each in found for candidate, _ in each]


def untenable(problem: DiscoveryProblem, said: "SaidOfModel") -> set[int]:
    """Return causes that explain too little in their place, show no longer, or cannot be.

    Parameters
    ----------
    problem : DiscoveryProblem
        Candidates, with what their parameters can be.
    said : SaidOfModel
        What is said of a model.
    """
    return {
        each.candidate
        for each in said.named
        if each.share < RIGHT_FAMILY
        or not each.p_value <= NAMING  # NaN: nobody says anything of it beside the others
        or _torn(each)
        or _impossible(problem, each)
    }


def _impossible(problem: DiscoveryProblem, each: CauseDecision) -> bool:
    """Return whether all of a cause's interval lies beyond twice what is accepted of it.

    What is a little beyond is told, and accepted as far as it goes. Of a signature that is
    nearly a person's own gain so little is left that something else, within the accuracy of
    the measurement, is told as many times what is accepted.
    """
    known = each.coefficients[np.isfinite(each.coefficients)]
    ci95 = mean_of(known).ci95 if known.size else None
    if ci95 is None:
        return False
    (low,), (high,) = problem.limits([each.candidate])
    return bool(ci95[0] > 2.0 * high or ci95[1] < 2.0 * low)


def _torn(each: CauseDecision) -> bool:
    """Return whether a cause that is not told from another leaves something in its place."""
    return bool(each.alike) and each.left

"""Which causes the readings ask for, and own parameters fitted beside what they hold."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from frictus_hardware.arrays import FloatArray
from frictus_service.discovery.evidence.evidence_rows import Subject
from frictus_service.discovery.evidence.residuals import reduce
from frictus_service.discovery.inference.linear_model import Unit, held_out_gain, project_out
from frictus_service.discovery.inference.linearisation import MOST_CHANGE, SETTLED, Linearised
from frictus_service.discovery.inference.significance import Significance
from frictus_service.discovery.problem.problem import NUISANCE_STEP, DiscoveryProblem

ROUNDS: Final = 6
"""Of Gauss-Newton at most; with two or three parameters, three do."""


def refit_nuisance(
    problem: DiscoveryProblem,
    model: Linearised,
    effects: Sequence[int],
    coefficients: FloatArray,
) -> FloatArray:
    """Return the own parameters with which a model predicts best.

    Those of the model itself were fitted beside random effects, which no prediction holds:
    they would be right at 60 mm/s and 0.4 N, and nothing would be fitted to where a study was.

    Parameters
    ----------
    problem : DiscoveryProblem
        Data, base model and candidates.
    model : Linearised
        From which the fit begins, and by which readings are weighted.
    effects : sequence of int
        Numbers of candidates.
    coefficients : ndarray, shape (n_units, n_effects)

    Returns
    -------
    ndarray, shape (n_units, n_own)
    """
    return np.array(
        [
            _fitted(problem, subject, own, whitening.weight, effects, row)
            for subject, own, whitening, row in zip(
                problem.subjects, model.own, model.whitenings, coefficients, strict=True
            )
        ]
    )


def _fitted(
    problem: DiscoveryProblem,
    subject: Subject,
    own: FloatArray,
    weight: FloatArray,
    effects: Sequence[int],
    coefficients: FloatArray,
) -> FloatArray:
    """Return the own parameters that leave the least of a subject's readings."""

    def left(own: FloatArray) -> FloatArray:
        return weight * reduce(
            subject.layout, problem.rest(subject, own, effects, coefficients)
        )

    for _ in range(ROUNDS):
        here = left(own)
        slopes = [
            (here - left(own + step)) / NUISANCE_STEP
            for step in NUISANCE_STEP * np.eye(own.size)
        ]
        step = np.linalg.lstsq(np.column_stack(slopes), here, rcond=None)[0]
        own = own + np.clip(step, -MOST_CHANGE, MOST_CHANGE)
        if np.all(np.abs(step) < SETTLED):
            break
    return own


def with_refitted_nuisance(problem: DiscoveryProblem, model: Linearised) -> Linearised:
    """Return a model with the own parameters with which it predicts best.

    Parameters
    ----------
    problem : DiscoveryProblem
        Data, base model and candidates.
    model : Linearised
        A fitted model with the units about it.
    """
    return replace(model, own=refit_nuisance(problem, model, model.chosen, model.coefficients))


MOST_CAUSES: Final = 6

Linearise = Callable[[Sequence[int]], Sequence[Unit]]
"""From the effects in the model to the units about the model fitted with them."""


@dataclass(frozen=True, slots=True)
class Selected:
    """The effects that are in the model, and the units about it.

    Attributes
    ----------
    effects : tuple of int
        In the order in which they were chosen.
    units : sequence of Unit
        About the model fitted with all of them.
    first : Significance
        Of all candidates before anything was chosen.
    """

    effects: tuple[int, ...]
    units: Sequence[Unit]
    first: Significance


def select(
    linearise: Linearise,
    flips: FloatArray,
    level: float,
    banned: Collection[int] = (),
    most: int = MOST_CAUSES,
    kinds: Sequence[str] | None = None,
    begin: Sequence[int] = (),
) -> Selected:
    """Choose effects that are significant and predict units that did not set their size.

    Parameters
    ----------
    linearise : callable
        From chosen effects to the units about the model.
    flips : ndarray, shape (n_flips, n_units)
    level : float
        Family-wise, at each step.
    banned : collection of int
        Never chosen.
    most : int
        Chosen at most.
    kinds : sequence of str or None
        Of each effect; of a kind no more than one is chosen. None: all are of their own.
    begin : sequence of int
        Chosen before; what others make needless of them goes, too.
    """
    chosen = list(begin)
    dropped = set(banned)
    first = _significance(linearise([]), [], flips)
    units = linearise(chosen)
    while len(chosen) < most:
        taken = {kinds[effect] for effect in chosen} if kinds else set()
        closed = {k for k, kind in enumerate(kinds or ()) if kind in taken}
        best = _best(units, chosen, dropped | closed, flips, level)
        if best is None:
            break
        chosen.append(best)
        units = linearise(chosen)
        while (worst := _superfluous(units, chosen, flips, level)) is not None:
            chosen.remove(worst)
            dropped.add(worst)  # or it would come and go for ever
            units = linearise(chosen)
    return Selected(tuple(chosen), units, first)


def _significance(
    units: Sequence[Unit], chosen: Sequence[int], flips: FloatArray
) -> Significance:
    left = project_out(units, chosen)
    return left.significance(flips)


def _best(
    units: Sequence[Unit],
    chosen: Sequence[int],
    dropped: set[int],
    flips: FloatArray,
    level: float,
) -> int | None:
    """Return the candidate of the largest held-out gain among the significant."""
    left = project_out(units, chosen)
    found = left.significance(flips)
    gain = held_out_gain(left).sum(axis=0)
    open_to_choice = (found.p <= level) & (gain > 0.0)
    open_to_choice[list(dropped)] = False
    if not open_to_choice.any():
        return None
    return int(np.argmax(np.where(open_to_choice, gain, -np.inf)))


def _superfluous(
    units: Sequence[Unit], chosen: Sequence[int], flips: FloatArray, level: float
) -> int | None:
    """Return the chosen effect that the others make needless, if there is one."""
    if len(chosen) < 2:
        return None
    worst, least = None, 0.0
    for effect in chosen:
        left = project_out(units, [other for other in chosen if other != effect])
        found = left.significance(flips)
        gain = float(held_out_gain(left)[:, effect].sum())
        needed = found.p[effect] <= level and gain > 0.0
        if not needed and (worst is None or gain < least):
            worst, least = effect, gain
    return worst

"""What is said of each cause of a model: confirmed, of a family, not told apart; the rest."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final, Literal

import numpy as np

from frictus_hardware.arrays import FloatArray
from frictus_service.discovery.decision.caveats import (
    explained_by,
    other_forms,
    place_of,
    with_forms,
)
from frictus_service.discovery.decision.prediction_gain import (
    UnexplainedPattern,
    find_unexplained,
)
from frictus_service.discovery.evidence.observation_table import LEAST_UNITS
from frictus_service.discovery.inference.linear_model import (
    Unit,
    held_out_gain,
    project_out,
    similarity,
)
from frictus_service.discovery.inference.linearisation import Linearised
from frictus_service.discovery.inference.units_anew import as_designed, if_alike
from frictus_service.discovery.problem.candidates import Place, places_of
from frictus_service.discovery.problem.problem import DiscoveryProblem

OTHER_FORM: Final = 0.05
"""Of the forms of a cause that is named."""


ALIKE: Final = 0.9
"""Cosine from which two signatures are not told apart."""


RIGHT_FAMILY: Final = 0.6
"""A cause that explains less of what is reproducible in its place is not named."""


CLEARLY: Final = 0.1
"""By which a family must explain more of a misfit than any other."""


@dataclass(frozen=True, slots=True)
class CauseDecision:
    """A cause in the model.

    Attributes
    ----------
    candidate : int
        Number of the candidate.
    verdict : {'confirmed', 'family'}
    p_value : float
        Corrected for all candidates, with the other causes in the model.
    gain : ndarray, shape (n_units,)
        Held-out, with the other causes in the model.
    coefficients : ndarray, shape (n_units,)
        NaN where a unit says nothing.
    share : float
        Of what is reproducible in its place.
    alike : tuple of (int, float)
        Candidates of which this design cannot say whether it is them, with cosines.
    near : tuple of (int, float)
        The same between 0.5 and `ALIKE`.
    left : bool
        Whether something else is reproducible in its place.
    in_model : bool
        Whether the extended model has it; one that the data show in another form only is not.
    """

    candidate: int
    verdict: Literal["confirmed", "family"]
    p_value: float
    gain: FloatArray
    coefficients: FloatArray
    share: float
    alike: tuple[tuple[int, float], ...]
    near: tuple[tuple[int, float], ...]
    left: bool = False
    in_model: bool = True

    @property
    def is_family(self) -> bool:
        """Whether something of its kind is there in another shape."""
        return self.verdict == "family"


def _beside_each_other(residue: UnexplainedPattern, place: Place) -> bool:
    """Return whether a residue lies where an effect shows: in harmonics, whenever it does."""
    kind, covariate = places_of([residue.pattern])[0]
    return kind == place[0] and (kind != "response" or covariate == place[1])


@dataclass(frozen=True)
class ComparedModel:
    """A model as causes are compared by; much of it is only needed where there are causes.

    Attributes
    ----------
    problem : DiscoveryProblem
        Data, base model and candidates.
    base, model : Linearised
        Fitted without causes, and with them.
    """

    problem: DiscoveryProblem
    base: Linearised
    model: Linearised

    @cached_property
    def alike(self) -> Linearised:
        """The model, if people did not differ in its causes."""
        return if_alike(self.problem, self.model)

    @cached_property
    def by(self) -> tuple[tuple[Unit, ...], ...]:
        """As tested first; if people were alike; and as the design alone makes the units.

        The whole of a misfit is in the scatter of the first, none in that of the second.
        """
        return self.base.units, self.alike.units, as_designed(self.problem, self.model)


@dataclass(frozen=True, slots=True)
class SaidOfModel:
    """What is said of a model.

    Attributes
    ----------
    named : tuple of CauseDecision
        The causes, strongest first.
    unexplained : tuple of UnexplainedPattern
        What the causes leave.
    beyond_forms : tuple of UnexplainedPattern
        What is left of that if they may have other forms.
    seen : ComparedModel
        The model that the decision is about.
    """

    named: tuple[CauseDecision, ...]
    unexplained: tuple[UnexplainedPattern, ...]
    beyond_forms: tuple[UnexplainedPattern, ...]
    seen: ComparedModel


def say(
    problem: DiscoveryProblem, base: Linearised, model: Linearised, flips: FloatArray
) -> SaidOfModel:
    """Return what is said of a model: a verdict on each of its causes, and what they leave.

    Parameters
    ----------
    problem : DiscoveryProblem
        Data, base model and candidates.
    base, model : Linearised
        Fitted without causes, and with them.
    flips : ndarray, shape (n_flips, n_units)
        Signs of the units under which significance is judged.
    """
    units = [unit.beyond(model.chosen) for unit in model.units]
    places = {each: place_of(model.units, each, problem.patterns) for each in model.chosen}
    bent = set()
    beyond = units
    for effect, (_, covariate) in places.items():
        forms = other_forms(problem, model, effect, covariate, beside=True)
        left = project_out(with_forms(units, forms))
        seen = left.significance(flips).p <= OTHER_FORM
        if np.any(seen & (held_out_gain(left).sum(axis=0) > 0.0)):
            bent.add(effect)
            beyond = [
                unit.and_own(columns) for unit, (columns, _) in zip(beyond, forms, strict=True)
            ]
    rest = find_unexplained(problem, model, beyond, flips)
    unexplained = find_unexplained(problem, model, units, flips) if bent else rest
    about = ComparedModel(problem, base, model)
    named = [
        _named(effect, about, rest, unexplained, flips, places[effect], effect in bent)
        for effect in model.chosen
    ]
    return SaidOfModel(tuple(named), tuple(unexplained), tuple(rest), about)


def _named(
    effect: int,
    seen: ComparedModel,
    beyond_forms: Sequence[UnexplainedPattern],
    unexplained: Sequence[UnexplainedPattern],
    flips: FloatArray,
    place: Place,
    bent: bool,
) -> CauseDecision:
    model = seen.model
    others = [other for other in model.chosen if other != effect]
    left = project_out(model.units, others)
    gain = held_out_gain(left)[:, effect]
    rest, all_rest = (
        sum(float(each.gain.sum()) for each in found if _beside_each_other(each, place))
        for found in (beyond_forms, unexplained)
    )
    own = float(gain.sum())
    alike, near = _beside(effect, seen)
    return CauseDecision(
        candidate=effect,
        verdict="family" if bent or rest > 0.0 else "confirmed",
        p_value=float(left.significance(flips).p[effect]),
        gain=gain,
        coefficients=left.estimates[:, effect],
        share=_part(own, rest),
        alike=alike,
        near=near,
        left=rest > 0.0,
        in_model=_part(own, all_rest) >= RIGHT_FAMILY,
    )


def _part(own: float, rest: float) -> float:
    return own / (own + rest) if own + rest > 0.0 else 0.0


def _beside(
    effect: int, seen: ComparedModel
) -> tuple[tuple[tuple[int, float], ...], tuple[tuple[int, float], ...]]:
    """Return other causes that look like one, and those that look a little like it."""
    chosen, candidates = seen.model.chosen, seen.problem.candidates
    others = [other for other in chosen if other != effect]
    found = np.array([similarity(units, others)[effect] for units in seen.by])
    cosines = np.take_along_axis(found, np.argmax(np.abs(found), axis=0)[np.newaxis], 0)[0]
    name = candidates[effect].effect
    beside = [
        (int(k), float(cosines[k]))
        for k in np.argsort(-np.abs(cosines))
        if k not in chosen and candidates[k].effect != name
    ]
    return (
        tuple((k, c) for k, c in beside if abs(c) > ALIKE),
        tuple((k, c) for k, c in beside if 0.5 < abs(c) <= ALIKE),
    )


def of_family(said: SaidOfModel, present: set[int]) -> list[CauseDecision]:
    """Return causes that in another form than the catalogue's explain what is left.

    Parameters
    ----------
    said : SaidOfModel
        Of the model that is decided on.
    present : set of int
        Candidates in it.
    """
    problem, model, alike = said.seen.problem, said.seen.model, said.seen.alike
    left = project_out(model.units, model.chosen)
    found = []
    for place in dict.fromkeys(places_of([each.pattern for each in said.beyond_forms])):
        there = [each for each in said.beyond_forms if places_of([each.pattern])[0] == place]
        shares = {
            k: _share(problem, alike, there, k, place)
            for k in range(len(problem.candidates))
            if k not in present
            and np.isfinite(left.estimates[:, k]).sum() >= LEAST_UNITS
            and place_of(alike.units, k, problem.patterns) == place
        }
        best = max(shares, key=lambda k: shares[k], default=None)
        if best is None or shares[best] < RIGHT_FAMILY:
            continue
        if any(shares[k] > shares[best] - CLEARLY for k in shares if k != best):
            continue
        like, near = _beside(best, said.seen)
        found.append(
            CauseDecision(
                candidate=best,
                verdict="family",
                p_value=min(each.p_value for each in there),
                gain=np.sum([each.gain for each in there], axis=0),
                coefficients=left.estimates[:, best],
                share=shares[best],
                alike=like,
                near=near,
                in_model=False,
            )
        )
    return found


def _share(
    problem: DiscoveryProblem,
    model: Linearised,
    unexplained: Sequence[UnexplainedPattern],
    effect: int,
    place: Place,
) -> float:
    """Return the share of what is left that an effect in any of its forms makes up."""
    numbers = [each.number for each in unexplained]
    means = np.array([each.mean for each in unexplained])
    misfit = [unit.generic[:, numbers] @ means for unit in model.units]
    forms = other_forms(problem, model, effect, place[1], beside=False)
    columns = [
        np.column_stack([whole.effects[:, effect], form])
        for whole, (form, _) in zip(model.units, forms, strict=True)
    ]
    units = [unit.beyond(model.chosen) for unit in model.units]
    return explained_by(units, misfit, columns)

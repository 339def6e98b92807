"""What may be said of a model: causes named, or of the family, or not told apart; the rest."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from frictus_service.discovery.families import explained_by, other_forms, place_of, with_forms
from frictus_service.discovery.generic import Place, places_of
from frictus_service.discovery.linearised import Ground, Linearised
from frictus_service.discovery.residues import Residue, residues_of
from frictus_service.discovery.selection import select
from frictus_service.discovery.significance import Significance
from frictus_service.discovery.units import Unit, held_out_gain, leave, similarity

FloatArray = NDArray[np.float64]

NAMING: Final = 0.05
"""Family-wise, of all causes of the catalogue."""
OTHER_FORM: Final = 0.05
"""Of the forms of a cause that is named."""
ALIKE: Final = 0.9
"""Cosine from which two signatures are not told apart."""
RIGHT_FAMILY: Final = 0.6
"""A cause that explains less of what is reproducible in its place is not named."""
CLEARLY: Final = 0.1
"""By which a family must explain more of a misfit than any other."""
CLEARLY_BETTER: Final = 10.0
"""Sum of squares by which a cause must leave less than one that it replaces."""
ATTEMPTS: Final = 4


@dataclass(frozen=True, slots=True)
class Named:
    """A cause in the model.

    Attributes
    ----------
    candidate : int
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
        Whether the extended model has it; one that only another form explains is not in it.
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


@dataclass(frozen=True, slots=True)
class Findings:
    """All that a discovery found.

    Attributes
    ----------
    named : tuple of Named
    residues : tuple of Residue
    base, extended : Linearised
    first : Significance
        Of all candidates about the base model.
    effects : tuple of int
        Candidates in the extended model.
    explained_share : float
    accuracy : ndarray, shape (n_candidates,)
        Coefficient at which each shows as much as measuring is accurate, about the base.
    """

    named: tuple[Named, ...]
    residues: tuple[Residue, ...]
    base: Linearised
    extended: Linearised
    first: Significance
    effects: tuple[int, ...]
    explained_share: float
    accuracy: FloatArray


def find(ground: Ground, flips: FloatArray) -> Findings:
    """Select causes, look for what they leave, and drop those that explain too little.

    Parameters
    ----------
    ground : Ground
    flips : ndarray, shape (n_flips, n_units)
    """
    known: dict[tuple[int, ...], Linearised] = {}

    def linearise(chosen: Sequence[int]) -> Linearised:
        key = tuple(chosen)
        if key not in known:
            known[key] = ground.linearise(key, start=known.get(()))
        return known[key]

    kinds = [candidate.effect for candidate in ground.candidates]
    base = linearise(())
    banned: set[int] = set()
    for _ in range(ATTEMPTS):
        selected = select(
            lambda chosen: linearise(chosen).units, flips, NAMING, banned, kinds=kinds
        )
        model = linearise(selected.effects)
        said = _said(ground, base, model, flips)
        better = _better_of_like(ground, model, said.named, banned, linearise)
        if better != model.chosen:
            model = linearise(better)
            said = _said(ground, base, model, flips)
        weak = {
            each.candidate for each in said.named if each.share < RIGHT_FAMILY or _torn(each)
        }
        if not weak:
            break
        banned |= weak
    named = [each for each in said.named if each.candidate not in weak]
    if said.beyond_forms:
        present = {each.candidate for each in named}
        named += _of_family(ground, base, model, said.beyond_forms, present)
    explained = sum(float(each.gain.sum()) for each in named if each.in_model)
    left = sum(float(each.gain.sum()) for each in said.residues)
    return Findings(
        named=tuple(named),
        residues=said.residues,
        base=base,
        extended=model,
        first=selected.first,
        effects=model.chosen,
        explained_share=explained / (explained + left) if explained + left > 0.0 else 1.0,
        accuracy=np.mean([unit.accuracy for unit in base.units], axis=0),
    )


def _better_of_like(
    ground: Ground,
    model: Linearised,
    named: Sequence[Named],
    banned: Collection[int],
    linearise: Callable[[Sequence[int]], Linearised],
) -> tuple[int, ...]:
    """Return the causes; one whose form does not fit gives way to one like it that fits better.

    Where effects are large, causes whose signatures are alike differ by more than signatures.
    """
    chosen = list(model.chosen)
    for each in named:
        if each.verdict == "confirmed" or each.candidate not in chosen:
            continue
        place = chosen.index(each.candidate)
        effect = ground.candidates[each.candidate].effect
        same = [k for k, other in enumerate(ground.candidates) if other.effect == effect]
        like = [k for k in (*_numbers(each.alike, each.near), *same) if k not in banned]
        tried = [(*chosen[:place], k, *chosen[place + 1 :]) for k in like if k not in chosen]
        misfit = {effects: ground.misfit(linearise(effects), model) for effects in tried}
        best = min(misfit, key=lambda effects: misfit[effects], default=None)
        now = ground.misfit(linearise(tuple(chosen)), model)
        if best is not None and misfit[best] < now - CLEARLY_BETTER:
            chosen = list(best)
    return tuple(chosen)


def _numbers(*found: Sequence[tuple[int, float]]) -> list[int]:
    return [candidate for each in found for candidate, _ in each]


def _torn(each: Named) -> bool:
    """Return whether a cause that is not told from another leaves something in its place."""
    return bool(each.alike) and each.left


def _beside_each_other(residue: Residue, place: Place) -> bool:
    """Return whether a residue lies where an effect shows: in harmonics, whenever it does."""
    kind, covariate = places_of([residue.pattern])[0]
    return kind == place[0] and (kind != "response" or covariate == place[1])


@dataclass(frozen=True, slots=True)
class _Said:
    """Causes in a model; what it leaves; and what their other forms would leave of that."""

    named: tuple[Named, ...]
    residues: tuple[Residue, ...]
    beyond_forms: tuple[Residue, ...]


def _said(ground: Ground, base: Linearised, model: Linearised, flips: FloatArray) -> _Said:
    units = [unit.beyond(model.chosen) for unit in model.units]
    places = {each: place_of(model.units, each, ground.patterns) for each in model.chosen}
    bent = set()
    beyond = units
    for effect, (_, covariate) in places.items():
        forms = other_forms(ground, model, effect, covariate, beside=True)
        left = leave(with_forms(units, forms))
        seen = left.significance(flips).p <= OTHER_FORM
        if np.any(seen & (held_out_gain(left).sum(axis=0) > 0.0)):
            bent.add(effect)
            beyond = [
                unit.and_own(columns) for unit, (columns, _) in zip(beyond, forms, strict=True)
            ]
    rest = residues_of(ground, model, beyond, flips)
    seen_by = _seen_by(ground, base, model) if model.chosen else ()
    named = [
        _named(effect, model, ground, rest, flips, places[effect], effect in bent, seen_by)
        for effect in model.chosen
    ]
    residues = residues_of(ground, model, units, flips) if bent else rest
    return _Said(tuple(named), tuple(residues), tuple(rest))


def _seen_by(ground: Ground, base: Linearised, model: Linearised) -> Sequence[Sequence[Unit]]:
    """Return units by which causes are compared.

    As they were tested first; about the model, if people did not differ; and as the design
    alone makes them. The whole of a misfit is in the scatter of the first, none in the second.
    """
    return base.units, ground.alike(model).units, ground.designed(model)


def _named(
    effect: int,
    model: Linearised,
    ground: Ground,
    residues: Sequence[Residue],
    flips: FloatArray,
    place: Place,
    bent: bool,
    seen_by: Sequence[Sequence[Unit]],
) -> Named:
    others = [other for other in model.chosen if other != effect]
    left = leave(model.units, others)
    gain = held_out_gain(left)[:, effect]
    rest = sum(float(each.gain.sum()) for each in residues if _beside_each_other(each, place))
    own = float(gain.sum())
    alike, near = _beside(effect, model, ground, seen_by)
    return Named(
        candidate=effect,
        verdict="family" if bent or rest > 0.0 else "confirmed",
        p_value=float(left.significance(flips).p[effect]),
        gain=gain,
        coefficients=left.estimates[:, effect],
        share=own / (own + rest) if own + rest > 0.0 else 0.0,
        alike=alike,
        near=near,
        left=rest > 0.0,
    )


def _beside(
    effect: int, model: Linearised, ground: Ground, seen_by: Sequence[Sequence[Unit]]
) -> tuple[tuple[tuple[int, float], ...], tuple[tuple[int, float], ...]]:
    """Return other causes that look like one, and those that look a little like it."""
    others = [other for other in model.chosen if other != effect]
    found = np.array([similarity(units, others)[effect] for units in seen_by])
    cosines = np.take_along_axis(found, np.argmax(np.abs(found), axis=0)[np.newaxis], 0)[0]
    name = ground.candidates[effect].effect
    beside = [
        (int(k), float(cosines[k]))
        for k in np.argsort(-np.abs(cosines))
        if k not in model.chosen and ground.candidates[k].effect != name
    ]
    return (
        tuple((k, c) for k, c in beside if abs(c) > ALIKE),
        tuple((k, c) for k, c in beside if 0.5 < abs(c) <= ALIKE),
    )


def _of_family(
    ground: Ground,
    base: Linearised,
    model: Linearised,
    residues: Sequence[Residue],
    present: set[int],
) -> list[Named]:
    """Return causes that in another form than the catalogue's explain what is left."""
    left = leave(model.units, model.chosen)
    alike = ground.alike(model)  # or what people differ in would hardly count
    found = []
    for place in dict.fromkeys(places_of([each.pattern for each in residues])):
        there = [each for each in residues if places_of([each.pattern])[0] == place]
        shares = {
            k: _share(ground, alike, there, k, place)
            for k in range(len(ground.candidates))
            if k not in present and place_of(alike.units, k, ground.patterns) == place
        }
        best = max(shares, key=lambda k: shares[k], default=None)
        if best is None or shares[best] < RIGHT_FAMILY:
            continue
        if any(shares[k] > shares[best] - CLEARLY for k in shares if k != best):
            continue
        same, near = _beside(best, model, ground, _seen_by(ground, base, model))
        found.append(
            Named(
                candidate=best,
                verdict="family",
                p_value=min(each.p_value for each in there),
                gain=np.sum([each.gain for each in there], axis=0),
                coefficients=left.estimates[:, best],
                share=shares[best],
                alike=same,
                near=near,
                in_model=False,
            )
        )
    return found


def _share(
    ground: Ground, model: Linearised, residues: Sequence[Residue], effect: int, place: Place
) -> float:
    """Return the share of what is left that an effect in any of its forms makes up."""
    numbers = [each.number for each in residues]
    means = np.array([each.mean for each in residues])
    misfit = [unit.generic[:, numbers] @ means for unit in model.units]
    forms = other_forms(ground, model, effect, place[1], beside=False)
    columns = [
        np.column_stack([whole.effects[:, effect], form])
        for whole, (form, _) in zip(model.units, forms, strict=True)
    ]
    units = [unit.beyond(model.chosen) for unit in model.units]
    return explained_by(units, misfit, columns)

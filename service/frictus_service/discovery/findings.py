"""What may be said of a model: causes named, or of the family, or not told apart; the rest."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from frictus_service.discovery.generic import Pattern, families
from frictus_service.discovery.linearised import Ground, Linearised
from frictus_service.discovery.selection import select
from frictus_service.discovery.significance import Significance
from frictus_service.discovery.units import (
    Unit,
    held_out_gain,
    leave,
    orthonormal,
    similarity,
)

FloatArray = NDArray[np.float64]

NAMING: Final = 0.05
"""Family-wise, of all causes of the catalogue."""
OMNIBUS: Final = 0.025
"""Family-wise, of all patterns: noticing something unknown in nothing is a false alarm too."""
ALIKE: Final = 0.9
"""Cosine from which two signatures are not told apart."""
RIGHT_FAMILY: Final = 0.6
"""A cause that explains less of what is reproducible in its place is not named."""
MOST_PATTERNS: Final = 6
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
    """

    candidate: int
    verdict: Literal["confirmed", "family"]
    p_value: float
    gain: FloatArray
    coefficients: FloatArray
    share: float
    alike: tuple[tuple[int, float], ...]
    near: tuple[tuple[int, float], ...]


@dataclass(frozen=True, slots=True)
class Residue:
    """Something reproducible that no cause in the model accounts for.

    Attributes
    ----------
    pattern : Pattern
        The strongest of its kind.
    tones : tuple of int
        Where it is, pattern's tones and those beside them that show it too.
    p_value : float
    gain : ndarray, shape (n_units,)
    """

    pattern: Pattern
    tones: tuple[int, ...]
    p_value: float
    gain: FloatArray


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
            known[key] = ground.linearise(key)
        return known[key]

    banned: set[int] = set()
    for _ in range(ATTEMPTS):
        selected = select(lambda chosen: linearise(chosen).units, flips, NAMING, banned)
        model = linearise(selected.effects)
        residues = _residues(model, selected.effects, ground.patterns, flips)
        named = [
            _named(effect, model, selected.effects, ground, residues, flips)
            for effect in selected.effects
        ]
        weak = {each.candidate for each in named if each.share < RIGHT_FAMILY}
        if not weak:
            break
        banned |= weak
    kept = [each for each in named if each.candidate not in weak]
    explained = sum(float(each.gain.sum()) for each in kept)
    left = sum(float(each.gain.sum()) for each in residues)
    return Findings(
        named=tuple(kept),
        residues=tuple(residues),
        base=linearise(()),
        extended=model,
        first=selected.first,
        effects=selected.effects,
        explained_share=explained / (explained + left) if explained + left > 0.0 else 1.0,
        accuracy=np.mean([unit.accuracy for unit in linearise(()).units], axis=0),
    )


def _residues(
    model: Linearised, effects: Sequence[int], patterns: Sequence[Pattern], flips: FloatArray
) -> list[Residue]:
    """Return the patterns that the model leaves, strongest first, each beside those before."""
    units = [unit.beyond(effects) for unit in model.units]
    found = select(lambda chosen: units, flips, OMNIBUS, most=MOST_PATTERNS)
    residues = []
    for place, pattern in enumerate(found.effects):
        left = leave(units, found.effects[:place])
        significance = left.significance(flips)
        gain = held_out_gain(left)[:, pattern]
        tones = _extent(patterns, pattern, significance)
        residues.append(Residue(patterns[pattern], tones, float(significance.p[pattern]), gain))
    return residues


def _extent(
    patterns: Sequence[Pattern], found: int, significance: Significance
) -> tuple[int, ...]:
    """Return the tones of a pattern, and those of others like it that are significant too."""
    one = patterns[found]
    if not one.tones:
        return ()
    tones = set(one.tones)
    for other, p in zip(patterns, significance.p, strict=True):
        like = other.channel == one.channel and other.covariate == one.covariate
        if like and p <= OMNIBUS and len(other.tones) <= len(one.tones):
            tones |= set(other.tones)
    return tuple(sorted(tones))


def _named(
    effect: int,
    model: Linearised,
    effects: Sequence[int],
    ground: Ground,
    residues: Sequence[Residue],
    flips: FloatArray,
) -> Named:
    others = [other for other in effects if other != effect]
    left = leave(model.units, others)
    significance = left.significance(flips)
    gain = held_out_gain(left)[:, effect]
    cosines = similarity(model.units, others)[effect]
    beside = [
        (k, float(cosines[k]))
        for k in np.argsort(-np.abs(cosines))
        if k not in effects and ground.candidates[k].effect != ground.candidates[effect].effect
    ]
    place = place_of(model.units, effect, ground.patterns)
    rest = sum(
        float(each.gain.sum()) for each in residues if families([each.pattern])[0] == place
    )
    own = float(gain.sum())
    return Named(
        candidate=effect,
        verdict="family" if rest > 0.0 else "confirmed",
        p_value=float(significance.p[effect]),
        gain=gain,
        coefficients=left.estimates[:, effect],
        share=own / (own + rest) if own + rest > 0.0 else 0.0,
        alike=tuple((int(k), c) for k, c in beside if abs(c) > ALIKE),
        near=tuple((int(k), c) for k, c in beside if 0.5 < abs(c) <= ALIKE),
    )


def place_of(
    units: Sequence[Unit], effect: int, patterns: Sequence[Pattern]
) -> tuple[str, str]:
    """Return the family of patterns that comes closest to an effect's signature.

    Parameters
    ----------
    units : sequence of Unit
    effect : int
    patterns : sequence of Pattern
    """
    family = families(patterns)
    names = list(dict.fromkeys(family))
    explained = np.zeros(len(names))
    for unit in units:
        own = orthonormal(unit.own)
        signature = unit.effects[:, effect]
        signature = signature - own @ (own.T @ signature)
        for place, name in enumerate(names):
            columns = unit.generic[:, [each == name for each in family]]
            columns = columns - own @ (own.T @ columns)
            found = np.linalg.lstsq(columns, signature, rcond=1e-9)[0]
            explained[place] += float(signature @ columns @ found)
    return names[int(np.argmax(explained))]

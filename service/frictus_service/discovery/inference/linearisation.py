"""The model about which everything is linear: fitted to each unit, with what it left there."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import Final, NamedTuple

import numpy as np

from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.effects import KNOWN
from frictus_service.discovery.evidence.residuals import Compared, accuracy_of, reduce
from frictus_service.discovery.inference.covariance import Whiten, Whitening, whiten
from frictus_service.discovery.inference.linear_model import Unit, joint, mean_of_known
from frictus_service.discovery.problem.base_models import NUISANCE
from frictus_service.discovery.problem.candidates import Pattern
from frictus_service.discovery.problem.problem import (
    DiscoveryProblem,
    UnwhitenedUnit,
    as_accurate,
)
from frictus_service.discovery.projection import hardly_left, orthogonal_to, orthonormal

ROUNDS: Final = 8
"""Of Gauss-Newton at most; without a power that outgrows its background, three do."""
SETTLED: Final = 1e-3
ASTRAY: Final = 0.01
"""By which what is left may grow in a step: people are drawn towards each other, too."""
LEAST_STEP: Final = 0.1
LESS_LIKELY: Final = 1.0
"""Nats by which the last round may be less likely than the best."""
MOST_CHANGE: Final = 0.7
"""Of the logarithm of an own parameter in one round."""


@dataclass(frozen=True, slots=True)
class Linearised:
    """The units about the model, and the model.

    Attributes
    ----------
    units : tuple of Unit
        The chosen effects are back in the readings: their coefficients are the whole ones.
    own : ndarray, shape (n_units, n_own)
        Logarithms of what everybody has of their own, less the base model's.
    chosen : tuple of int
        Candidates in the model.
    coefficients : ndarray, shape (n_units, n_chosen)
        Of the chosen effects: the unit's own, or means over units of what is the rig's.
    whitenings : tuple of Whitening
        Of each unit.
    """

    units: tuple[Unit, ...]
    own: FloatArray
    chosen: tuple[int, ...]
    coefficients: FloatArray
    whitenings: tuple[Whitening, ...]


def linearise(
    problem: DiscoveryProblem,
    chosen: Sequence[int],
    wanted: Sequence[int] | None = None,
    patterns: Sequence[Pattern] | None = None,
    start: Linearised | None = None,
    whiten: Whiten = whiten,
) -> Linearised:
    """Fit own parameters and chosen effects, and return the units about that.

    Parameters
    ----------
    problem : DiscoveryProblem
        Data, base model and candidates.
    chosen : sequence of int
        Candidates.
    wanted : sequence of int or None
        Candidates whose signatures the units have; None: all.
    patterns : sequence of Pattern or None
        Likewise.
    start : Linearised or None
        With fewer effects, from whose parameters the fit begins.
    whiten : callable
        From layouts and units to whitenings; the default estimates the covariance from the
        readings themselves.
    """
    own = np.zeros((len(problem.subjects), len(NUISANCE[problem.response])))
    random_coefficients = np.zeros((len(problem.subjects), len(problem.random_effects)))
    if start is not None:
        own = start.own
        random_coefficients = np.array(
            [whitening.random_coefficients for whitening in start.whitenings]
        )
    random = [each for each in problem.random_effects if each not in chosen]
    places = [problem.random_effects.index(each) for each in random]
    there = [*chosen, *random]  # effects about which all is linear
    at = np.hstack(
        [np.zeros((len(problem.subjects), len(chosen))), random_coefficients[:, places]]
    )
    if start is not None:
        for place, effect in enumerate(start.chosen):
            if effect in chosen:
                at[:, list(chosen).index(effect)] = start.coefficients[:, place]
    rounds: list[_Round] = []
    for _ in range(ROUNDS):
        before = at
        units, whitenings = units_about(problem, own, there, at, len(chosen), there, (), whiten)
        rests = [
            unit.readings - unit.effects @ row for unit, row in zip(units, at, strict=True)
        ]
        left = sum(float(rest @ rest) for rest in rests)
        rounds.append(_Round(own, at, _likelihood(whitenings, left)))
        coefficients = _settled(problem, joint(units, range(len(chosen))), chosen)
        random_coefficients = np.array(
            [whitening.random_coefficients[places] for whitening in whitenings]
        )
        at = np.clip(np.hstack([coefficients, random_coefficients]), *problem.limits(there))
        steps = np.array(
            [_own_step(*each, own.shape[1]) for each in zip(units, at, strict=True)]
        )
        steps = np.clip(steps, -MOST_CHANGE, MOST_CHANGE)
        share = _eased(problem, own, steps, there, before, at, units, whitenings)
        own = own + share * steps
        at = before + share * (at - before)
        at[:, : len(chosen)] = _settled(problem, at[:, : len(chosen)], chosen)
        change = np.abs(at - before)[:, : len(chosen)]
        small = np.all(change <= SETTLED * np.abs(at[:, : len(chosen)]))
        if small and np.all(np.abs(steps) < SETTLED):
            break
    wanted = range(len(problem.candidates)) if wanted is None else wanted
    patterns = problem.patterns if patterns is None else patterns
    units, whitenings = units_about(
        problem, own, there, at, len(chosen), wanted, patterns, whiten
    )
    rests = [
        _whitened_rest(problem, place, whitening, own[place], there, at[place])
        for place, whitening in enumerate(whitenings)
    ]
    best = max(rounds, key=attrgetter("likelihood"))
    left = sum(float(rest @ rest) for rest in rests)
    if _likelihood(whitenings, left) < best.likelihood - LESS_LIKELY:
        own, at = best.own, best.at
        units, whitenings = units_about(
            problem, own, there, at, len(chosen), wanted, patterns, whiten
        )
    return Linearised(units, own, tuple(chosen), at[:, : len(chosen)], whitenings)


class _Round(NamedTuple):
    """Parameters of all units, and how likely they make the readings, in nats.

    Steps and scatter follow from each other: where a cutoff comes near to none, a unit may go
    farther with every round, its readings count for less, and all scatter more.
    """

    own: FloatArray
    at: FloatArray
    likelihood: float


def likelihood(problem: DiscoveryProblem, model: Linearised) -> float:
    """Return how likely a fitted model makes the readings of all units, in nats.

    Each model is weighed by the scatter about itself: that about a model which lacks something
    holds what it lacks, and tells no two models that have it apart.

    Parameters
    ----------
    problem : DiscoveryProblem
        Data, base model and candidates.
    model : Linearised
        A fitted model with the units about it.
    """
    return _likelihood(model.whitenings, misfit(problem, model, model))


def _likelihood(whitenings: Sequence[Whitening], misfit: float) -> float:
    """Return how likely readings are of which this sum of squares is left, in nats."""
    return sum(each.log_determinant for each in whitenings) - 0.5 * misfit


def units_about(
    problem: DiscoveryProblem,
    own: FloatArray,
    there: Sequence[int],
    at: FloatArray,
    n_chosen: int,
    wanted: Sequence[int],
    patterns: Sequence[Pattern],
    whiten: Whiten,
) -> tuple[tuple[Unit, ...], tuple[Whitening, ...]]:
    """Return the units about given parameters, with wanted candidates, and whitenings.

    Parameters
    ----------
    problem : DiscoveryProblem
        Data, base model and candidates.
    own : ndarray, shape (n_units, n_own)
    there : sequence of int
        Effects in the simulator: the chosen ones, and then the random effects.
    at : ndarray, shape (n_units, n_there)
    n_chosen : int
        How many of the effects are in the model.
    wanted : sequence of int
        Candidates whose signatures are asked for.
    patterns : sequence of Pattern
        That any misfit may show as.
    whiten : callable
        From layouts and units to whitenings.
    """
    subjects = problem.subjects
    raw = [
        problem.unwhitened(subject, values, there, row, n_chosen, wanted)
        for subject, values, row in zip(subjects, own, at, strict=True)
    ]
    whitenings = whiten([s.layout for s in subjects], [each for each, _ in raw])
    positive = problem.positive(wanted)
    squared = np.array([problem.candidates[each].squared for each in wanted], dtype=np.bool_)
    # Where a power is in the model already, its signature levels off: it was seen before.
    passed = [each in there and problem.candidates[each].squared for each in wanted]
    units = []
    for subject, (each, effects), whitening in zip(subjects, raw, whitenings, strict=True):
        generic = [reduce(subject.layout, pattern.of(subject)) for pattern in patterns]
        columns = np.array(generic).reshape(len(generic), each.readings.size).T
        effects = _shown(effects, each)
        units.append(
            Unit(
                whitening(each.readings),
                whitening(each.own),
                whitening(effects),
                whitening(columns),
                np.where(passed, 0.0, as_accurate(effects, each.accuracy)),
                as_accurate(columns, each.accuracy),
                positive,
                squared,
            )
        )
    return tuple(units), tuple(whitenings)


def _shown(effects: FloatArray, unit: UnwhitenedUnit) -> FloatArray:
    """Return signatures, those empty that own parameters account for as measuring is accurate.

    Whitened, a thousandth of a gain may stand out where contacts scatter and nothing else does:
    at one depth of modulation compression is a gain, but for what noise does to the depth.
    """
    scale = 1.0 / unit.accuracy[:, np.newaxis]
    basis, whole = orthonormal(unit.own * scale), effects * scale
    hidden = hardly_left(orthogonal_to(basis, whole), whole)
    return np.where(hidden, 0.0, effects)


def _eased(
    problem: DiscoveryProblem,
    own: FloatArray,
    steps: FloatArray,
    there: Sequence[int],
    before: FloatArray,
    at: FloatArray,
    units: Sequence[Unit],
    whitenings: Sequence[Whitening],
) -> FloatArray:
    """Return how much of its step each unit goes, so that it leaves no more than before.

    Halves until it does: what is far from linear leads a whole step astray.

    Returns
    -------
    ndarray, shape (n_units, 1)
    """
    shares = np.ones((len(units), 1))
    for place, (unit, whitening) in enumerate(zip(units, whitenings, strict=True)):
        free = orthonormal(unit.own[:, own.shape[1] :])
        most = _beyond(free, unit.readings - unit.effects @ before[place]) * (1.0 + ASTRAY)
        share = 1.0
        while share > LEAST_STEP:
            here = before[place] + share * (at[place] - before[place])
            rest = _whitened_rest(
                problem, place, whitening, own[place] + share * steps[place], there, here
            )
            if _beyond(free, rest) <= most:
                break
            share /= 2.0
        shares[place] = share
    return shares


def _whitened_rest(
    problem: DiscoveryProblem,
    place: int,
    whitening: Whitening,
    own: FloatArray,
    there: Sequence[int],
    at: FloatArray,
) -> FloatArray:
    """Return what the model with these parameters leaves of a unit's readings."""
    subject = problem.subjects[place]
    return whitening(reduce(subject.layout, problem.rest(subject, own, there, at)))


def _beyond(basis: FloatArray, readings: FloatArray) -> float:
    """Return the sum of squares outside an orthonormal basis."""
    return float(np.sum(np.square(orthogonal_to(basis, readings))))


def misfit(problem: DiscoveryProblem, model: Linearised, ruler: Linearised) -> float:
    """Return the sum of squares that a model leaves of all units: that of `misfits`."""
    return float(misfits(problem, model, ruler).sum())


def misfits(problem: DiscoveryProblem, model: Linearised, ruler: Linearised) -> FloatArray:
    """Return the sum of squares that a model leaves of each unit, whitened as about another.

    Parameters
    ----------
    problem : DiscoveryProblem
        Data, base model and candidates.
    model : Linearised
        A fitted model with the units about it.
    ruler : Linearised
        The same for all models that are compared.

    Returns
    -------
    ndarray, shape (n_units,)
    """
    left = []
    for place, whitening in enumerate(ruler.whitenings):
        own, at = model.own[place], model.coefficients[place]
        rest = _whitened_rest(problem, place, whitening, own, model.chosen, at)
        left.append(_beyond(orthonormal(ruler.units[place].own), rest))
    return np.array(left)


def columns_of(
    problem: DiscoveryProblem,
    model: Linearised,
    made: Callable[[int], Sequence[Compared]],
) -> list[tuple[FloatArray, FloatArray]]:
    """Return further columns of each unit, whitened, and how accurate they are.

    Parameters
    ----------
    problem : DiscoveryProblem
        Data, base model and candidates.
    model : Linearised
        A fitted model with the units about it.
    made : callable
        From the number of a unit to columns.
    """
    found = []
    for place, (subject, whitening) in enumerate(
        zip(problem.subjects, model.whitenings, strict=True)
    ):
        raw = [reduce(subject.layout, each) for each in made(place)]
        columns = np.array(raw).T
        accuracy = as_accurate(columns, accuracy_of(subject.layout))
        found.append((whitening(columns), accuracy))
    return found


def _settled(problem: DiscoveryProblem, found: FloatArray, chosen: Sequence[int]) -> FloatArray:
    """Return coefficients to go on with: each unit's own only where people differ."""
    if not chosen:
        return found
    mean = mean_of_known(found)
    scopes = [KNOWN[problem.candidates[effect].effect].scope for effect in chosen]
    own = np.array([scope == "participant" for scope in scopes]) & np.isfinite(found)
    settled = np.where(own, found, mean)
    return np.where(problem.positive(chosen), np.maximum(settled, 0.0), settled)


def _own_step(unit: Unit, coefficients: FloatArray, n_own: int) -> FloatArray:
    """Return by how much the own parameters of a unit are off."""
    readings = unit.readings - unit.effects @ coefficients
    found = np.linalg.lstsq(unit.own, readings, rcond=None)[0]
    return np.asarray(found[:n_own], dtype=np.float64)

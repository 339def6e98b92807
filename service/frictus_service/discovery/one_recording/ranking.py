"""Models of one recording, fitted to all of it and ranked by what each fold says of them.

Every model has each fold's own gain and cutoff (mass, damping, stiffness). A fold's held-out
log-likelihood is that of its readings under the coefficients that the other folds give; all
models are weighed by one ruler, the scatter about the richest of them, as the overdispersion of
QAIC is that of the global model (Burnham and Anderson, Model Selection and Multimodel
Inference, 2nd ed., 2002, section 2.5). AIC counts besides one coefficient per cause the search:
``2 ln K`` for each of K candidates tried (Foster and George, Ann. Statist. 22, 1994: RIC).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Final

import numpy as np

from frictus_hardware.arrays import FloatArray
from frictus_service.discovery.evidence.residuals import Layout, noise_of
from frictus_service.discovery.inference.covariance import Whiten, Whitening, whiten
from frictus_service.discovery.inference.linear_model import Unit, orthonormal, project_out
from frictus_service.discovery.inference.linearisation import (
    Linearised,
    linearise,
    weighted_as,
)
from frictus_service.discovery.problem.candidates import MODE_HZ, Candidate
from frictus_service.discovery.problem.problem import DiscoveryProblem, UnwhitenedUnit

FEW: Final = 3
"""Frequencies at which a mode is fitted, of those at which its signature explains most."""
BEST: Final = 4
"""Causes of which all pairs are tried."""
ERRORS: Final = 2.0
"""Standard errors over folds by which held-out gain must exceed zero."""
LEAST_GAIN: Final = 4.0
"""Nats of held-out gain, whatever the folds agree on."""
ACCURACIES: Final = 2.0
"""As many times as the response is measured accurately must a cause change it somewhere: what
windows of a spectrum are wrong by is the same in all folds."""
RULE: Final = (
    f"held-out gain above {ERRORS:g} standard errors over folds and {LEAST_GAIN:g} nats, AIC "
    "with 2 ln K for the search below the base model's, and a change of the response somewhere "
    f"of {ACCURACIES:g} times its accuracy"
)
FINER: Final = (-0.5, -0.25, 0.25, 0.5)
"""Of the way to the next frequency at which a mode was tried: where it is tried then."""


@dataclass(frozen=True, slots=True)
class FittedModel:
    """One model of the recording, against the base model.

    Attributes
    ----------
    candidates : tuple of int
        Those in it; empty: the base model.
    gain : ndarray, shape (n_folds,)
        Held-out log-likelihood of each fold over that of the base model, nats.
    aic : float
        Less the base model's, the search included; smaller is better.
    coefficients, standard_errors : ndarray, shape (n_candidates,)
        Of the candidates in it.
    accuracy : ndarray, shape (n_candidates,)
        Coefficient at which each shows as much as measuring is accurate.
    """

    candidates: tuple[int, ...]
    gain: FloatArray
    aic: float
    coefficients: FloatArray
    standard_errors: FloatArray
    accuracy: FloatArray

    @property
    def shown(self) -> bool:
        """Whether all its causes change the response by more than measuring is accurate."""
        change = np.abs(self.coefficients) > ACCURACIES * self.accuracy
        return bool(self.candidates) and bool(change.all())

    @property
    def total(self) -> float:
        """Held-out gain of all folds, nats."""
        return float(self.gain.sum())

    @property
    def standard_error(self) -> float:
        """Of the total, from how folds differ."""
        return float(self.gain.std(ddof=1) * np.sqrt(self.gain.size))


@dataclass(frozen=True, slots=True)
class Ranking:
    """All models of a recording.

    Attributes
    ----------
    candidates : tuple of Candidate
        Those that models number.
    models : tuple of FittedModel
        Best first; of a cause that was tried at several frequencies, the best. What changes the
        response by no more than measuring is accurate comes after the base model.
    searched : int
        Candidates of which the recording shows something.
    silent : tuple of str
        Causes of which it shows nothing, or that stand with another's signature.
    """

    candidates: tuple[Candidate, ...]
    models: tuple[FittedModel, ...]
    searched: int
    silent: tuple[str, ...]

    @property
    def margin(self) -> float:
        """By how much the first exceeds what chance gives, nats; 0 or less: it does not."""
        first = self.models[0]
        if not first.shown:
            return 0.0
        return min(
            first.total - max(ERRORS * first.standard_error, LEAST_GAIN), -first.aic / 2.0
        )


def rank(problem: DiscoveryProblem, variance: Sequence[FloatArray]) -> Ranking:
    """Fit and rank the base model, every candidate and pairs of the best.

    Parameters
    ----------
    problem : DiscoveryProblem
        The folds are its units.
    variance : sequence of ndarray, shape (n_rows,)
        Of each fold: of ln size and phase of its rows, from the noise beside them.
    """
    whitened = _by_noise(problem, variance)
    base = linearise(problem, (), patterns=(), whiten=whitened)
    left = project_out(base.units)
    information = left.information.sum(axis=0)
    gain = np.square(left.along.sum(axis=0)) / np.maximum(information, np.finfo(float).tiny)
    shown = np.flatnonzero(information > 0.0).tolist()
    names = dict.fromkeys(problem.candidates[k].effect for k in shown)
    every = dict.fromkeys(each.effect for each in problem.candidates)
    finer = _finer(problem, shown, gain)
    added = range(len(problem.candidates), len(problem.candidates) + len(finer))
    problem = replace(problem, candidates=(*problem.candidates, *finer))
    searched = len(shown) + len(added)
    fitted = {
        (k,): linearise(problem, (k,), (k,), (), start=base, whiten=whitened)
        for k in [*_promising(problem, shown, gain), *added]
    }
    first = _of_each_cause(problem, _compared(problem, base, fitted, base, searched))
    # The scatter about the base model holds what a cause would explain: the best has least.
    ruler = fitted.get(first[0].candidates, base)
    best = [model.candidates[0] for model in first if model.candidates][:BEST]
    for pair in combinations(best, 2):
        better = fitted[pair[:1]]  # best first
        fitted[pair] = linearise(problem, pair, pair, (), start=better, whiten=whitened)
    found = _of_each_cause(problem, _compared(problem, base, fitted, ruler, searched))
    found.sort(key=lambda model: (bool(model.candidates) and not model.shown, model.aic))
    found = _simplest(problem, found)
    silent = tuple(name for name in every if name not in names)
    return Ranking(problem.candidates, tuple(found), searched, silent)


def _promising(problem: DiscoveryProblem, shown: list[int], gain: FloatArray) -> list[int]:
    """Return the candidates to be fitted: of a cause at many frequencies, the best few."""
    kept: list[int] = []
    for name in dict.fromkeys(problem.candidates[k].effect for k in shown):
        own = [k for k in shown if problem.candidates[k].effect == name]
        kept += sorted(own, key=lambda k: -gain[k])[:FEW]
    return kept


def _simplest(problem: DiscoveryProblem, models: list[FittedModel]) -> list[FittedModel]:
    """Return models with one cause before two that predict no more than chance gives."""
    first = models[0]
    parts = {problem.candidates[k].effect for k in first.candidates}
    for one in models[1:]:
        alone = len(one.candidates) == 1 < len(first.candidates) and one.shown
        if alone and problem.candidates[one.candidates[0]].effect in parts:
            more = first.gain - one.gain
            error = float(more.std(ddof=1) * np.sqrt(more.size))
            if more.sum() < max(ERRORS * error, LEAST_GAIN):
                return [one, *(model for model in models if model is not one)]
    return models


def _finer(problem: DiscoveryProblem, shown: list[int], gain: FloatArray) -> list[Candidate]:
    """Return the best mode at frequencies between those at which modes are tried."""
    modes = [k for k in shown if problem.candidates[k].effect == "second_mode"]
    if not modes:
        return []
    best = problem.candidates[max(modes, key=lambda k: gain[k])]
    place = dict(best.held)["frequency_hz"]
    step = np.log(MODE_HZ[1] / MODE_HZ[0])
    return [
        replace(best, held=(("frequency_hz", round(float(place * np.exp(step * part)), 1)),))
        for part in FINER
    ]


def _by_noise(problem: DiscoveryProblem, variance: Sequence[FloatArray]) -> Whiten:
    noise = [
        noise_of(subject.layout, each)
        for subject, each in zip(problem.subjects, variance, strict=True)
    ]

    def whitened(layouts: Sequence[Layout], raws: Sequence[UnwhitenedUnit]) -> list[Whitening]:
        return whiten(layouts, raws, noise)

    return whitened


def _of_each_cause(
    problem: DiscoveryProblem, models: Sequence[FittedModel]
) -> list[FittedModel]:
    """Return the best model of each set of causes, best first."""
    found: dict[tuple[str, ...], FittedModel] = {}
    for model in models:
        names = tuple(sorted({problem.candidates[k].effect for k in model.candidates}))
        if len(names) == len(model.candidates):
            found.setdefault(names, model)
    return list(found.values())


def _compared(
    problem: DiscoveryProblem,
    base: Linearised,
    fitted: dict[tuple[int, ...], Linearised],
    ruler: Linearised,
    searched: int,
) -> list[FittedModel]:
    """Return all models weighed by one ruler, best AIC first."""
    before = np.array(
        [np.sum(np.square(_beside_own(unit)[1])) for unit in weighted_as(problem, base, ruler)]
    )
    nothing = np.zeros(0)
    models = [FittedModel((), np.zeros(before.size), 0.0, nothing, nothing, nothing)]
    for model in fitted.values():
        units = weighted_as(problem, model, ruler)
        parts = [_beside_own(unit) for unit in units]
        accuracy = np.mean([unit.accuracy for unit in units], axis=0)
        models.append(_fitted(problem, model.chosen, parts, accuracy, before, searched))
    return sorted(models, key=lambda model: model.aic)


def _beside_own(unit: Unit) -> tuple[FloatArray, FloatArray]:
    """Return signatures and readings, with what is the fold's own projected out."""
    own = orthonormal(unit.own)
    effects = unit.effects - own @ (own.T @ unit.effects)
    return effects, unit.readings - own @ (own.T @ unit.readings)


def _fitted(
    problem: DiscoveryProblem,
    chosen: tuple[int, ...],
    parts: Sequence[tuple[FloatArray, FloatArray]],
    accuracy: FloatArray,
    before: FloatArray,
    searched: int,
) -> FittedModel:
    """Return a model from signatures and readings of each fold, (n, k) and (n,)."""
    grams = np.array([effects.T @ effects for effects, _ in parts])
    along = np.array([effects.T @ rest for effects, rest in parts])
    low, high = problem.limits(chosen)
    low = np.where(problem.positive(chosen), np.maximum(low, 0.0), low)

    def solved(folds: FloatArray) -> FloatArray:
        gram, sums = np.tensordot(folds, grams, 1), folds @ along
        return np.clip(np.linalg.lstsq(gram, sums, rcond=1e-9)[0], low, high)

    def left(coefficients: FloatArray) -> FloatArray:
        """Of each fold, with coefficients of its own or of all."""
        each = np.broadcast_to(coefficients, along.shape)
        return np.array(
            [
                np.sum(np.square(rest - effects @ c))
                for (effects, rest), c in zip(parts, each, strict=True)
            ]
        )

    n = len(parts)
    every = solved(np.ones(n))
    others = np.array([solved(1.0 - fold) for fold in np.eye(n)])
    search = 2.0 * len(chosen) * (1.0 + np.log(searched))
    formal = np.sqrt(np.diagonal(np.linalg.pinv(grams.sum(axis=0), hermitian=True)))
    jackknife = np.sqrt((n - 1) / n * np.square(others - others.mean(axis=0)).sum(axis=0))
    return FittedModel(
        chosen,
        (before - left(others)) / 2.0,
        float(left(every).sum() - before.sum() + search),
        every,
        np.maximum(formal, jackknife),
        accuracy,
    )

"""Models of one recording, fitted to all of it and ranked by what each fold says of them.

Every model has each fold's own gain and cutoff (mass, damping, stiffness). A fold's held-out
log-likelihood is that of its readings under the coefficients that the other folds give; all
models are weighed by one ruler, the scatter about the best of those with one cause, as the
overdispersion of QAIC is that of the global model (Burnham and Anderson, Model Selection and
Multimodel Inference, 2nd ed., 2002, section 2.5). AIC counts besides one coefficient per cause
the search: ``2 ln K`` for each of K candidates tried (Foster and George 1994: RIC).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Final

import numpy as np

from frictus_hardware.arrays import FloatArray
from frictus_service.discovery.evidence.residuals import Layout, noise_of
from frictus_service.discovery.inference.covariance import Whiten, Whitening, whiten
from frictus_service.discovery.inference.linear_model import (
    Unit,
    beside,
    mean_of_known,
    project_out,
)
from frictus_service.discovery.inference.linearisation import (
    Linearised,
    linearise,
)
from frictus_service.discovery.inference.mode_shape import (
    MOST_STEP,
    STEPS,
    ModeShape,
    mode_in,
    moved,
    with_shape,
)
from frictus_service.discovery.inference.units_anew import weighted_as
from frictus_service.discovery.problem.candidates import Candidate
from frictus_service.discovery.problem.problem import DiscoveryProblem, UnwhitenedUnit
from frictus_service.discovery.projection import ROUNDING, inverse_of

BEST: Final = 3
"""Causes of which all pairs are tried."""
ERRORS: Final = 2.0
"""Standard errors over folds by which held-out gain must exceed zero."""
LEAST_GAIN: Final = 4.0
"""Nats of held-out gain, whatever the folds agree on."""
ACCURACIES: Final = 2.0
"""As many times as the response is measured accurately must a cause change it somewhere: what
windows of a spectrum are wrong by is the same in all folds."""
SHARE: Final = 0.02
"""Of what one cause explains, by which two must explain more: windows of a spectrum, and the
frequencies at which a mode is tried, leave a share of a large effect that another may fill."""
ALIKE: Final = 1e-9
"""Eigenvalue, of the largest, at which signatures of length 1 are taken for one."""
RULE: Final = (
    f"held-out gain above {ERRORS:g} standard errors over folds and {LEAST_GAIN:g} nats, AIC "
    "with 2 ln K for the search below the base model's, and a change of the response somewhere "
    f"of {ACCURACIES:g} times its accuracy"
)


@dataclass(frozen=True, slots=True)
class FittedModel:
    """One model of the recording, against the base model.

    Attributes
    ----------
    candidates : tuple of int
        Those in it; empty: the base model.
    gain : ndarray, shape (n_folds,)
        Held-out log-likelihood of each fold over that of the base model, nats.
    explained : float
        Share of what the base model leaves in held-out folds that it takes away.
    aic : float
        Less the base model's, the search included; smaller is better.
    coefficients, standard_errors : ndarray, shape (n_candidates,)
        Of the candidates in it.
    accuracy : ndarray, shape (n_candidates,)
        Coefficient at which each shows as much as measuring is accurate.
    shape : ModeShape or None
        Of the mode in it that was fitted.
    """

    candidates: tuple[int, ...]
    gain: FloatArray
    explained: float
    aic: float
    coefficients: FloatArray
    standard_errors: FloatArray
    accuracy: FloatArray
    shape: ModeShape | None = None

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

    A candidate that explains next to nothing where the model is linear about the base is ranked
    by that; the others are fitted.

    Parameters
    ----------
    problem : DiscoveryProblem
        The folds are its units.
    variance : sequence of ndarray, shape (n_rows,)
        Of each fold: of ln size and phase of its rows, from the noise beside them.
    """
    fitted = _Fitted(problem, _by_noise(problem, variance))
    for model in fitted.best(fitted.base):
        fitted.add(model.candidates)
    for _ in range(STEPS):
        nearer = _nearer(fitted)
        if not nearer:
            break
        fitted = fitted.with_more(nearer)
    first = fitted.best(fitted.base)
    # The scatter about the base model holds what a cause would explain: the best has least.
    ruler = fitted.models.get(first[0].candidates, fitted.base)
    best = [model.candidates[0] for model in first if model.candidates][:BEST]
    for pair in combinations(best, 2):
        fitted.add(pair, start=pair[:1])
    found = fitted.best(ruler)
    found.sort(key=lambda model: (bool(model.candidates) and not model.shown, model.aic))
    every = dict.fromkeys(each.effect for each in problem.candidates)
    seen = {fitted.problem.candidates[k].effect for k in fitted.shown}
    return Ranking(
        fitted.problem.candidates,
        tuple(_simplest(fitted.problem, found)),
        len(fitted.shown),
        tuple(name for name in every if name not in seen),
    )


class _Fitted:
    """The models of a recording that are fitted, and those that need not be.

    Attributes
    ----------
    problem : DiscoveryProblem
        Data, base model, and all candidates.
    base : Linearised
        Without any cause, about which all candidates are linear.
    models : dict
        Fitted ones, by their candidates.
    shown : list of int
        Candidates of which the recording shows something.
    """

    def __init__(self, problem: DiscoveryProblem, whitened: Whiten) -> None:
        self.problem, self._whitened = problem, whitened
        self.base = linearise(problem, (), patterns=(), whiten=whitened)
        information = project_out(self.base.units).information.sum(axis=0)
        self.shown: list[int] = np.flatnonzero(information > 0.0).tolist()
        self.models: dict[tuple[int, ...], Linearised] = {}
        self._tried: list[tuple[int, ...]] = [(k,) for k in self.shown]

    def add(self, chosen: tuple[int, ...], start: tuple[int, ...] = ()) -> None:
        """Fit a model if it explains anything, from the parameters of another."""
        if chosen not in self._tried:
            self._tried.append(chosen)
        parts = [beside(unit.only(list(chosen))) for unit in self.base.units]
        along = np.sum([effects.T @ rest for effects, rest in parts], axis=0)
        gram = np.sum([effects.T @ effects for effects, _ in parts], axis=0)
        if chosen and along @ inverse_of(gram, ALIKE) @ along > 2.0 * LEAST_GAIN:
            before = self.models.get(start, self.base)
            self.models[chosen] = linearise(
                self.problem, chosen, chosen, (), start=before, whiten=self._whitened
            )

    def with_more(self, candidates: Sequence[Candidate]) -> "_Fitted":
        """Return the models with further candidates, fitted."""
        n = len(self.problem.candidates)
        problem = replace(self.problem, candidates=(*self.problem.candidates, *candidates))
        more = _Fitted(problem, self._whitened)
        more.models |= self.models
        for k in range(n, n + len(candidates)):
            more.add((k,))
        return more

    def best(self, ruler: Linearised) -> list[FittedModel]:
        """Return the best model of each set of causes, weighed by one ruler, best AIC first."""
        about = weighted_as(self.problem, self.base, ruler, range(len(self.problem.candidates)))
        before = np.array([np.sum(np.square(beside(unit)[1])) for unit in about])
        nothing = np.zeros(0)
        found = [FittedModel((), np.zeros(before.size), 0.0, 0.0, nothing, nothing, nothing)]
        for chosen in self._tried:
            if chosen in self.models:
                mode = mode_in(self.problem.candidates, chosen)
                fitted = self.models[chosen]
                units = (
                    weighted_as(self.problem, fitted, ruler, chosen)
                    if mode is None
                    else with_shape(self.problem, fitted, ruler, mode)
                )
            else:
                units = tuple(unit.only(list(chosen)) for unit in about)
            found.append(_fitted(self.problem, chosen, units, before, len(self.shown)))
        found.sort(key=lambda model: model.aic)
        of_causes: dict[tuple[str, ...], FittedModel] = {}
        for model in found:
            names = {self.problem.candidates[k].effect for k in model.candidates}
            if len(names) == len(model.candidates):
                of_causes.setdefault(tuple(sorted(names)), model)
        return list(of_causes.values())


def _simplest(problem: DiscoveryProblem, models: list[FittedModel]) -> list[FittedModel]:
    """Return models with one cause before two that predict no more than chance gives."""
    first = models[0]
    parts = {problem.candidates[k].effect for k in first.candidates}
    for one in models[1:]:
        alone = len(one.candidates) == 1 < len(first.candidates) and one.shown
        if alone and problem.candidates[one.candidates[0]].effect in parts:
            more = first.gain - one.gain
            error = float(more.std(ddof=1) * np.sqrt(more.size))
            if more.sum() < max(ERRORS * error, LEAST_GAIN, SHARE * one.total):
                return [one, *(model for model in models if model is not one)]
    return models


def _nearer(fitted: _Fitted) -> list[Candidate]:
    """Return a mode that is among the two best where its derivatives say that it is."""
    candidates = fitted.problem.candidates
    for model in fitted.best(fitted.base)[:2]:
        mode = mode_in(candidates, model.candidates)
        if mode is not None and model.shape is not None:
            return [moved(candidates[mode], np.clip(model.shape.off, -MOST_STEP, MOST_STEP))]
    return []


def _by_noise(problem: DiscoveryProblem, variance: Sequence[FloatArray]) -> Whiten:
    noise = [
        noise_of(subject.layout, each)
        for subject, each in zip(problem.subjects, variance, strict=True)
    ]

    def whitened(layouts: Sequence[Layout], raws: Sequence[UnwhitenedUnit]) -> list[Whitening]:
        return whiten(layouts, raws, noise)

    return whitened


def _fitted(
    problem: DiscoveryProblem,
    chosen: tuple[int, ...],
    units: Sequence[Unit],
    before: FloatArray,
    searched: int,
) -> FittedModel:
    """Return a model from the folds, whose effects are those in it."""
    parts = [beside(unit) for unit in units]
    grams = np.array([effects.T @ effects for effects, _ in parts])
    along = np.array([effects.T @ rest for effects, rest in parts])
    low, high = problem.limits(chosen)
    low = np.where(problem.positive(chosen), np.maximum(low, 0.0), low)
    more = grams.shape[1] - len(chosen)  # frequency and quality of a mode
    low, high = (
        np.append(ends, np.full(more, end)) for ends, end in ((low, -1.0), (high, 1.0))
    )

    def solved(folds: FloatArray) -> FloatArray:
        gram, sums = np.tensordot(folds, grams, 1), folds @ along
        found: FloatArray = np.clip(inverse_of(gram, ALIKE) @ sums, low, high)
        return found

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
    search = 2.0 * (len(chosen) * (1.0 + np.log(searched)) + more)
    formal = np.sqrt(np.diagonal(inverse_of(grams.sum(axis=0), ROUNDING)))
    jackknife = np.sqrt((n - 1) / n * np.square(others - others.mean(axis=0)).sum(axis=0))
    saved = before - left(others)
    errors, k = np.maximum(formal, jackknife), len(chosen)
    return FittedModel(
        chosen,
        saved / 2.0,
        float(saved.sum() / before.sum()),
        float(left(every).sum() - before.sum() + search),
        every[:k],
        errors[:k],
        mean_of_known(np.array([unit.accuracy for unit in units])),
        ModeShape(every[k:], errors[k:]) if more else None,
    )

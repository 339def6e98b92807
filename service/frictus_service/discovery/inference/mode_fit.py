"""A further mode of the skin, fitted to all people: where it is, and how narrow.

Modes are tested at a grid of frequencies and at one quality. A real one lies between them and
has another quality: what its neighbour on the grid leaves is significant, too, and looks like a
delay, or like a mode elsewhere (at a quality of 2, 450 Hz gains more than the true 300 Hz). So
a mode that is significant is fitted before other causes are sought beside it: frequency and
quality are the same for all people, each share is a person's own. The likelihood has several
maxima, so that the fit begins at several frequencies and qualities.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np
from scipy import stats

from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.effects import KNOWN
from frictus_hardware.physics.effects.skin import SECOND_MODE_QUALITY
from frictus_service.discovery.evidence.residuals import accuracy_of
from frictus_service.discovery.inference.linear_model import project_out
from frictus_service.discovery.inference.linearisation import Linearised, likelihood, linearise
from frictus_service.discovery.inference.mode_shape import MOST_STEP, SHAPE, moved, with_shape
from frictus_service.discovery.problem.candidates import Candidate
from frictus_service.discovery.problem.problem import DiscoveryProblem
from frictus_service.discovery.projection import (
    ROUNDING,
    inverse_of,
    orthogonal_to,
    orthonormal,
)

STEPS: Final = 10
"""Of Gauss and Newton at most; 300 Hz is four from the neighbour of its neighbour."""
SETTLED: Final = 2e-3
"""Of both logarithms: a step that is none."""
QUALITY_RATIOS: Final = (0.4, 1.0, 2.5)
"""Of the quality at which modes are tested: those with which the fit may begin."""
CLIMBED: Final = 2
"""Of the starts, the likeliest."""
LIKELIER: Final = 20.0
"""Nats by which a cause that no test shows must make the readings likelier to be fitted; it is
tested afterwards."""
PRIOR_LOG_QUALITY: Final = 1.0
"""Standard deviation about the quality of the grid: a factor of e. One tone on a mode tells its
share times its quality, and not both."""


@dataclass(frozen=True, slots=True)
class ShapeEstimate:
    """By how much the shape of a mode is off, and how well it is known.

    Attributes
    ----------
    off : ndarray, shape (2,)
        Of the logarithms of frequency and quality.
    covariance : ndarray, shape (2, 2)
        Of these: what noise makes, and how people scatter.
    accuracy : ndarray, shape (2,)
        Of either: what shows as much as measuring is accurate.
    share_slope : ndarray, shape (2,)
        By which the mean share changes with either.
    n_units : int
        People, or blocks of trials.
    """

    off: FloatArray
    covariance: FloatArray
    accuracy: FloatArray
    share_slope: FloatArray
    n_units: int

    @property
    def half_widths(self) -> FloatArray:
        """Of the 95 % intervals of the logarithms of frequency and quality, (2,)."""
        return np.sqrt(np.diagonal(self._squared))

    @property
    def share_half_width(self) -> float:
        """Of the 95 % interval of the mean share, as far as it follows from the shape."""
        return float(np.sqrt(self.share_slope @ self._squared @ self.share_slope))

    @property
    def _squared(self) -> FloatArray:
        quantile = float(stats.t.ppf(0.975, self.n_units - 1))
        # What measuring is wrong by is the same for all: no mean takes it away.
        squared: FloatArray = quantile**2 * self.covariance + np.diag(self.accuracy / 2.0) ** 2
        return squared


def shape_of(problem: DiscoveryProblem, model: Linearised, mode: int) -> ShapeEstimate:
    """Return by how much the shape of a mode in a model is off.

    Parameters
    ----------
    problem : DiscoveryProblem
        Data, base model and candidates.
    model : Linearised
        A fitted model with a mode in it.
    mode : int
        Candidate that is the mode.
    """
    n, place = len(model.chosen), model.chosen.index(mode)
    grams, along, slopes, shown = [], [], [], []
    units = with_shape(problem, model, model, mode)
    for unit, subject, whitening, coefficients in zip(
        units, problem.subjects, model.whitenings, model.coefficients, strict=True
    ):
        rest = unit.readings - unit.effects[:, :n] @ coefficients
        others = np.delete(unit.effects[:, :n], place, axis=1)
        own = orthonormal(np.column_stack([unit.own, others]))
        share, *shape = (orthogonal_to(own, each) for each in unit.effects[:, place:].T)
        derivatives = np.column_stack(shape[-2:])
        # Everybody's share follows the shape.
        slope = share @ derivatives / max(float(share @ share), np.finfo(float).tiny)
        derivatives = derivatives - np.multiply.outer(share, slope)
        rest = orthogonal_to(own, rest)
        grams.append(derivatives.T @ derivatives)
        along.append(derivatives.T @ rest)
        slopes.append(-slope)
        exact = whitening.weight * accuracy_of(subject.layout)
        shown.append(np.max(np.abs(derivatives) / exact[:, np.newaxis], axis=0))
    quality = float(dict(problem.candidates[mode].held).get("quality", SECOND_MODE_QUALITY))
    prior = np.array([0.0, PRIOR_LOG_QUALITY**-2])
    inverse = inverse_of(np.sum(grams, axis=0) + np.diag(prior), ROUNDING)
    towards = prior * np.log(SECOND_MODE_QUALITY / quality)
    off = inverse @ (np.sum(along, axis=0) + towards)
    left = [a - gram @ off for a, gram in zip(along, grams, strict=True)]
    n_units = len(units)
    scatter = inverse @ np.einsum("ui,uj->ij", left, left) @ inverse * n_units / (n_units - 1)
    larger = np.maximum(np.diagonal(inverse) - np.diagonal(scatter), 0.0)
    largest = np.maximum(np.max(shown, axis=0), np.finfo(float).tiny)
    return ShapeEstimate(
        off, scatter + np.diag(larger), 1.0 / largest, np.mean(slopes, axis=0), n_units
    )


def starts_of(problem: DiscoveryProblem) -> list[Candidate]:
    """Return the modes of the grid, each of several qualities."""
    return [
        _inside(problem.candidates[k], np.array([0.0, np.log(ratio)]))
        for k in modes_of(problem)
        for ratio in QUALITY_RATIOS
    ]


def modes_of(problem: DiscoveryProblem) -> list[int]:
    """Return the candidates that are further modes of the skin."""
    return [k for k, each in enumerate(problem.candidates) if each.effect == "second_mode"]


def fit_mode(
    problem: DiscoveryProblem,
    base: Linearised,
    starts: Sequence[Candidate],
    mode: int,
    others: Sequence[int] = (),
) -> DiscoveryProblem:
    """Return the problem in which a mode is at the frequency and quality that are likeliest.

    Parameters
    ----------
    problem : DiscoveryProblem
        Data, base model and candidates.
    base : Linearised
        From whose parameters every fit begins.
    starts : sequence of Candidate
        Modes from the likeliest of which the search begins.
    mode : int
        Number of the candidate that becomes the fitted one.
    others : sequence of int
        Candidates in the model beside it.
    """
    chosen = (mode, *others)
    begun = [_fitted(_with_mode(problem, mode, start), base, chosen) for start in starts]
    begun.sort(key=lambda fit: -fit.likelihood)
    climbed = [_climb(fit, chosen) for fit in begun[:CLIMBED]]
    return max(climbed, key=lambda fit: fit.likelihood).problem


def likeliest_beside(
    problem: DiscoveryProblem, start: Linearised, chosen: Sequence[int]
) -> int | None:
    """Return the cause beside others that makes the readings likeliest, if it is there at all.

    What the scatter about a model hides from every test, the likelihood shows. A mode that was
    fitted alone takes a delay for a part of itself. Near the first mode the base model bends
    mass and stiffness until next to nothing is left of a second one's signature: at 140 Hz and
    a quality of 6 too few people said anything of it, where readings were 200 nats likelier.

    Parameters
    ----------
    problem : DiscoveryProblem
        Data, base model and candidates.
    start : Linearised
        From whose parameters the fits begin.
    chosen : sequence of int
        Causes in the model.

    Returns
    -------
    int or None
        None where no cause that shows as much as measuring is accurate makes the readings
        likelier by `LIKELIER`, beside what its coefficients cost.
    """
    now = _fitted(problem, start, tuple(chosen))
    there = {problem.candidates[k].effect for k in chosen}
    beside = {
        k: _fitted(problem, now.model, (*chosen, k))
        for k, each in enumerate(problem.candidates)
        if each.effect not in there
    }
    more = {
        k: fit.likelihood - now.likelihood - _cost(problem, k)
        for k, fit in beside.items()
        if _shows_last(fit.model)
    }
    best = max(more, key=lambda k: more[k], default=None)
    return None if best is None or more[best] < LIKELIER else best


def _shows_last(model: Linearised) -> bool:
    """Return whether the last cause in a model shows as much as measuring is accurate."""
    mean = np.abs(model.coefficients[:, -1].mean())
    return bool(mean > project_out(model.units).accuracy[-1])


def _cost(problem: DiscoveryProblem, effect: int) -> float:
    """Return by how much coefficients that mean nothing make the readings likelier, nats.

    One each, as in AIC; of what is the finger's, everybody has their own.
    """
    scope = KNOWN[problem.candidates[effect].effect].scope
    return float(len(problem.subjects)) if scope == "participant" else 1.0


class _Fit(NamedTuple):
    """A model, and the problem in which a mode has the shape that was fitted."""

    problem: DiscoveryProblem
    model: Linearised
    likelihood: float


def _fitted(problem: DiscoveryProblem, start: Linearised, chosen: tuple[int, ...]) -> _Fit:
    model = linearise(problem, chosen, wanted=chosen, patterns=(), start=start)
    return _Fit(problem, model, likelihood(problem, model))


def _with_mode(problem: DiscoveryProblem, mode: int, there: Candidate) -> DiscoveryProblem:
    """Return the problem in which a candidate is another mode."""
    candidates = (*problem.candidates[:mode], there, *problem.candidates[mode + 1 :])
    return replace(problem, candidates=candidates)


def _climb(best: _Fit, chosen: tuple[int, ...]) -> _Fit:
    """Return the likeliest fit near one, by steps of Gauss and Newton."""
    mode = chosen[0]
    step = _step(best, mode)
    for _ in range(STEPS):
        if np.all(np.abs(step) < SETTLED):
            break
        there = _inside(best.problem.candidates[mode], step)
        found = _fitted(_with_mode(best.problem, mode, there), best.model, chosen)
        if found.likelihood > best.likelihood:
            best, step = found, _step(found, mode)
        else:
            step = step / 2.0  # what is far from linear leads a whole step astray
    return best


def _step(fit: _Fit, mode: int) -> FloatArray:
    """Return by how much both logarithms move at once."""
    return np.clip(shape_of(fit.problem, fit.model, mode).off, -MOST_STEP, MOST_STEP)


def _inside(mode: Candidate, by: FloatArray) -> Candidate:
    """Return a mode moved as far as its effect accepts."""
    bounds = {p.name: (p.low, p.high) for p in KNOWN[mode.effect].parameters}
    there = dict(moved(mode, by).held)
    held = ((name, float(np.clip(there[name], *bounds[name]))) for name in SHAPE)
    return replace(mode, held=tuple(held))

"""Gauss-Newton over many conditions at once that share one delay per participant.

All residuals are relative, ``z / H - 1``, and the parameters of a condition logarithms, so that
they stay positive. A delay is a property of the channels and not of how the finger slides;
fitted per condition it would take with it half of what the phase says about the cutoff.
"""

from dataclasses import dataclass, replace
from typing import Final, Protocol

import numpy as np
from scipy import stats

from frictus_hardware.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from frictus_service.identification.fit.conditions import Sample
from frictus_service.identification.fit.grouped_errors import (
    GroupVariances,
    Levels,
    log_determinant,
    moments,
    scatter_of,
)

STEP: Final = 0.5
"""Longest step of a logarithm."""
DELAY_STEP_S: Final = 50e-6
STEPS: Final = 60
SETTLED: Final = 1e-5
RIDGE: Final = 1e-6
"""Information about a logarithm that is always there: what is not determined stays put."""


class Law(Protocol):
    """A response without its delay, and its derivatives."""

    def __call__(
        self, log_parameters: FloatArray, tone_hz: FloatArray
    ) -> tuple[ComplexArray, ComplexArray]:
        """Return H, shape (n_rows,), and d ln H / d parameters, (n_rows, p), of all rows."""


@dataclass(frozen=True, slots=True)
class Spreads:
    """Scatter of relative residuals: of size (real part) and of phase (imaginary part)."""

    size: GroupVariances
    phase: GroupVariances


BEGINNINGS: Final = (
    Spreads(size=GroupVariances(0.0, 1e-2), phase=GroupVariances(0.0, 1e-6)),
    Spreads(size=GroupVariances(0.0, 1e-6), phase=GroupVariances(0.0, 1e-2)),
)
"""Phases are sure and sizes scatter, and the reverse.

The scatter is estimated around the fit that it weights. A fit that follows the sizes leaves
residuals of phase, which say that phases scatter, and that it was right to follow the sizes:
such a solution can hold itself up beside the one that follows the phases. From either end the
iteration comes to the solution on its side, and the likelihood compares them.
"""
SCATTER_STEPS: Final = 30
"""Steps after which the scatter stays: a variance next to zero can go to and fro for ever."""
WARM_UP: Final = 2
"""Steps before the scatter is estimated: residuals at the start are those of a coarse grid."""
ALIKE: Final = float(stats.chi2.ppf(0.95, 1)) / 2.0
"""Solutions whose log-likelihoods differ by less explain the data alike."""


@dataclass(frozen=True, slots=True)
class JointFit:
    """Parameters of all conditions, and how sure they are.

    Attributes
    ----------
    log_parameters : ndarray, shape (n_conditions, p)
    delay_s : ndarray, shape (n_people,)
    settled : ndarray of bool, shape (n_conditions,)
    covariance : ndarray, shape (n_conditions, p, p)
        Of the logarithms at a known delay, from the scatter of replicates.
    delay_gradient : ndarray, shape (n_conditions, p)
        By how much the logarithms change per second of delay.
    delay_variance : ndarray, shape (n_people,)
        s²; clustered by trial where `is_clustered`.
    is_clustered : ndarray of bool, shape (n_people,)
        Whether there are trials enough to tell errors by what each pulls: a fit goes through
        the only trial of a condition, however wrong that is.
    influence : ndarray, shape (n_trials, p)
        Change of its condition's logarithms that each trial causes, at a fixed delay.
    delay_influence : ndarray, shape (n_trials,)
        Change of its participant's delay that each trial causes.
    spreads : Spreads
        Standard deviations that rows of a trial or condition share.
    rival_shift : ndarray, shape (n_conditions, p)
        Change of the logarithms to a second solution that explains the data alike; 0 where
        there is none.
    rival_delay_shift_s : ndarray, shape (n_people,)
        Change of the delay to it.
    rival_deficit : float
        By how much the second solution's log-likelihood is lower; infinite without one.
    """

    log_parameters: FloatArray
    delay_s: FloatArray
    settled: BoolArray
    covariance: FloatArray
    delay_gradient: FloatArray
    delay_variance: FloatArray
    is_clustered: BoolArray
    influence: FloatArray
    delay_influence: FloatArray
    spreads: Spreads
    rival_shift: FloatArray
    rival_delay_shift_s: FloatArray
    rival_deficit: float


@dataclass(frozen=True, slots=True)
class Solution:
    """Where a descent ended.

    Attributes
    ----------
    log_parameters, delay_s, settled, spreads
        As in `JointFit`.
    log_likelihood : float
        Without its constant.
    """

    log_parameters: FloatArray
    delay_s: FloatArray
    settled: BoolArray
    spreads: Spreads
    log_likelihood: float


@dataclass(frozen=True, slots=True)
class JointFitProblem:
    """What is fitted to what.

    Attributes
    ----------
    sample : Sample
        Rows that are fitted together.
    law : Law
        Response and its derivatives.
    lowest, highest : ndarray, shape (p,)
        Bounds of the logarithms.
    fit_delay : bool
        Whether the delay is fitted, or stays where it begins.
    """

    sample: Sample
    law: Law
    lowest: FloatArray
    highest: FloatArray
    fit_delay: bool = True

    @property
    def size_levels(self) -> Levels:
        """Sizes deviate by stretch and trial, all tones together."""
        s = self.sample
        return Levels(s.segment, s.trial_of_segment, s.condition_of_trial.size)

    @property
    def phase_levels(self) -> Levels:
        """Phases deviate by row, and by tone of a trial."""
        return Levels(None, self.sample.cell, self.sample.trial_of_cell.size)


def fit(
    problem: JointFitProblem,
    log_parameters: FloatArray,
    delay_s: FloatArray,
    spreads: Spreads | None = None,
) -> JointFit:
    """Fit all conditions of a sample.

    Parameters
    ----------
    problem : JointFitProblem
        Law, rows and prior.
    log_parameters : ndarray, shape (n_conditions, p)
        Where to begin.
    delay_s : ndarray, shape (n_people,)
        Where to begin, or the known delay.
    spreads : Spreads or None
        None: estimated, from replicates and from the scatter of trials around the fit.

    Returns
    -------
    JointFit
        The likelier of the solutions that `BEGINNINGS` lead to.
    """
    if spreads is not None:
        return _conclude(problem, _descend(problem, log_parameters, delay_s, spreads))
    found = [
        _descend(problem, log_parameters, delay_s, begin, estimate_spreads=True)
        for begin in BEGINNINGS
    ]
    best, other = sorted(found, key=lambda each: each.log_likelihood, reverse=True)
    return with_rival(_conclude(problem, best), best, other, problem.sample.people)


def with_rival(fit: JointFit, best: Solution, other: Solution, people: IntArray) -> JointFit:
    """Return a fit that names the other solution where it differs and explains the data alike.

    Solutions that are closer than a standard error are one to whoever reads the interval.

    Parameters
    ----------
    fit : JointFit
        Of the best solution.
    best, other : Solution
        The likelier first.
    people : ndarray of int, shape (n_conditions,)
        Participant of each condition.
    """
    deficit = best.log_likelihood - other.log_likelihood
    shift = other.log_parameters - best.log_parameters
    later = other.delay_s - best.delay_s
    by_delay = np.square(fit.delay_gradient) * fit.delay_variance[people][:, np.newaxis]
    variance = np.einsum("cii->ci", fit.covariance) + by_delay
    apart = np.any((shift**2 > variance) & best.settled[:, np.newaxis], axis=1)
    differs = np.bincount(people, apart, later.size) > 0
    if not (deficit < ALIKE and differs.any()):
        return fit
    return replace(
        fit,
        rival_shift=np.where(differs[people][:, np.newaxis], shift, 0.0),
        rival_delay_shift_s=np.where(differs, later, 0.0),
        rival_deficit=deficit,
    )


@dataclass(frozen=True, slots=True)
class _Step:
    """Normal equations of all conditions at one point."""

    score: FloatArray  # (n_trials, p + 1)
    local: FloatArray  # (n_conditions, p, p), the inverse
    cross: FloatArray  # (n_conditions, p)
    delay: FloatArray  # (n_people,) information on the delay with all else free


def _linearise(
    problem: JointFitProblem, log_parameters: FloatArray, delay_s: FloatArray
) -> tuple[ComplexArray, ComplexArray, FloatArray]:
    """Return d ln H / d (parameters, delay), relative residuals, and certainties."""
    sample = problem.sample
    condition = sample.condition
    law, gradient = problem.law(log_parameters[condition], sample.tone_hz)
    s = 2j * np.pi * sample.tone_hz
    law = law * np.exp(-s * delay_s[sample.people[condition]])
    columns = np.column_stack([gradient, -s])
    certainty = np.square(np.abs(law)) / sample.variance
    return columns, sample.response / law - 1.0, certainty


def _normal(
    problem: JointFitProblem, log_parameters: FloatArray, delay_s: FloatArray, spreads: Spreads
) -> _Step:
    sample = problem.sample
    columns, residual, weight = _linearise(problem, log_parameters, delay_s)
    table = np.column_stack([columns, residual])
    by_trial = moments(table.real, weight, problem.size_levels, spreads.size)
    by_cell = moments(table.imag, weight, problem.phase_levels, spreads.phase)
    np.add.at(by_trial, sample.trial_of_cell, by_cell)
    n, p = log_parameters.shape
    total = np.zeros((n, p + 2, p + 2))
    np.add.at(total, sample.condition_of_trial, by_trial)
    inverse = np.linalg.inv(total[:, :p, :p] + RIDGE * np.eye(p))
    local = inverse.astype(np.float64, copy=False)
    cross = total[:, :p, p]
    own = total[:, p, p] - np.einsum("ci,cij,cj->c", cross, local, cross)
    delay = np.bincount(sample.people, own, delay_s.size).astype(np.float64)
    return _Step(by_trial[:, : p + 1, p + 1], local, cross, delay)


def _influences(problem: JointFitProblem, step: _Step) -> tuple[FloatArray, FloatArray]:
    """Return what each trial pulls: its condition's logarithms, its participant's delay."""
    sample = problem.sample
    condition = sample.condition_of_trial
    local = np.einsum("tij,tj->ti", step.local[condition], step.score[:, :-1])
    if not problem.fit_delay:
        return local, np.zeros(condition.size)
    rest = step.score[:, -1] - np.einsum("ti,ti->t", step.cross[condition], local)
    known = np.maximum(step.delay[sample.people[condition]], np.finfo(float).tiny)
    return local, rest / known


def _descend(
    problem: JointFitProblem,
    log_parameters: FloatArray,
    delay_s: FloatArray,
    spreads: Spreads,
    *,
    estimate_spreads: bool = False,
) -> Solution:
    """Step until nothing moves; weights from the scatter and scatter from the fit together.

    Estimated only between whole descents, the scatter comes closer by a constant factor each
    time, and a fixed number of times leaves the cutoff short of where it would settle.
    """
    sample = problem.sample
    person = sample.people[sample.condition_of_trial]
    longest = np.full(log_parameters.shape[0], np.inf)
    for number in range(STEPS):
        step = _normal(problem, log_parameters, delay_s, spreads)
        local, pull = _influences(problem, step)
        later = np.bincount(person, pull, delay_s.size)
        later = np.clip(later, -DELAY_STEP_S, DELAY_STEP_S)
        change = np.zeros_like(log_parameters)
        np.add.at(change, sample.condition_of_trial, local)
        gradient = -np.einsum("cij,cj->ci", step.local, step.cross)
        change += gradient * later[sample.people][:, np.newaxis]
        longest = np.max(np.abs(change), axis=1)
        change *= np.minimum(1.0, STEP / np.maximum(longest, STEP))[:, np.newaxis]
        log_parameters = np.clip(log_parameters + change, problem.lowest, problem.highest)
        delay_s = delay_s + later
        warm = number + 1 >= WARM_UP
        if estimate_spreads and warm and number < SCATTER_STEPS:
            spreads = _spreads(problem, log_parameters, delay_s)
        if np.all(longest < SETTLED) and (warm or not estimate_spreads):
            break
    inside = (log_parameters > problem.lowest) & (log_parameters < problem.highest)
    return Solution(
        log_parameters,
        delay_s,
        (longest < SETTLED * 100.0) & inside.all(axis=1),
        spreads,
        _log_likelihood(problem, log_parameters, delay_s, spreads),
    )


def _log_likelihood(
    problem: JointFitProblem, log_parameters: FloatArray, delay_s: FloatArray, spreads: Spreads
) -> float:
    """Return the Gaussian log-likelihood of the responses, without its constant.

    The responses are ``H (1 + r)``: besides the density of the residuals stands the area by
    which the response stretches them, ``|H|²`` per row.
    """
    _, residual, weight = _linearise(problem, log_parameters, delay_s)
    stretched = np.log(weight * problem.sample.variance).sum()
    total = -2.0 * stretched
    for part, levels, variances in (
        (residual.real, problem.size_levels, spreads.size),
        (residual.imag, problem.phase_levels, spreads.phase),
    ):
        total -= moments(part[:, np.newaxis], weight, levels, variances).sum()
        total -= log_determinant(weight, levels, variances).sum()
    return float(0.5 * total)


def _spreads(
    problem: JointFitProblem, log_parameters: FloatArray, delay_s: FloatArray
) -> Spreads:
    _, residual, weight = _linearise(problem, log_parameters, delay_s)
    n, p = log_parameters.shape
    # A condition's size takes one degree of freedom, its shape the rest, from both parts alike.
    shape = 0.5 * (p - 1) * n
    return Spreads(
        scatter_of(residual.real, weight, problem.size_levels, n + shape),
        scatter_of(residual.imag, weight, problem.phase_levels, shape),
    )


def _conclude(problem: JointFitProblem, found: Solution) -> JointFit:
    sample = problem.sample
    delay_s = found.delay_s
    step = _normal(problem, found.log_parameters, delay_s, found.spreads)
    local, pull = _influences(problem, step)
    person = sample.people[sample.condition_of_trial]
    trials = np.bincount(person, minlength=delay_s.size)
    conditions = np.bincount(sample.people, minlength=delay_s.size)
    used = 0.5 * (1 + conditions * local.shape[1])
    enough = trials / np.maximum(trials - used, 1.0)
    clustered = trials >= 2 * conditions
    known = 1.0 / np.maximum(step.delay, np.finfo(float).tiny) if problem.fit_delay else 0.0
    return JointFit(
        log_parameters=found.log_parameters,
        delay_s=delay_s,
        settled=found.settled,
        covariance=step.local,
        delay_gradient=-np.einsum("cij,cj->ci", step.local, step.cross),
        delay_variance=np.where(
            clustered, enough * np.bincount(person, pull**2, delay_s.size), known
        ),
        is_clustered=clustered,
        influence=local * np.sqrt(enough[person])[:, np.newaxis],
        delay_influence=pull * np.sqrt(enough[person]),
        spreads=found.spreads,
        rival_shift=np.zeros_like(found.log_parameters),
        rival_delay_shift_s=np.zeros_like(delay_s),
        rival_deficit=np.inf,
    )

"""Gauss-Newton over many conditions at once that share one delay per participant.

All residuals are relative, ``z / H - 1``, and the parameters of a condition logarithms, so that
they stay positive. A delay is a property of the channels and not of how the finger slides;
fitted per condition it would take with it half of what the phase says about the cutoff.
"""

from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np

from frictus_hardware.arrays import BoolArray, ComplexArray, FloatArray
from frictus_service.identification.fit.conditions import Sample
from frictus_service.identification.fit.grouped_errors import (
    GroupVariances,
    Levels,
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


BEGIN: Final = Spreads(GroupVariances(0.0, 0.01), GroupVariances(0.0, 1e-4))


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
        s²; clustered by trial.
    influence : ndarray, shape (n_trials, p)
        Change of its condition's logarithms that each trial causes, at a fixed delay.
    delay_influence : ndarray, shape (n_trials,)
        Change of its participant's delay that each trial causes.
    spreads : Spreads
        Standard deviations that rows of a trial or condition share.
    """

    log_parameters: FloatArray
    delay_s: FloatArray
    settled: BoolArray
    covariance: FloatArray
    delay_gradient: FloatArray
    delay_variance: FloatArray
    influence: FloatArray
    delay_influence: FloatArray
    spreads: Spreads


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
    """
    known = spreads
    spreads = known or BEGIN
    for _ in range(1 if known else 3):  # weights from the scatter, scatter from the fit
        log_parameters, delay_s, settled = _descend(problem, log_parameters, delay_s, spreads)
        if known is None:
            spreads = _spreads(problem, log_parameters, delay_s)
    if known is None:
        log_parameters, delay_s, settled = _descend(problem, log_parameters, delay_s, spreads)
    return _conclude(problem, log_parameters, delay_s, settled, spreads)


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
    problem: JointFitProblem, log_parameters: FloatArray, delay_s: FloatArray, spreads: Spreads
) -> tuple[FloatArray, FloatArray, BoolArray]:
    sample = problem.sample
    settled = np.zeros(log_parameters.shape[0], dtype=np.bool_)
    for _ in range(STEPS):
        step = _normal(problem, log_parameters, delay_s, spreads)
        local, pull = _influences(problem, step)
        person = sample.people[sample.condition_of_trial]
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
        settled = longest < SETTLED * 100.0
        if np.all(longest < SETTLED):
            break
    inside = (log_parameters > problem.lowest) & (log_parameters < problem.highest)
    return log_parameters, delay_s, settled & inside.all(axis=1)


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


def _conclude(
    problem: JointFitProblem,
    log_parameters: FloatArray,
    delay_s: FloatArray,
    settled: BoolArray,
    spreads: Spreads,
) -> JointFit:
    sample = problem.sample
    step = _normal(problem, log_parameters, delay_s, spreads)
    local, pull = _influences(problem, step)
    person = sample.people[sample.condition_of_trial]
    trials = np.bincount(person, minlength=delay_s.size)
    used = 0.5 * (1 + np.bincount(sample.people, minlength=delay_s.size) * local.shape[1])
    enough = trials / np.maximum(trials - used, 1.0)
    return JointFit(
        log_parameters=log_parameters,
        delay_s=delay_s,
        settled=settled,
        covariance=step.local,
        delay_gradient=-np.einsum("cij,cj->ci", step.local, step.cross),
        delay_variance=enough * np.bincount(person, pull**2, delay_s.size),
        influence=local * np.sqrt(enough[person])[:, np.newaxis],
        delay_influence=pull * np.sqrt(enough[person]),
        spreads=spreads,
    )

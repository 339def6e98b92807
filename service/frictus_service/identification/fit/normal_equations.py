"""Residuals of a response with a delay and their normal equations, at one point.

All residuals are relative, ``z / H - 1``, and the parameters of a condition logarithms, so that
they stay positive.
"""

from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np

from frictus_hardware.arrays import ComplexArray, FloatArray
from frictus_service.identification.fit.conditions import Sample
from frictus_service.identification.fit.grouped_errors import (
    GroupVariances,
    Levels,
    moments,
    scatter_of,
)

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


@dataclass(frozen=True, slots=True)
class NormalEquations:
    """Normal equations of all conditions at one point.

    Attributes
    ----------
    by_trial : ndarray, shape (n_trials, p + 2, p + 2)
        Weighted products of a condition's parameters, the delay and the residual.
    local : ndarray, shape (n_conditions, p, p)
        Inverse of the information on the parameters at a known delay.
    cross : ndarray, shape (n_conditions, p)
        Products of the parameters and the delay.
    delay : ndarray, shape (n_people,)
        Information on the delay with all else free.
    """

    by_trial: FloatArray
    local: FloatArray
    cross: FloatArray
    delay: FloatArray

    @property
    def delay_gradient(self) -> FloatArray:
        """Change of the parameters per second of delay, shape (n_conditions, p)."""
        change: FloatArray = -np.einsum("cij,cj->ci", self.local, self.cross)
        return change

    def delay_freedom(self, sample: Sample) -> FloatArray:
        """Return the degrees of freedom of a delay's variance, shape (n_people,).

        By Satterthwaite: as many as there are trials if each tells as much of the delay as any
        other, all parameters of its condition free; fewer if some tell nearly all.

        Parameters
        ----------
        sample : Sample
            What the equations are of.
        """
        condition = sample.condition_of_trial
        person, n = sample.people[condition], self.delay.size
        gradient = self.delay_gradient
        along = np.column_stack([gradient, np.ones(len(gradient))])[condition]
        told = np.einsum("ti,tij,tj->t", along, self.by_trial[:, :-1, :-1], along)
        square = np.maximum(np.bincount(person, told**2, n), np.finfo(float).tiny)
        freedom: FloatArray = np.maximum(np.bincount(person, told, n) ** 2 / square, 1.0)
        return freedom


def linearise(
    problem: JointFitProblem, log_parameters: FloatArray, delay_s: FloatArray
) -> tuple[ComplexArray, ComplexArray, FloatArray]:
    """Return d ln H / d (parameters, delay), relative residuals, and certainties.

    Parameters
    ----------
    problem : JointFitProblem
        Law and rows.
    log_parameters : ndarray, shape (n_conditions, p)
    delay_s : ndarray, shape (n_people,)

    Returns
    -------
    tuple of ndarray
        Of shapes (n_rows, p + 1), (n_rows,) and (n_rows,).
    """
    sample = problem.sample
    condition = sample.condition
    law, gradient = problem.law(log_parameters[condition], sample.tone_hz)
    s = 2j * np.pi * sample.tone_hz
    law = law * np.exp(-s * delay_s[sample.people[condition]])
    columns = np.column_stack([gradient, -s])
    certainty = np.square(np.abs(law)) / sample.variance
    return columns, sample.response / law - 1.0, certainty


def normal_equations(
    problem: JointFitProblem, log_parameters: FloatArray, delay_s: FloatArray, spreads: Spreads
) -> NormalEquations:
    """Return the normal equations at one point.

    Parameters
    ----------
    problem : JointFitProblem
        Law and rows.
    log_parameters : ndarray, shape (n_conditions, p)
    delay_s : ndarray, shape (n_people,)
    spreads : Spreads
        Weights of sizes and phases.
    """
    sample = problem.sample
    columns, residual, weight = linearise(problem, log_parameters, delay_s)
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
    return NormalEquations(by_trial, local, cross, delay)


def influences(
    problem: JointFitProblem, step: NormalEquations
) -> tuple[FloatArray, FloatArray]:
    """Return what each trial pulls: its condition's logarithms, its participant's delay.

    Parameters
    ----------
    problem : JointFitProblem
        Law and rows.
    step : NormalEquations
        Of the problem.

    Returns
    -------
    tuple of ndarray
        Of shapes (n_trials, p), the delay as it is, and (n_trials,), s.
    """
    sample = problem.sample
    condition = sample.condition_of_trial
    score = step.by_trial[:, :-1, -1]
    local = np.einsum("tij,tj->ti", step.local[condition], score[:, :-1])
    if not problem.fit_delay:
        return local, np.zeros(condition.size)
    rest = score[:, -1] - np.einsum("ti,ti->t", step.cross[condition], local)
    known = np.maximum(step.delay[sample.people[condition]], np.finfo(float).tiny)
    return local, rest / known


def spreads_around(
    problem: JointFitProblem, log_parameters: FloatArray, delay_s: FloatArray
) -> Spreads:
    """Return by how much sizes and phases scatter around a fit.

    Parameters
    ----------
    problem : JointFitProblem
        Law and rows.
    log_parameters : ndarray, shape (n_conditions, p)
    delay_s : ndarray, shape (n_people,)
    """
    _, residual, weight = linearise(problem, log_parameters, delay_s)
    n, p = log_parameters.shape
    # A condition's size takes one degree of freedom, its shape the rest, from both parts alike.
    shape = 0.5 * (p - 1) * n
    return Spreads(
        scatter_of(residual.real, weight, problem.size_levels, n + shape),
        scatter_of(residual.imag, weight, problem.phase_levels, shape),
    )

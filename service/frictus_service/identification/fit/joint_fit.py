"""Gauss-Newton over many conditions at once that share one delay per participant.

A delay is a property of the channels and not of how the finger slides;
fitted per condition it would take with it half of what the phase says about the cutoff.
"""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy import stats

from frictus_hardware.arrays import BoolArray, FloatArray, IntArray
from frictus_service.identification.fit.grouped_errors import (
    GroupVariances,
    log_determinant,
    moments,
)
from frictus_service.identification.fit.normal_equations import (
    JointFitProblem,
    Spreads,
    influences,
    linearise,
    normal_equations,
    spreads_around,
)

STEP: Final = 0.5
"""Longest step of a logarithm."""
DELAY_STEP_S: Final = 50e-6
STEPS: Final = 60
SETTLED: Final = 1e-5

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
        s²; by the scatter, or clustered by trial where that is larger and `is_clustered`.
    delay_freedom : ndarray, shape (n_people,)
        Degrees of freedom of `delay_variance`: of a few tones that tell nearly all of it.
    freedom : ndarray, shape (n_people,)
        Degrees of freedom of the scatter, that of `covariance`.
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
    delay_freedom: FloatArray
    freedom: FloatArray
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
        step = normal_equations(problem, log_parameters, delay_s, spreads)
        local, pull = influences(problem, step)
        later = np.bincount(person, pull, delay_s.size)
        later = np.clip(later, -DELAY_STEP_S, DELAY_STEP_S)
        change = np.zeros_like(log_parameters)
        np.add.at(change, sample.condition_of_trial, local)
        change += step.delay_gradient * later[sample.people][:, np.newaxis]
        longest = np.max(np.abs(change), axis=1)
        change *= np.minimum(1.0, STEP / np.maximum(longest, STEP))[:, np.newaxis]
        log_parameters = np.clip(log_parameters + change, problem.lowest, problem.highest)
        delay_s = delay_s + later
        warm = number + 1 >= WARM_UP
        if estimate_spreads and warm and number < SCATTER_STEPS:
            spreads = spreads_around(problem, log_parameters, delay_s)
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
    _, residual, weight = linearise(problem, log_parameters, delay_s)
    stretched = np.log(weight * problem.sample.variance).sum()
    total = -2.0 * stretched
    for part, levels, variances in (
        (residual.real, problem.size_levels, spreads.size),
        (residual.imag, problem.phase_levels, spreads.phase),
    ):
        total -= moments(part[:, np.newaxis], weight, levels, variances).sum()
        total -= log_determinant(weight, levels, variances).sum()
    return float(0.5 * total)


def _conclude(problem: JointFitProblem, found: Solution) -> JointFit:
    sample = problem.sample
    delay_s = found.delay_s
    step = normal_equations(problem, found.log_parameters, delay_s, found.spreads)
    local, pull = influences(problem, step)
    person = sample.people[sample.condition_of_trial]
    trials = np.bincount(person, minlength=delay_s.size)
    tones = np.bincount(person[sample.trial_of_cell], minlength=delay_s.size)
    conditions = np.bincount(sample.people, minlength=delay_s.size)
    used = 0.5 * (1 + conditions * local.shape[1])
    clustered = trials >= 2 * conditions
    freedom = np.maximum(np.where(clustered, trials, tones) - used, 1.0)
    variance = np.zeros_like(delay_s)
    if problem.fit_delay:
        variance = 1.0 / np.maximum(step.delay, np.finfo(float).tiny)
    enough = np.sqrt(trials / np.maximum(trials - used, 1.0))[person]
    local, pull = local * enough[:, np.newaxis], pull * enough
    # Where two or three tones tell nearly all of the delay, the fit goes through them, and what
    # they pull says little: half of the error. The scatter then says more.
    pulled = np.bincount(person, pull**2, delay_s.size)
    larger = np.where(clustered, np.maximum(variance, pulled), variance)
    pull = pull * np.sqrt(larger / np.where(pulled > 0.0, pulled, 1.0))[person]
    return JointFit(
        log_parameters=found.log_parameters,
        delay_s=delay_s,
        settled=found.settled,
        covariance=step.local,
        delay_gradient=step.delay_gradient,
        delay_variance=larger,
        delay_freedom=np.where(clustered, step.delay_freedom(sample), freedom),
        freedom=freedom,
        is_clustered=clustered,
        influence=local,
        delay_influence=pull,
        spreads=found.spreads,
        rival_shift=np.zeros_like(found.log_parameters),
        rival_delay_shift_s=np.zeros_like(delay_s),
        rival_deficit=np.inf,
    )

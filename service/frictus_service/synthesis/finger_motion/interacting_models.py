"""Interacting models of how a finger moves (Blom and Bar-Shalom 1988), step by step.

One model is for a finger that keeps its speed, one for one that strokes back and forth, and one
for a sharp turn. Each follows position, velocity, acceleration and gravity along each axis, and
is weighted by how well it predicted what was measured.

The compiled code counts through its few numbers: whole-array expressions of 4 by 4 take the
compiler ten seconds of a first start, and run no faster.
"""

from typing import Final, NamedTuple

import numpy as np
from numba import njit

MODELS: Final = 3


class InertialTuning(NamedTuple):
    """What the filters assume of fingers and of the sensors.

    Attributes
    ----------
    report_sd_mm : float
        Of a report: 0.1 mm steps and tremor.
    acceleration_mm_s2, lasts_s, swing_hz : tuple of float
        Of each model: standard deviation of the acceleration, how long one lasts (Singer 1970),
        and how often the velocity swings about zero.
    stay : float
        Probability that a finger goes on as it did, over `stay_s`.
    stay_s : float
        What `stay` is the probability for.
    gravity_mm_s2, gravity_s : float
        Standard deviation of what gravity adds along the screen, and how long that lasts.
    likelihood_share : float
        Exponent of the likelihood of an acceleration: its averages overlap.
    """

    report_sd_mm: float = 0.04
    acceleration_mm_s2: tuple[float, float, float] = (30.0, 350.0, 2000.0)
    lasts_s: tuple[float, float, float] = (0.05, 0.6, 0.05)
    swing_hz: tuple[float, float, float] = (0.0, 0.9, 0.0)
    stay: float = 0.99
    stay_s: float = 0.005
    gravity_mm_s2: float = 300.0
    gravity_s: float = 3.0
    likelihood_share: float = 0.3


DEFAULT: Final = InertialTuning()


@njit(cache=True, nogil=True)
def transition(tuning, m, step_s):  # type: ignore[no-untyped-def]
    """Return the transition matrix of the four states over a step.

    ``a' = -a / lasts - swing^2 v``, ``b' = -b / gravity``; the exponential of the matrix by its
    series, which converges to rounding for steps of 0.05 s; longer ones are halved, then
    squared.
    """
    halvings = 0
    while step_s > 0.05:
        step_s *= 0.5
        halvings += 1
    swing = -((2.0 * np.pi * tuning.swing_hz[m]) ** 2) * step_s
    spend = -step_s / tuning.lasts_s[m]
    move = np.eye(4)
    term = np.eye(3)
    for k in range(1, 16):
        for row in range(3):  # times the rates, of which most are zero
            position, velocity, acceleration = term[row, 0], term[row, 1], term[row, 2]
            term[row, 0] = 0.0
            term[row, 1] = (position * step_s + acceleration * swing) / k
            term[row, 2] = (velocity * step_s + acceleration * spend) / k
            for column in range(1, 3):
                move[row, column] += term[row, column]
    move[3, 3] = np.exp(-step_s / tuning.gravity_s)
    for _ in range(halvings):
        squared = np.zeros((4, 4))
        for row in range(4):
            for column in range(4):
                for k in range(4):
                    squared[row, column] += move[row, k] * move[k, column]
        move = squared
    return move


@njit(cache=True, nogil=True)
def mix(stay, old_mean, old_cov, old_weight, mean, cov, weight):  # type: ignore[no-untyped-def]
    """Write the mixed initial condition of each model, by the transition probabilities.

    The models differ in their estimate of gravity, but gravity does not change where the motion
    does: this spread is left out, or the steady model would take the acceleration of a turn for
    gravity.
    """
    leave = (1.0 - stay) / (MODELS - 1)
    for to in range(MODELS):
        total = 0.0
        for m in range(MODELS):
            total += (stay if m == to else leave) * old_weight[m]
        weight[to] = total
        for axis in range(2):
            for row in range(4):
                mixed = 0.0
                for m in range(MODELS):
                    share = (stay if m == to else leave) * old_weight[m] / total
                    mixed += share * old_mean[m, axis, row]
                mean[to, axis, row] = mixed
            for row in range(4):
                for column in range(4):
                    mixed = 0.0
                    for m in range(MODELS):
                        share = (stay if m == to else leave) * old_weight[m] / total
                        spread = old_cov[m, axis, row, column]
                        if row < 3 and column < 3:
                            apart = old_mean[m, axis, row] - mean[to, axis, row]
                            beside = old_mean[m, axis, column] - mean[to, axis, column]
                            spread += apart * beside
                        mixed += share * spread
                    cov[to, axis, row, column] = mixed


@njit(cache=True, nogil=True)
def propagate(tuning, step_s, mean, cov):  # type: ignore[no-untyped-def]
    """Propagate mean and covariance of every model over a step without measurements."""
    first = np.empty((4, 4))
    after = np.empty(4)
    jerked = np.array([step_s**3 / 6.0, step_s**2 / 2.0, step_s])
    for m in range(MODELS):
        move = transition(tuning, m, step_s)
        # White jerk that keeps the acceleration at its spread; enough for steps below lasts_s.
        noise = 2.0 * tuning.acceleration_mm_s2[m] ** 2 / tuning.lasts_s[m] / step_s
        for axis in range(2):
            for row in range(4):
                after[row] = 0.0
                for k in range(4):
                    after[row] += move[row, k] * mean[m, axis, k]
            for row in range(4):
                mean[m, axis, row] = after[row]
            for row in range(4):
                for column in range(4):
                    first[row, column] = 0.0
                    for k in range(4):
                        first[row, column] += move[row, k] * cov[m, axis, k, column]
            for row in range(4):
                for column in range(4):
                    spread = 0.0
                    for k in range(4):
                        spread += first[row, k] * move[column, k]
                    if row < 3 and column < 3:
                        spread += noise * jerked[row] * jerked[column]
                    cov[m, axis, row, column] = spread
            tilted = 2.0 * tuning.gravity_mm_s2**2 / tuning.gravity_s * step_s
            cov[m, axis, 3, 3] += tilted


@njit(cache=True, nogil=True)
def update(miss, spread, one, other, mean, cov):  # type: ignore[no-untyped-def]
    """Update one axis of one model by a measurement of one state, or of the sum of two.

    Parameters
    ----------
    miss, spread : float
        Innovation, and its variance.
    one, other : int
        The states whose sum was measured; twice the same for one of them.
    mean, cov : ndarray, shape (4,) and (4, 4)
        Changed.
    """
    cross = np.empty(4)
    for row in range(4):
        cross[row] = cov[row, one]
        if other != one:
            cross[row] += cov[row, other]
    for row in range(4):
        mean[row] += cross[row] / spread * miss
        for column in range(4):
            cov[row, column] -= cross[row] * cross[column] / spread
    for row in range(4):  # rounding must not make it indefinite
        cov[row, row] = max(cov[row, row], 1e-12)


@njit(cache=True, nogil=True)
def reweight(log_likelihood, weight):  # type: ignore[no-untyped-def]
    """Weigh each model by the likelihood of what was measured; none is ever ruled out."""
    best = np.max(log_likelihood)
    total = 0.0
    for m in range(MODELS):
        weight[m] *= np.exp(log_likelihood[m] - best)
        total += weight[m]
    for m in range(MODELS):
        weight[m] = min(max(weight[m] / total, 1e-3), 1.0)

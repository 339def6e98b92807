"""Position and velocity of a finger, from touch reports alone.

The sensor reports 60 times a second, in steps of 0.1 mm, tens of milliseconds late. Two
Kalman filters run side by side, one for a finger that keeps its speed and one for a finger
that changes it, and are weighted by how well each predicted the reports (interacting multiple
models; Blom and Bar-Shalom 1988). A single filter is either noisy on steady strokes or late
on free ones.

The compiled code counts through its few numbers: whole-array expressions of 3 by 3 take the
compiler ten seconds of a first start, and run no faster.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from frictus_hardware.arrays import FloatArray

STEADY, CHANGING = 0, 1


class TouchTuning(NamedTuple):
    """What the filters assume of fingers and of the sensor."""

    report_sd_mm: float = 0.04
    """Of a report: 0.1 mm steps and tremor."""
    steady_sd_mm_s2: float = 20.0
    """Acceleration of a finger that keeps its speed."""
    steady_time_s: float = 0.05
    """How long such an acceleration lasts."""
    changing_sd_mm_s2: float = 350.0
    """Acceleration of a finger that starts, stops or turns."""
    changing_time_s: float = 0.6
    """How long such an acceleration lasts (Singer 1970)."""
    turning_hz: float = 0.9
    """Strokes go back and forth: a changing velocity swings about zero this often."""
    stay: float = 0.97
    """Probability that a finger goes on as it did, from report to report."""


class TouchFilter:
    """Follows a finger from report to report.

    Parameters
    ----------
    tuning : TouchTuning
        What is assumed of fingers and of the sensor.
    """

    def __init__(self, tuning: TouchTuning = TouchTuning()) -> None:  # noqa: B008 - frozen
        self._tuning = tuning
        # [model, axis, (position, velocity, acceleration)]; both axes share their covariance.
        self._mean = np.zeros((2, 2, 3))
        self._cov = np.zeros((2, 3, 3))
        self._weight = np.array([0.5, 0.5])
        self._predicted = np.zeros((2, 2))
        self._time_s = -np.inf

    def begin(
        self,
        time_s: float,
        position_mm: tuple[float, float],
        velocity_mm_s: tuple[float, float],
    ) -> None:
        """Begin anew where a finger was.

        Parameters
        ----------
        time_s : float
            When it was there.
        position_mm, velocity_mm_s : tuple of float
            Along x and y.
        """
        self._time_s = time_s
        _begin(position_mm, velocity_mm_s, self._mean, self._cov, self._weight)

    def observe(self, time_s: float, x_mm: float, y_mm: float) -> None:
        """Take a report; one that is not newer than the last is ignored.

        Parameters
        ----------
        time_s : float
            When the finger was there.
        x_mm, y_mm : float
            Where.
        """
        since_s = time_s - self._time_s
        if not 0.0 < since_s < np.inf:
            return
        self._time_s = time_s
        _observe(self._tuning, x_mm, y_mm, since_s, self._mean, self._cov, self._weight)

    def predict(self, time_s: float) -> FloatArray:
        """Return position and velocity at a time, shape (2 axes, 2); valid until the next."""
        ahead_s = time_s - self._time_s if self._time_s > -np.inf else 0.0
        _predict(self._tuning, max(ahead_s, 0.0), self._mean, self._weight, self._predicted)
        return self._predicted


@njit(cache=True, nogil=True)
def _begin(position, velocity, mean, cov, weight):  # type: ignore[no-untyped-def]
    mean[:] = 0.0
    for axis in range(2):
        mean[:, axis, 0] = position[axis]
        mean[:, axis, 1] = velocity[axis]
    cov[:] = 0.0
    cov[:, 0, 0] = 0.05**2
    cov[:, 1, 1] = 80.0**2
    cov[STEADY, 2, 2] = 10.0**2
    cov[CHANGING, 2, 2] = 500.0**2
    weight[STEADY] = 0.2
    weight[CHANGING] = 0.8


@njit(cache=True, nogil=True)
def _model(tuning, model):  # type: ignore[no-untyped-def]
    if model == STEADY:
        return tuning.steady_time_s, tuning.steady_sd_mm_s2, 0.0
    return tuning.changing_time_s, tuning.changing_sd_mm_s2, 2.0 * np.pi * tuning.turning_hz


@njit(cache=True, nogil=True)
def _transition(time_s, turning, step_s):  # type: ignore[no-untyped-def]
    """Return how position, velocity and acceleration go on over a step, undisturbed.

    ``a' = -a / time - turning^2 v``; the exponential of the matrix by its series, which
    converges to rounding for steps of a fifth of a second; longer ones
    are halved, then squared.
    """
    halvings = 0
    while step_s > 0.2:
        step_s *= 0.5
        halvings += 1
    swing, spend = -(turning**2) * step_s, -step_s / time_s
    move = np.eye(3)
    term = np.eye(3)
    for k in range(1, 25):
        for row in range(3):  # times the rates, of which most are zero
            velocity, acceleration = term[row, 1], term[row, 2]
            term[row, 1] = (term[row, 0] * step_s + acceleration * swing) / k
            term[row, 2] = (velocity * step_s + acceleration * spend) / k
            term[row, 0] = 0.0
            for column in range(1, 3):
                move[row, column] += term[row, column]
    for _ in range(halvings):
        move = _product(move, move)
    return move


@njit(cache=True, nogil=True)
def _product(left, right):  # type: ignore[no-untyped-def]
    product = np.zeros((3, 3))
    for row in range(3):
        for column in range(3):
            for k in range(3):
                product[row, column] += left[row, k] * right[k, column]
    return product


@njit(cache=True, nogil=True)
def _mix(stay, mean, cov, weight):  # type: ignore[no-untyped-def]
    """Let each model start from where both, by their weights, may have changed into it."""
    old_mean, old_cov = mean.copy(), cov.copy()
    old = weight[0], weight[1]
    for to in range(2):
        other = 1 - to
        total = stay * old[to] + (1.0 - stay) * old[other]
        kept = stay * old[to] / total
        left = 1.0 - kept
        for row in range(3):
            for axis in range(2):
                mean[to, axis, row] = (
                    kept * old_mean[to, axis, row] + left * old_mean[other, axis, row]
                )
            for column in range(3):
                # The axes share a covariance: the spread is the mean over both.
                spread = 0.0
                for axis in range(2):
                    apart = old_mean[to, axis, row] - old_mean[other, axis, row]
                    beside = old_mean[to, axis, column] - old_mean[other, axis, column]
                    spread += 0.5 * apart * beside
                cov[to, row, column] = (
                    kept * old_cov[to, row, column]
                    + left * old_cov[other, row, column]
                    + kept * left * spread
                )
        weight[to] = total


@njit(cache=True, nogil=True)
def _observe(tuning, x, y, since_s, mean, cov, weight):  # type: ignore[no-untyped-def]
    _mix(tuning.stay, mean, cov, weight)
    report = x, y
    likelihood = np.zeros(2)
    for m in range(2):
        time_s, sd, turning = _model(tuning, m)
        move = _transition(time_s, turning, since_s)
        # White jerk that keeps the acceleration at its spread; enough for steps below time_s.
        noise = 2.0 * sd * sd / time_s / since_s
        jerked = since_s**3 / 6.0, since_s**2 / 2.0, since_s
        carried = _product(_product(move, cov[m]), move.T)
        for row in range(3):
            for column in range(3):
                carried[row, column] += noise * jerked[row] * jerked[column]
        spread = carried[0, 0] + tuning.report_sd_mm**2
        gain = carried[0, 0] / spread, carried[1, 0] / spread, carried[2, 0] / spread
        for axis in range(2):
            was = mean[m, axis, 0], mean[m, axis, 1], mean[m, axis, 2]
            for row in range(3):
                mean[m, axis, row] = (
                    move[row, 0] * was[0] + move[row, 1] * was[1] + move[row, 2] * was[2]
                )
            miss = report[axis] - mean[m, axis, 0]
            for row in range(3):
                mean[m, axis, row] += gain[row] * miss
            likelihood[m] -= 0.5 * miss * miss / spread
        likelihood[m] -= np.log(spread)
        for row in range(3):  # what the report tells, and both halves alike
            for column in range(3):
                told = gain[row] * carried[0, column] + gain[column] * carried[0, row]
                both = carried[row, column] + carried[column, row]
                cov[m, row, column] = 0.5 * (both - told)
    best = max(likelihood[0], likelihood[1])
    for m in range(2):
        weight[m] *= np.exp(likelihood[m] - best)
    total = weight[0] + weight[1]
    for m in range(2):
        weight[m] = min(max(weight[m] / total, 1e-3), 1.0 - 1e-3)


@njit(cache=True, nogil=True)
def _predict(tuning, ahead_s, mean, weight, out):  # type: ignore[no-untyped-def]
    out[:] = 0.0
    for m in range(2):
        time_s, _, turning = _model(tuning, m)
        move = _transition(time_s, turning, ahead_s)
        for axis in range(2):
            for row in range(2):
                for column in range(3):
                    out[axis, row] += weight[m] * move[row, column] * mean[m, axis, column]

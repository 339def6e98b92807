"""Where the finger will be when a sample is played.

The touch sensor reports 60 times a second, in steps of 0.1 mm, tens of milliseconds late, and
what is rendered now is played a lead later. Two Kalman filters run side by side, one for a
finger that keeps its speed and one for a finger that changes it, and are weighted by how well
each foretold the reports (interacting multiple models; Blom and Bar-Shalom 1988). A single
filter is either noisy on steady strokes or late on free ones.

The estimate jumps with every report; what is rendered must not, or the drive would need several
times its range. So the rendered position moves continuously, and small corrections enter as
velocity. Where the finger did not turn as foretold the rendered position is left behind by more
than a correction can make good without a false speed: it is then cross-faded to the right one,
as it is where a contact begins.

The compiled code counts through its few numbers: whole-array expressions of 3 by 3 take the
compiler ten seconds of a first start, and run no faster.
"""

from typing import Final, NamedTuple

import numpy as np
from numba import njit

from frictus_hardware.arrays import FloatArray
from frictus_hardware.base import TouchReport
from frictus_service.synthesis.kernel import BlockMotion

STEADY, CHANGING = 0, 1
USUAL_FORCE_N: Final = 0.4
"""How hard a finger presses until that is measured."""


class EstimatorTuning(NamedTuple):
    """What the estimator assumes of fingers and of the sensor."""

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
    correct_time_s: float = 0.15
    """Within which the rendered position closes up on the estimate."""
    correct_share: float = 0.05
    """Largest correction, as a share of the speed."""
    correct_least_mm_s: float = 1.0
    """What a correction may always be."""
    slip_mm: float = 0.5
    """Error of the rendered position beyond which it is cross-faded to the right one."""
    stale_s: float = 0.1
    """Age of the last report beyond which nothing is rendered."""


DEFAULT_TUNING: Final = EstimatorTuning()


class PredictedMotion(NamedTuple):
    """What is rendered during a block.

    Attributes
    ----------
    motion : BlockMotion
        Of the finger during the block.
    left : BlockMotion or None
        The motion that is left for `motion` by a cross-fade over the block.
    normal_force_n : tuple of float
        How hard the finger presses at the first sample and at the one after the last.
    """

    motion: BlockMotion
    left: BlockMotion | None = None
    normal_force_n: tuple[float, float] = (USUAL_FORCE_N, USUAL_FORCE_N)


class FingerEstimator:
    """Follows the reports of a touch sensor and predicts the finger's motion.

    Parameters
    ----------
    sample_rate_hz : float
        Samples per second of the device's clock.
    tuning : EstimatorTuning
        Noise and turning rates of the filters.
    """

    def __init__(self, sample_rate_hz: float, tuning: EstimatorTuning = DEFAULT_TUNING) -> None:
        self._rate_hz = sample_rate_hz
        self._tuning = tuning
        # [model, axis, (position, velocity, acceleration)]; both axes share their covariance.
        self._mean = np.zeros((2, 2, 3))
        self._cov = np.zeros((2, 3, 3))
        self._weight = np.array([0.5, 0.5])
        self._predicted = np.zeros((2, 2))
        self._mean_sample = -np.inf  # of the last report in contact
        self._report_sample = -np.inf
        # Position and velocity of what is rendered, and the velocity that was foretold a block
        # ago; each (x, y).
        self._rendered = np.zeros((3, 2))
        self._motions = np.empty((2, 8))
        self._force_n = self._force_before_n = USUAL_FORCE_N
        self.in_contact = False

    def press(self, normal_force_n: float) -> None:
        """Take the measured normal force of a block; one without contact is ignored.

        It changes slowly beside the time from measuring to playing, and is not foretold.
        """
        if self.in_contact and 0.0 < normal_force_n < np.inf:
            self._force_n = normal_force_n

    def observe(self, report: TouchReport) -> None:
        """Take a report; one older than the last, or not finite, is ignored."""
        if not np.all(np.isfinite((report.measured_sample, report.x_mm, report.y_mm))):
            return
        since_s = (report.measured_sample - self._report_sample) / self._rate_hz
        if since_s <= 0.0:
            return
        began = report.in_contact and (not self.in_contact or since_s > self._tuning.stale_s)
        self._report_sample = report.measured_sample
        self.in_contact = report.in_contact
        if not report.in_contact:
            return  # what fades out now goes on as it did
        self._mean_sample = report.measured_sample
        if began:
            _begin(report.x_mm, report.y_mm, self._mean, self._cov, self._weight)
            return
        _observe(
            self._tuning, report.x_mm, report.y_mm, since_s, self._mean, self._cov, self._weight
        )

    def report_age_s(self, sample: float) -> float:
        """Return how old the last report is at a device sample; infinite before the first."""
        return float(sample - self._report_sample) / self._rate_hz

    def stale(self, sample: float) -> bool:
        """Return whether reports have stopped coming."""
        return self.report_age_s(sample) > self._tuning.stale_s

    def estimate(self, sample: float) -> FloatArray:
        """Return the prediction for a device sample, shape (2 axes, position and velocity)."""
        age_s = (sample - self._mean_sample) / self._rate_hz
        _predict(
            self._tuning,
            max(age_s, 0.0) if self._mean_sample > -np.inf else 0.0,
            self._mean,
            self._weight,
            self._predicted,
        )
        return self._predicted

    def predict(self, first_sample: int, n_samples: int) -> PredictedMotion:
        """Return the rendered motion from `first_sample` on, continuous from block to block.

        Parameters
        ----------
        first_sample : int
            Device index at which the block will start to play.
        n_samples : int
            Of the block.
        """
        slipped = _follow(
            self._tuning,
            n_samples / self._rate_hz,
            self.estimate(first_sample + n_samples),
            self._rendered,
            self._motions,
        )
        rows = self._motions.tolist()
        left = BlockMotion(*rows[1]) if slipped else None
        pressed = self._force_before_n, self._force_n
        self._force_before_n = self._force_n
        return PredictedMotion(BlockMotion(*rows[0]), left, pressed)


@njit(cache=True, nogil=True)
def _begin(x, y, mean, cov, weight):  # type: ignore[no-untyped-def]
    mean[:] = 0.0
    mean[:, 0, 0] = x
    mean[:, 1, 0] = y
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


@njit(cache=True, nogil=True)
def _follow(tuning, block_s, after, rendered, motions):  # type: ignore[no-untyped-def]
    """Let what is rendered follow the prediction over a block; return whether it was left.

    Parameters
    ----------
    tuning : EstimatorTuning
        Noise and turning rates of the filters.
    block_s : float
        Length of the block.
    after : ndarray, shape (2 axes, position and velocity)
        Predicted for the block's end.
    rendered : ndarray, shape (3, 2 axes)
        Position, velocity, and the velocity that was predicted a block ago. Changed.
    motions : ndarray, shape (2, 8)
        The fields of `BlockMotion`: the motion to render and, where it was left, the former.
    """
    position, velocity, before = rendered[0], rendered[1], rendered[2]
    behind = np.empty(2)
    for axis in range(2):
        covered = 0.5 * (velocity[axis] + after[axis, 1]) * block_s
        behind[axis] = after[axis, 0] - (position[axis] + covered)
    slipped = np.hypot(behind[0], behind[1]) > tuning.slip_mm
    speeds = np.hypot(before[0], before[1]), np.hypot(after[0, 1], after[1, 1])
    for row in range(2):
        motions[row, 6], motions[row, 7] = speeds
    limit = max(tuning.correct_share * speeds[1], tuning.correct_least_mm_s)
    for axis in range(2):
        later = after[axis, 1]
        if slipped:
            motions[1, axis], motions[1, 2 + axis] = position[axis], velocity[axis]
            motions[1, 4 + axis] = later
            velocity[axis] = before[axis]
            position[axis] = after[axis, 0] - 0.5 * (before[axis] + later) * block_s
        else:
            later += min(max(behind[axis] / tuning.correct_time_s, -limit), limit)
        motions[0, axis], motions[0, 2 + axis] = position[axis], velocity[axis]
        motions[0, 4 + axis] = later
        position[axis] += 0.5 * (velocity[axis] + later) * block_s
        velocity[axis] = later
        before[axis] = after[axis, 1]
    return slipped

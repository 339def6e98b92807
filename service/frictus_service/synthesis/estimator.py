"""Where the finger will be when a sample is played.

What is rendered now is played a lead later, and the touch sensor is tens of milliseconds
late. Two filters follow the finger: one from touch reports alone, and one from the
acceleration of the nail as well. The predictions of both are compared with the reports of
their time when these arrive, and the better filter is used: a sensor that has failed, came
loose or is mounted in another orientation than configured costs no more than what it added.

The estimate jumps with every report; what is rendered must not, or the drive would need
several times its range. The rendered position moves continuously, and small corrections enter
as velocity. Where the finger did not turn as predicted, the rendered position is behind by
more than a correction can make good without a false speed: it is then cross-faded to the
right one, as it is where a contact begins, and where one filter replaces the other.
"""

import math
from collections import deque
from typing import Final, NamedTuple

import numpy as np
from numba import njit

from frictus.block import FingerSensor
from frictus_hardware.arrays import FloatArray
from frictus_hardware.base import TouchReport
from frictus_service.synthesis.finger_motion.contact import STILL_S, ContactDetector
from frictus_service.synthesis.finger_motion.filter_judge import FilterJudge
from frictus_service.synthesis.finger_motion.inertial_filter import InertialFilter
from frictus_service.synthesis.finger_motion.nail_acceleration import (
    Acceleration,
    NailAcceleration,
)
from frictus_service.synthesis.finger_motion.report_instants import ReportInstants
from frictus_service.synthesis.finger_motion.touch_filter import TouchFilter
from frictus_service.synthesis.kernel import BlockMotion

USUAL_FORCE_N: Final = 0.4
"""How hard a finger presses until that is measured."""
JUMP_MM: Final = 6.0
"""From where a report was expected; a turn at 300 mm/s leaves less within a report's time."""
FASTEST_MM_S: Final = 300.0
"""A finger that seems to come down faster was put somewhere else."""
FARTHEST_MM: Final = 1e4
"""No screen reaches so far: what is reported beyond it is no place."""
SILENT_S: Final = 0.05
"""Without acceleration for so long, touch alone predicts better."""


class EstimatorTuning(NamedTuple):
    """How what is rendered follows the estimate."""

    correct_time_s: float = 0.06
    """Within which the rendered position closes up on the estimate."""
    correct_share: float = 0.1
    """Largest correction, as a share of the speed."""
    correct_least_mm_s: float = 1.0
    """What a correction may always be."""
    slip_mm: float = 0.3
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
    """Predicts the finger's motion from whatever sensors there are.

    Parameters
    ----------
    sample_rate_hz : float
        Samples per second of the device's clock.
    tuning : EstimatorTuning
        How what is rendered follows the estimate.
    fuses : bool
        Whether acceleration and force are used; else touch alone.
    """

    def __init__(
        self,
        sample_rate_hz: float,
        tuning: EstimatorTuning = DEFAULT_TUNING,
        fuses: bool = True,
    ) -> None:
        self._rate_hz = sample_rate_hz
        self._tuning = tuning
        self._fuses = fuses
        self._contact = ContactDetector()
        self._touch = TouchFilter()
        self._nail: NailAcceleration | None = None
        self._inertial: InertialFilter | None = None
        self._judge = FilterJudge()
        self._instants = ReportInstants()
        self._places: deque[tuple[float, float, float]] = deque(maxlen=2)  # time, x and y
        self._reported = False  # whether the last of them was of a finger on the screen
        self._newest_sample = -np.inf
        self._moved_sample = -np.inf  # of the last that was not of the place of the one before
        self._report_sample = -np.inf  # of the last that was believed
        self._follows = False
        self._next_sample: int | None = None
        self._sensed_end = np.inf
        self._silent_s = np.inf
        # Position and velocity of what is rendered, and the velocity that was predicted a block
        # ago; each (x, y).
        self._rendered = np.zeros((3, 2))
        self._motions = np.empty((2, 8))
        self._force_n = self._force_before_n = USUAL_FORCE_N

    @property
    def in_contact(self) -> bool:
        """Whether the finger touches."""
        return self._contact.in_contact

    @property
    def fused(self) -> bool:
        """Whether the acceleration of the nail is used."""
        inertial = self._inertial
        return (
            inertial is not None
            and inertial.follows
            and self._silent_s < SILENT_S
            and self._judge.better
        )

    def sensors(self, sample: float) -> FingerSensor:
        """Return what the estimate comes from at a device sample."""
        used = 0 if self.stale(sample) else FingerSensor.TOUCH.value
        if self.fused:
            used |= FingerSensor.ACCELERATION.value
        if self._contact.by_force:
            used |= FingerSensor.FORCE.value
        return FingerSensor(used)

    def sense(
        self,
        first_sample: int,
        force_n: FloatArray,
        accel_m_s2: FloatArray,
        saturated: bool = False,
    ) -> None:
        """Take the force and acceleration of a block.

        Parameters
        ----------
        first_sample : int
            Device index; where it does not follow the block before, samples are missing.
        force_n, accel_m_s2 : ndarray, shape (n_samples, 3)
            Of the finger on the screen, and of its nail.
        saturated : bool
            Whether an acceleration was at the end of its range.
        """
        n_samples = force_n.shape[0]
        normal_n = force_n[:, 2]
        self._sensed_end = end = first_sample + n_samples
        if self._fuses:
            block_s = n_samples / self._rate_hz
            reported = not self.stale(end)
            self._contact.sense(normal_n, block_s, reported)
            acceleration = self._accelerated(first_sample, force_n, accel_m_s2, saturated)
            self._silent_s = 0.0 if acceleration is not None else self._silent_s + block_s
            assert self._inertial is not None
            follows = self.in_contact and reported
            self._inertial.follow(end / self._rate_hz, acceleration, follows)
            if not self.in_contact:
                self._follows = False
            elif not self._follows and reported:
                self._begin()  # it has come down where it was seen above the screen
        normal_force_n = float(np.add.reduce(normal_n) / n_samples)
        # It changes slowly beside the time from measuring to playing, and is not predicted.
        if self.in_contact and 0.0 < normal_force_n < np.inf:
            self._force_n = normal_force_n

    def observe(self, report: TouchReport) -> None:
        """Take a report; one older than the last, or of no time or place, is ignored.

        One from later than could be sensed would hold off those that come after it, and be
        fresh for as long: a finger that is gone would go on being felt.
        """
        latest = self._sensed_end + self._tuning.stale_s * self._rate_hz
        if not (
            -np.inf < report.measured_sample < latest
            and math.hypot(report.x_mm, report.y_mm) <= FARTHEST_MM  # NaN is not
        ):
            return
        since_s = (report.measured_sample - self._newest_sample) / self._rate_hz
        if since_s <= 0.0:
            return
        self._newest_sample = report.measured_sample
        stamp_s = report.measured_sample / self._rate_hz
        place = report.x_mm, report.y_mm
        if not report.in_contact:
            self._instants.lift()
        time_s = self._instants.instant_s(stamp_s, place)
        # Of two fingers every other report is near one: only the last report confirms.
        alone = self._reported and math.dist(place, self._places[-1][1:]) > JUMP_MM
        if not self._reported or place != self._places[-1][1:]:
            self._moved_sample = report.measured_sample
        still = report.measured_sample - self._moved_sample >= STILL_S * self._rate_hz
        self._places.append((time_s, *place))
        self._reported = report.in_contact
        self._contact.report(report.in_contact, still)
        if not self.in_contact:
            self._follows = False
        touches = self.in_contact and report.in_contact
        follows = touches and self._follows and since_s <= self._tuning.stale_s
        elsewhere = follows and self._off_mm(time_s, place) > JUMP_MM
        if elsewhere and alone:
            return  # a stray report, or another finger's
        self._report_sample = report.measured_sample
        if not touches:
            return  # what fades out now goes on as it did
        if not follows or elsewhere:
            self._begin()
            return
        self._judge.report(time_s, *place)
        self._touch.observe(time_s, *place)
        if self._inertial is not None:
            self._inertial.observe(time_s, *place)

    def report_age_s(self, sample: float) -> float:
        """Return how old the last report is at a device sample; infinite before the first.

        Stray ones do not count: a sensor that says nothing else is of no more use than none.
        """
        return float(sample - self._report_sample) / self._rate_hz

    def stale(self, sample: float) -> bool:
        """Return whether reports have stopped coming."""
        return self.report_age_s(sample) > self._tuning.stale_s

    def estimate(self, sample: float) -> FloatArray:
        """Return the prediction for a device sample, shape (2 axes, position and velocity)."""
        time_s = sample / self._rate_hz
        if self.fused:
            assert self._inertial is not None
            return self._inertial.predict(time_s)
        return self._touch.predict(time_s)

    def predict(self, first_sample: int, n_samples: int) -> PredictedMotion:
        """Return the rendered motion from `first_sample` on, continuous from block to block.

        Parameters
        ----------
        first_sample : int
            Device index at which the block will start to play.
        n_samples : int
            Of the block.
        """
        end = first_sample + n_samples
        if self._inertial is not None and self._inertial.follows:
            time_s = end / self._rate_hz
            self._judge.predict(
                time_s, self._touch.predict(time_s), self._inertial.predict(time_s)
            )
        slipped = _follow(
            self._tuning,
            n_samples / self._rate_hz,
            self.estimate(end),
            self._rendered,
            self._motions,
        )
        rows = self._motions.tolist()
        left = BlockMotion(*rows[1]) if slipped else None
        pressed = self._force_before_n, self._force_n
        self._force_before_n = self._force_n
        return PredictedMotion(BlockMotion(*rows[0]), left, pressed)

    def _accelerated(
        self,
        first_sample: int,
        force_n: FloatArray,
        accel_m_s2: FloatArray,
        saturated: bool,
    ) -> Acceleration | None:
        """Return the finger's acceleration; None while the sensor has nothing to say."""
        n_samples = force_n.shape[0]
        if self._nail is None:
            self._nail = NailAcceleration(self._rate_hz, n_samples)
            self._inertial = InertialFilter(n_samples / self._rate_hz)
        missing = self._next_sample is not None and first_sample != self._next_sample
        self._next_sample = first_sample + n_samples
        if missing or saturated or not _alive(force_n, accel_m_s2):
            self._nail.restart()
            return None
        return self._nail.follow(force_n, accel_m_s2)

    def _off_mm(self, time_s: float, place_mm: tuple[float, float]) -> float:
        """Return how far a place is from where touch alone has the finger at a time."""
        (x_mm, _), (y_mm, _) = self._touch.predict(time_s)
        return math.dist(place_mm, (x_mm, y_mm))

    def _begin(self) -> None:
        """Begin anew where the finger was last seen, as fast as it was."""
        time_s, x_mm, y_mm = self._places[-1]
        velocity = 0.0, 0.0
        if len(self._places) == 2:
            before_s, x_before_mm, y_before_mm = self._places[0]
            since_s = time_s - before_s
            moved = x_mm - x_before_mm, y_mm - y_before_mm
            if np.hypot(*moved) < FASTEST_MM_S * since_s < FASTEST_MM_S * self._tuning.stale_s:
                velocity = moved[0] / since_s, moved[1] / since_s
        self._follows = True
        self._judge.restart()
        self._touch.begin(time_s, (x_mm, y_mm), velocity)
        if self._inertial is not None:
            self._inertial.begin(time_s, (x_mm, y_mm), velocity)


@njit(cache=True, nogil=True)
def _alive(force_n, accel):  # type: ignore[no-untyped-def]
    """Return whether every number is finite, and the acceleration along the screen changes."""
    changes = False
    for n in range(accel.shape[0]):
        for axis in range(3):
            if not np.isfinite(accel[n, axis] + force_n[n, axis]):
                return False
        changes |= accel[n, 0] != accel[0, 0] or accel[n, 1] != accel[0, 1]
    return changes


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

"""Out-of-sequence reports, gravity and acceleration, against textbook filters."""

import numpy as np
import pytest
from scipy.linalg import expm

from frictus_hardware.arrays import FloatArray
from frictus_service.synthesis.finger_motion import interacting_models
from frictus_service.synthesis.finger_motion.inertial_filter import InertialFilter
from frictus_service.synthesis.finger_motion.interacting_models import DEFAULT, MODELS
from frictus_service.synthesis.finger_motion.nail_acceleration import Acceleration

pytestmark = pytest.mark.compiled

BLOCK_S, AGE_S = 0.005, 0.005
NOISE_MM_S2 = 80.0


def measured(accel: FloatArray, rng: np.random.Generator) -> Acceleration:
    noisy = accel + NOISE_MM_S2 * rng.standard_normal(2)
    return Acceleration(noisy, np.full(2, NOISE_MM_S2**2), AGE_S)


def stroking(time_s: float) -> tuple[float, float, float]:
    """Return position, velocity and acceleration of a stroke of 1.2 Hz, 50 mm long."""
    turn, pace = 2.0 * np.pi * 1.2 * time_s, 2.0 * np.pi * 1.2
    return (
        35.0 + 25.0 * np.sin(turn),
        25.0 * pace * np.cos(turn),
        -25.0 * pace**2 * np.sin(turn),
    )


class Measured:
    """A filter and what it is fed with: reports every 1/60 s, so many seconds late."""

    def __init__(self, rng: np.random.Generator, late_s: float, gravity_mm_s2: float = 0.0):
        self.filter = InertialFilter(BLOCK_S)
        self._rng = rng
        self._late_s = late_s
        self._gravity = gravity_mm_s2
        self._blocks = self._scans = 0

    def go(self, seconds: float, position: bool = True) -> list[tuple[float, FloatArray]]:
        """Return time and prediction for 20 ms ahead, block by block."""
        said = []
        for _ in range(round(seconds / BLOCK_S)):
            self._blocks += 1
            end_s = self._blocks * BLOCK_S
            accel = np.array([stroking(end_s - AGE_S)[2] + self._gravity, 0.0])
            self.filter.follow(end_s, measured(accel, self._rng))
            while position and self._scans / 60.0 + self._late_s < end_s:
                at_s = self._scans / 60.0
                x_mm = round(stroking(at_s)[0], 1)
                if self.filter.follows:
                    self.filter.observe(at_s, x_mm, 17.0)
                else:
                    self.filter.begin(at_s, (x_mm, 17.0), (0.0, 0.0))
                self._scans += 1
            if self.filter.follows:
                said.append((end_s + 0.02, self.filter.predict(end_s + 0.02).copy()))
        return said


def errors(said: list[tuple[float, FloatArray]]) -> FloatArray:
    """Return the error of position and velocity along x, shape (n, 2)."""
    return np.array([found[0] - stroking(at_s)[:2] for at_s, found in said])


@pytest.mark.parametrize("late_s", [0.01, 0.03, 0.046, 0.1])
def test_strokes_are_followed_however_late_the_reports(
    rng: np.random.Generator, late_s: float
) -> None:
    error = errors(Measured(rng, late_s).go(6.0))[200:]
    position, velocity = np.sqrt(np.mean(error**2, axis=0))
    assert position < 0.3 + 4.0 * late_s
    assert velocity < 8.0 + 40.0 * late_s


def test_gravity_does_not_move_the_finger(rng: np.random.Generator) -> None:
    leaning = Measured(rng, 0.03, gravity_mm_s2=300.0)
    error = errors(leaning.go(8.0))[400:]
    assert np.sqrt(np.mean(error[:, 0] ** 2)) < 0.3
    assert abs(error[:, 0].mean()) < 0.1


def test_the_order_of_arrival_does_not_matter() -> None:
    """What was measured decides, not when it came: late reports give what early ones would."""
    rng = np.random.default_rng(1)
    accelerations = [
        measured(np.array([stroking(k * BLOCK_S)[2], 0.0]), rng) for k in range(100)
    ]
    reports = [(k / 60.0 + 0.001, round(stroking(k / 60.0 + 0.001)[0], 1)) for k in range(28)]
    prompt, late = InertialFilter(BLOCK_S), InertialFilter(BLOCK_S)
    for filter_, delay_s in ((prompt, 0.0), (late, 0.040)):
        waiting = list(reports)
        for k, acceleration in enumerate(accelerations):
            end_s = (k + 1) * BLOCK_S
            filter_.follow(end_s, acceleration)
            while waiting and waiting[0][0] + delay_s < end_s:
                at_s, x_mm = waiting.pop(0)
                if filter_.follows:
                    filter_.observe(at_s, x_mm, 17.0)
                else:
                    filter_.begin(at_s, (x_mm, 17.0), (0.0, 0.0))
    np.testing.assert_allclose(late.predict(0.52), prompt.predict(0.52), rtol=1e-9, atol=1e-9)


def test_alike_models_are_one_kalman_filter(rng: np.random.Generator) -> None:
    tuning = DEFAULT._replace(
        acceleration_mm_s2=(350.0,) * 3, lasts_s=(0.6,) * 3, swing_hz=(0.9,) * 3
    )
    ours = InertialFilter(BLOCK_S, tuning)
    turning = (2.0 * np.pi * 0.9) ** 2
    rates = np.zeros((4, 4))
    rates[0, 1] = rates[1, 2] = 1.0
    rates[2, 1], rates[2, 2] = -turning, -1.0 / 0.6
    rates[3, 3] = -1.0 / tuning.gravity_s
    mean = np.array([20.0, 0.0, 0.0, 0.0])
    cov = np.diag([0.05**2, 80.0**2, 350.0**2, tuning.gravity_mm_s2**2])

    def propagate(step_s: float) -> None:
        nonlocal mean, cov
        move = expm(step_s * rates)
        jerked = np.array([step_s**3 / 6.0, step_s**2 / 2.0, step_s, 0.0])
        noise = 2.0 * 350.0**2 / 0.6 / step_s * np.outer(jerked, jerked)
        noise[3, 3] = 2.0 * tuning.gravity_mm_s2**2 / tuning.gravity_s * step_s
        mean, cov = move @ mean, move @ cov @ move.T + noise

    def update(row: FloatArray, value: float, variance: float) -> None:
        nonlocal mean, cov
        gain = cov @ row / (row @ cov @ row + variance)
        mean = mean + gain * (value - row @ mean)
        cov = cov - np.outer(gain, row @ cov)

    ours.follow(0.0, None)
    ours.begin(0.0, (20.0, 17.0), (0.0, 0.0))
    for k in range(1, 60):
        value = float(rng.normal(0.0, 300.0))
        end_s = k * BLOCK_S
        acceleration = Acceleration(np.array([value, 0.0]), np.full(2, 100.0**2), AGE_S)
        ours.follow(end_s + AGE_S, acceleration)
        reported = k % 4 == 3
        if reported:
            propagate(0.003)
            update(np.array([1.0, 0.0, 0.0, 0.0]), 20.0 + 0.01 * k, tuning.report_sd_mm**2)
            propagate(0.002)
            ours.observe(end_s - 0.002, 20.0 + 0.01 * k, 17.0)
        else:
            propagate(BLOCK_S)
        update(np.array([0.0, 0.0, 1.0, 1.0]), value, 100.0**2)
        ahead = expm(0.02 * rates) @ mean
        np.testing.assert_allclose(
            ours.predict(end_s + 0.02)[0], ahead[:2], rtol=1e-6, atol=1e-6
        )


@pytest.mark.parametrize("step_s", [0.0, 0.005, 0.05, 0.051, 3.0])
@pytest.mark.parametrize("model", range(MODELS))
def test_a_transition_is_the_exponential_of_the_rates(step_s: float, model: int) -> None:
    swing = (2.0 * np.pi * DEFAULT.swing_hz[model]) ** 2
    rates = np.zeros((4, 4))
    rates[0, 1] = rates[1, 2] = 1.0
    rates[2, 1], rates[2, 2] = -swing, -1.0 / DEFAULT.lasts_s[model]
    rates[3, 3] = -1.0 / DEFAULT.gravity_s
    found = interacting_models.transition(DEFAULT, model, step_s)
    np.testing.assert_allclose(found, expm(step_s * rates), rtol=1e-9, atol=1e-12)


def test_reports_that_are_too_old_or_not_newer_change_nothing(
    rng: np.random.Generator,
) -> None:
    followed = Measured(rng, 0.03)
    followed.go(1.0)
    before = followed.filter.predict(1.05).copy()
    newest = 58.0 / 60.0
    for at_s in (newest, newest - 0.001, 0.5, -1e9):
        followed.filter.observe(at_s, 3.0, 3.0)
    np.testing.assert_array_equal(followed.filter.predict(1.05), before)


def test_prediction_stays_finite_through_an_hour_without_reports(
    rng: np.random.Generator,
) -> None:
    followed = Measured(rng, 0.03)
    followed.go(1.0)
    followed.go(5.0, position=False)
    assert np.all(np.isfinite(followed.filter.predict(3_600.0)))
    followed.go(0.1)
    assert np.all(np.isfinite(followed.filter.predict(3_600.0)))

"""The finger estimator: close to the finger, and never a jump in what is rendered."""

from collections.abc import Callable, Iterable

import numpy as np
import pytest
from scipy.linalg import expm

from frictus_hardware.arrays import FloatArray
from frictus_hardware.base import TouchReport
from frictus_hardware.simulated.config import SimulatedConfig
from frictus_hardware.simulated.human import HumanStrokes
from frictus_hardware.simulated.strokes import SteadyStrokes
from frictus_service.fidelity.measure import steady_segments
from frictus_service.fidelity.path import BLOCK_SAMPLES, Path, walk
from frictus_service.synthesis import estimator
from frictus_service.synthesis.estimator import DEFAULT_TUNING, FingerEstimator, PredictedMotion
from frictus_service.synthesis.finger_motion import touch_filter
from frictus_service.synthesis.finger_motion.touch_filter import TouchTuning
from frictus_service.synthesis.kernel import BlockMotion

pytestmark = pytest.mark.compiled


RATE = 20_000.0
BLOCK_S = BLOCK_SAMPLES / RATE
PERIOD = RATE / 60.0
LATENCY = 600.0  # samples
LEAD = 400


def report(sample: float, x: float, y: float = 17.0, in_contact: bool = True) -> TouchReport:
    return TouchReport(sample, round(x, 1), y, in_contact)


def end_of(motion: BlockMotion) -> FloatArray:
    return np.array(
        [
            motion.x_mm + 0.5 * (motion.vx_0 + motion.vx_1) * BLOCK_S,
            motion.y_mm + 0.5 * (motion.vy_0 + motion.vy_1) * BLOCK_S,
        ]
    )


def assert_continuous(courses: Iterable[PredictedMotion]) -> int:
    """Each motion begins where the last ended; where it does not, that one is left. Slips."""
    slips = 0
    last: BlockMotion | None = None
    for course in courses:
        first = course.motion if course.left is None else course.left
        slips += course.left is not None
        if last is not None:
            np.testing.assert_allclose((first.x_mm, first.y_mm), end_of(last), atol=1e-9)
            np.testing.assert_allclose(
                (first.vx_0, first.vy_0), (last.vx_1, last.vy_1), atol=1e-9
            )
        last = course.motion
    return slips


class Followed:
    """An estimator that is fed as the chain feeds it."""

    def __init__(self) -> None:
        self.estimator = FingerEstimator(RATE)
        self.courses: list[PredictedMotion] = []
        self.sample = 0
        self._scans = 0

    def follow(
        self, x_at: Callable[[float], float], n_blocks: int, in_contact: bool = True
    ) -> None:
        """Go on for some blocks; reports arrive 30 ms late."""
        for _ in range(n_blocks):
            self.courses.append(self.estimator.predict(self.sample + LEAD, BLOCK_SAMPLES))
            self.sample += BLOCK_SAMPLES
            while (measured := self._scans * PERIOD) + LATENCY < self.sample:
                if measured + LATENCY >= self.sample - BLOCK_SAMPLES:
                    x = x_at(measured / RATE)
                    self.estimator.observe(report(measured, x, in_contact=in_contact))
                self._scans += 1


def stroke(time_s: float) -> float:
    return 5.0 + 60.0 * time_s


def speeds(path: Path) -> FloatArray:
    return np.array([course.motion.speed_0 for course in path.courses])


@pytest.mark.parametrize("speed", [40.0, 60.0, 100.0])
def test_steady_speeds_are_found(rng: np.random.Generator, speed: float) -> None:
    config = SimulatedConfig(
        finger=SteadyStrokes(speed_mm_s=speed), seed=int(rng.integers(2**31))
    )
    path = walk(config, 5.0)
    at = path.lead_samples + BLOCK_SAMPLES * np.arange(len(path.courses))
    settled = np.zeros(len(path.courses), dtype=bool)
    for segment in steady_segments(path, speed, settle_s=0.3):
        settled |= (at >= segment.start) & (at < segment.stop)
    assert np.count_nonzero(settled) > 200
    error = speeds(path)[settled] - speed
    assert np.sqrt(np.mean(np.square(error))) < 1.0
    assert_continuous(path.courses)


@pytest.mark.long
def test_free_strokes_are_followed_better_than_by_the_last_report(
    rng: np.random.Generator,
) -> None:
    ours, held = [], []
    for _ in range(3):
        path = walk(SimulatedConfig(finger=HumanStrokes(), seed=int(rng.integers(2**31))), 10.0)
        at = path.lead_samples + BLOCK_SAMPLES * np.arange(60, len(path.courses))
        at = at[at < path.position_mm.shape[0]]
        predicted = np.array([course.motion.x_mm for course in path.courses[60:]])[: at.size]
        ours.append(predicted - path.position_mm[at, 0])
        # The newest report that has arrived when a block is made; it was measured 30 ms before.
        newest = np.floor((at - LEAD - LATENCY) / PERIOD) * PERIOD
        held.append(path.position_mm[np.ceil(newest).astype(int), 0] - path.position_mm[at, 0])
        assert_continuous(path.courses)
    rms = [float(np.sqrt(np.mean(np.square(np.concatenate(part))))) for part in (ours, held)]
    assert rms[0] < 1.5
    assert rms[0] < 0.6 * rms[1]


def test_what_is_rendered_is_continuous_whatever_the_finger_does(
    rng: np.random.Generator,
) -> None:
    followed = Followed()
    for _ in range(12):
        where, speed = rng.uniform(5.0, 65.0), rng.uniform(-200.0, 200.0)
        touching = bool(rng.random() < 0.8)
        followed.follow(
            lambda t, where=where, speed=speed: float(
                np.clip(where + speed * (t % 0.2), 0, 70)
            ),  # type: ignore[misc]
            int(rng.integers(5, 60)),
            touching,
        )
    assert assert_continuous(followed.courses) > 0


def test_a_slip_leaves_the_old_motion_for_the_estimate() -> None:
    followed = Followed()
    followed.follow(stroke, 100)
    followed.follow(lambda t: stroke(t) - 20.0, 40)  # the finger jumps
    slips = [
        (number, course)
        for number, course in enumerate(followed.courses)
        if course.left is not None
    ]
    assert slips
    for number, course in slips:
        assert course.left is not None
        before = followed.courses[number - 1].motion
        np.testing.assert_allclose(
            (course.left.x_mm, course.left.y_mm), end_of(before), atol=1e-9
        )
        moved = np.hypot(*(end_of(course.motion) - end_of(course.left)))
        assert moved > DEFAULT_TUNING.slip_mm
    assert_continuous(followed.courses)


def test_corrections_stay_small_against_the_speed(rng: np.random.Generator) -> None:
    path = walk(SimulatedConfig(finger=HumanStrokes(), seed=int(rng.integers(2**31))), 5.0)
    for course in path.courses[60:]:
        motion = course.motion
        along = np.hypot(motion.vx_1, motion.vy_1)
        limit = max(
            DEFAULT_TUNING.correct_share * motion.speed_1, DEFAULT_TUNING.correct_least_mm_s
        )
        assert abs(along - motion.speed_1) <= np.sqrt(2.0) * limit + 1e-9


def test_contact_begins_and_ends_with_the_reports() -> None:
    followed = Followed()
    estimator = followed.estimator
    assert not estimator.in_contact
    assert estimator.stale(0)
    assert estimator.report_age_s(0) == np.inf
    followed.follow(stroke, 20, in_contact=False)
    assert not estimator.in_contact
    assert not estimator.stale(followed.sample)
    followed.follow(stroke, 40)
    assert estimator.in_contact
    followed.follow(stroke, 1, in_contact=False)
    followed.follow(stroke, 4, in_contact=False)
    assert not estimator.in_contact


def test_while_it_fades_out_after_contact_what_is_rendered_goes_on() -> None:
    followed = Followed()
    followed.follow(stroke, 100)
    followed.follow(lambda t: 40.0, 20, in_contact=False)
    assert_continuous(followed.courses)
    # Four blocks of fade: still about as fast as the stroke was.
    assert followed.courses[105].motion.vx_0 == pytest.approx(60.0, rel=0.2)


def test_a_new_contact_starts_at_the_finger() -> None:
    followed = Followed()
    followed.follow(lambda t: 20.0, 20)
    begun = next(course for course in followed.courses if course.left is not None)
    np.testing.assert_allclose(end_of(begun.motion), (20.0, 17.0), atol=0.01)
    followed.follow(stroke, 60, in_contact=False)
    assert not followed.estimator.in_contact
    again = len(followed.courses)
    followed.follow(lambda t: 50.0, 12)
    begun = next(course for course in followed.courses[again:] if course.left is not None)
    np.testing.assert_allclose(end_of(begun.motion), (50.0, 17.0), atol=0.01)


def test_reports_that_stop_coming_make_it_stale() -> None:
    estimator = FingerEstimator(RATE)
    for scan in range(20):
        estimator.observe(report(scan * PERIOD, stroke(scan / 60.0)))
    last = 19 * PERIOD
    assert estimator.report_age_s(last + 500) == pytest.approx(0.025)
    assert not estimator.stale(last + 0.099 * RATE)
    assert estimator.stale(last + 0.101 * RATE)
    estimator.observe(report(last + RATE, 30.0))
    assert not estimator.stale(last + RATE)
    motion = estimator.predict(round(last + RATE), BLOCK_SAMPLES).motion
    assert end_of(motion)[0] == pytest.approx(30.0, abs=0.01)


@pytest.mark.parametrize("later_s", [0.3, 3.0, 3_600.0, 1e6])
def test_the_prediction_stays_tame_however_old_the_last_report(later_s: float) -> None:
    followed = Followed()
    followed.follow(stroke, 100)
    course = followed.estimator.predict(followed.sample + round(later_s * RATE), BLOCK_SAMPLES)
    motion = course.motion
    assert np.all(np.isfinite(motion))
    assert max(abs(motion.vx_1), motion.speed_1) < 200.0
    # And it is back with the first report.
    measured = followed.sample + (later_s + 1.0) * RATE
    followed.estimator.observe(report(measured, 30.0))
    motion = followed.estimator.predict(round(measured) + 600, BLOCK_SAMPLES).motion
    assert end_of(motion)[0] == pytest.approx(30.0, abs=0.01)
    assert motion.speed_1 < 1.0


def state(estimator: FingerEstimator, sample: int) -> FloatArray:
    return estimator.estimate(sample).copy()


@pytest.mark.parametrize(
    "garbage",
    [
        report(19 * PERIOD, 3.0),
        report(18.5 * PERIOD, 3.0),
        report(0.0, 3.0),
        report(-1e9, 3.0, in_contact=False),
        TouchReport(np.nan, 3.0, 3.0, True),
        TouchReport(np.inf, 3.0, 3.0, True),
        TouchReport(20 * PERIOD, np.nan, 3.0, True),
        TouchReport(20 * PERIOD, 3.0, -np.inf, True),
        TouchReport(np.nan, 3.0, 3.0, False),
    ],
    ids=[
        "same time",
        "older",
        "oldest",
        "before all",
        "no time",
        "endless",
        "nan",
        "inf",
        "end",
    ],
)
def test_garbage_is_ignored(garbage: TouchReport) -> None:
    estimator = FingerEstimator(RATE)
    for scan in range(20):
        estimator.observe(report(scan * PERIOD, stroke(scan / 60.0)))
    sample = round(19 * PERIOD) + 1_000
    before = state(estimator, sample)
    estimator.observe(garbage)
    np.testing.assert_array_equal(state(estimator, sample), before)
    assert estimator.in_contact
    assert estimator.stale(19 * PERIOD + 0.11 * RATE)


def test_reports_close_upon_one_another_are_harmless() -> None:
    estimator = FingerEstimator(RATE)
    for scan in range(20):
        estimator.observe(report(scan * PERIOD, stroke(scan / 60.0)))
        estimator.observe(report(scan * PERIOD + 1e-3, stroke(scan / 60.0)))
    sample = round(19 * PERIOD) + 1_000
    (x, vx), (y, vy) = state(estimator, sample)
    assert x == pytest.approx(stroke(sample / RATE), abs=0.5)
    assert vx == pytest.approx(60.0, rel=0.1)
    assert y == pytest.approx(17.0, abs=0.1)
    assert vy == pytest.approx(0.0, abs=2.0)


def test_a_stray_report_moves_nothing_and_a_second_one_beside_it_does() -> None:
    estimator = FingerEstimator(RATE)
    for scan in range(40):
        strays = scan >= 20 and scan % 3 == 0
        x_mm = 5.0 + scan % 7 if strays else stroke(scan / 60.0)
        estimator.observe(report(scan * PERIOD, x_mm))
        if scan >= 20:
            (x, vx), _ = state(estimator, round(scan * PERIOD) + 1_000)
            assert x == pytest.approx(stroke(scan / 60.0 + 0.05), abs=0.5)
            assert vx == pytest.approx(60.0, rel=0.1)
            assert not estimator.stale(scan * PERIOD + 0.05 * RATE)
    for scan in (40, 41):
        estimator.observe(report(scan * PERIOD, 5.0))
    assert state(estimator, round(41 * PERIOD))[0, 0] == pytest.approx(5.0, abs=0.1)


def test_reports_that_are_all_stray_are_none() -> None:
    estimator = FingerEstimator(RATE)
    for scan in range(20):
        estimator.observe(report(scan * PERIOD, stroke(scan / 60.0)))
    for scan in range(20, 40):
        estimator.observe(report(scan * PERIOD, 20.0 * (scan % 4) - 100.0))
    assert estimator.stale(40 * PERIOD)
    for scan in range(40, 43):
        estimator.observe(report(scan * PERIOD, 30.0))
    assert not estimator.stale(43 * PERIOD)
    assert state(estimator, round(43 * PERIOD))[0, 0] == pytest.approx(30.0, abs=0.2)


@pytest.mark.parametrize("angle_deg", [0.0, 90.0, 30.0])
def test_both_axes_are_followed_alike(angle_deg: float) -> None:
    estimator = FingerEstimator(RATE)
    along = np.array([np.cos(np.deg2rad(angle_deg)), np.sin(np.deg2rad(angle_deg))])
    for scan in range(30):
        x, y = 10.0 + 50.0 * scan / 60.0 * along
        estimator.observe(TouchReport(scan * PERIOD, float(x), float(y), True))
    sample = round(29 * PERIOD) + 1_000
    found = state(estimator, sample)
    np.testing.assert_allclose(found[:, 0], 10.0 + 50.0 * sample / RATE * along, atol=0.1)
    np.testing.assert_allclose(found[:, 1], 50.0 * along, atol=2.0)


@pytest.mark.parametrize("step_s", [0.0, 0.005, 0.07, 0.2, 0.21, 3.0])
@pytest.mark.parametrize("turning", [0.0, 2.0 * np.pi * TouchTuning().turning_hz])
def test_a_transition_is_the_exponential_of_the_rates(step_s: float, turning: float) -> None:
    rates = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, -(turning**2), -1.0 / 0.6]])
    found = touch_filter._transition(0.6, turning, step_s)
    np.testing.assert_allclose(found, expm(step_s * rates), rtol=1e-12, atol=1e-13)


def followed_plainly(
    after: FloatArray, rendered: FloatArray
) -> tuple[bool, FloatArray, FloatArray]:
    """Return whether the motion was left, the motion, and what is rendered from there on."""
    tuning = DEFAULT_TUNING
    position, velocity, before = rendered
    behind = after[:, 0] - position - 0.5 * (velocity + after[:, 1]) * BLOCK_S
    slipped = bool(np.linalg.norm(behind) > tuning.slip_mm)
    if slipped:
        velocity = before
        position = after[:, 0] - 0.5 * (before + after[:, 1]) * BLOCK_S
        behind = np.zeros(2)
    speed = float(np.linalg.norm(after[:, 1]))
    limit = max(tuning.correct_share * speed, tuning.correct_least_mm_s)
    later = after[:, 1] + np.clip(behind / tuning.correct_time_s, -limit, limit)
    motion = np.concatenate([position, velocity, later, [np.linalg.norm(before), speed]])
    position = position + 0.5 * (velocity + later) * BLOCK_S
    return slipped, motion, np.array([position, later, after[:, 1]])


def test_what_is_rendered_follows_as_plain_arrays_say(rng: np.random.Generator) -> None:
    rendered, motions = rng.normal(size=(3, 2)), np.empty((2, 8))
    slips = 0
    for _ in range(2_000):
        after = np.column_stack([rendered[0] + 0.4 * rng.normal(size=2), rng.normal(size=2)])
        after[:, 1] *= 60.0
        left = [*rendered[0], *rendered[1], *after[:, 1]]
        slipped, motion, following = followed_plainly(after, rendered.copy())
        found = estimator._follow(DEFAULT_TUNING, BLOCK_S, after, rendered, motions)
        assert found == slipped
        slips += slipped
        np.testing.assert_allclose(motions[0], motion, rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(rendered, following, rtol=1e-12, atol=1e-12)
        if slipped:
            np.testing.assert_array_equal(motions[1, :6], left)
    assert 200 < slips < 1_800

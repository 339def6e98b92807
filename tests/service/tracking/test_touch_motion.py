"""Motion from touch reports: exact for strokes, and nothing where it is not known."""

from collections.abc import Iterator

import numpy as np
import pytest

from frictus.aligned import AlignedSamples
from frictus.block import Flag
from frictus.messages import TouchState
from frictus_hardware.arrays import FloatArray
from frictus_service.tracking.touch_motion import PATIENCE_S, TouchedSamples, motion_among

RATE_HZ = 20_000.0
SCAN_S = 1.0 / 60.0
STROKE_S = 0.8
SPAN_MM = 50.0


def stroke(time_s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return position and speed of a stroke with the least jerk (Flash and Hogan 1985)."""
    share = time_s / STROKE_S
    way = SPAN_MM * (10.0 * share**3 - 15.0 * share**4 + 6.0 * share**5)
    speed = SPAN_MM / STROKE_S * 30.0 * share**2 * (1.0 - share) ** 2
    return 10.0 + way, speed


def test_a_stroke_is_found_to_the_rounding_of_its_reports(rng: np.random.Generator) -> None:
    at_s = np.arange(0.25, 0.56, SCAN_S)
    x_mm = np.round(stroke(at_s)[0], 1)  # as a sensor reports it
    time_s = np.arange(0.35, 0.45, 1.0 / RATE_HZ)
    rows = motion_among(np.column_stack([x_mm, np.full(x_mm.size, 20.0)]), at_s, time_s)
    x, speed = stroke(time_s)
    assert np.abs(rows[0] - x).max() < 0.06
    assert np.abs(rows[1] - 20.0).max() < 1e-6
    assert abs(rows[2].mean() - speed.mean()) < 1.0
    exact = np.column_stack([stroke(at_s)[0], np.full(at_s.size, 20.0)])
    np.testing.assert_allclose(motion_among(exact, at_s, time_s)[2], speed, rtol=1e-6)


def test_nothing_is_said_where_reports_are_few_silent_or_rough() -> None:
    at_s = np.arange(0.25, 0.56, SCAN_S)
    place = np.column_stack([stroke(at_s)[0], np.full(at_s.size, 20.0)])
    time_s = np.arange(0.35, 0.45, 1.0 / RATE_HZ)
    assert not motion_among(place[:5], at_s[:5], time_s).any()
    silent = (at_s < 0.33) | (at_s > 0.52)
    assert not motion_among(place[silent], at_s[silent], time_s).any()
    jumped = place.copy()
    jumped[10] += 5.0
    assert not motion_among(jumped, at_s, time_s).any()


def test_reports_of_one_instant_or_beyond_all_bounds_are_no_path() -> None:
    time_s = np.arange(0.35, 0.45, 1.0 / RATE_HZ)
    assert not motion_among(np.full((8, 2), 20.0), np.full(8, 0.4), time_s).any()
    far = np.tile([[1e200, 0.0], [-1e200, 0.0]], (9, 1))
    assert not motion_among(far, np.arange(0.25, 0.25 + 17.5 * SCAN_S, SCAN_S), time_s).any()


def part(first: int, run: int = 1) -> AlignedSamples:
    render = np.full((6, 2_000), 7.0, np.float32)
    return AlignedSamples(run, first, 0, RATE_HZ, 0, Flag(0), {"render": render})


def reports(until_s: float, run: int = 1) -> Iterator[TouchState]:
    for number in range(int(until_s / SCAN_S) + 1):
        at_s = number * SCAN_S
        x_mm = 10.0 + 40.0 * at_s
        yield TouchState(
            run=run,
            sample=at_s * RATE_HZ,
            x_mm=x_mm,
            y_mm=20.0,
            in_contact=True,
            source="touch",
        )


def test_samples_wait_for_the_reports_around_them() -> None:
    touched = TouchedSamples()
    assert not list(touched.take(part(0)))
    assert not list(touched.take(part(2_000)))
    for report in reports(0.21):
        touched.report(report)
    first, *more = touched.take(part(4_000))
    assert (first.first_sample, more) == (0, [])
    np.testing.assert_allclose(first.data["render"][2], 40.0, rtol=1e-3)
    assert np.all(first.data["render"][3:] == 7.0)  # target, drive and sensors as they were
    assert [each.first_sample for each in touched.rest()] == [2_000, 4_000]


def test_without_reports_samples_go_on_without_a_motion() -> None:
    touched = TouchedSamples()
    through = [
        each
        for first in range(0, round((PATIENCE_S + 0.5) * RATE_HZ), 2_000)
        for each in touched.take(part(first))
    ]
    assert through
    assert through[0].first_sample == 0
    assert not through[0].data["render"][2].any()


@pytest.mark.parametrize("lifted", [True, False])
def test_reports_of_another_run_or_of_a_lifted_finger_say_nothing(lifted: bool) -> None:
    touched = TouchedSamples()
    for report in reports(0.3, run=1 if lifted else 2):
        touched.report(report.model_copy(update={"in_contact": not lifted}))
    touched.report(next(reports(0.0)).model_copy(update={"sample": 6_000.0}))
    (found,) = touched.take(part(0))
    assert not found.data["render"][2].any()


@pytest.mark.parametrize("forged", [{"sample": 1e18}, {"run": 0}, {"run": 2**62}])
def test_a_report_that_no_rig_made_keeps_nothing_from_being_known(
    forged: dict[str, float],
) -> None:
    touched = TouchedSamples()
    touched.report(next(reports(0.0)).model_copy(update=forged))
    found = []
    for number, report in enumerate(reports(20.0)):
        x_mm = 35.0 + 20.0 * np.sin(2.0 * np.pi * 0.5 * report.sample / RATE_HZ)
        touched.report(report.model_copy(update={"x_mm": x_mm}))
        if number % 6 == 5:  # 0.1 s
            found += list(touched.take(part(2_000 * (number // 6))))
    assert len(found) > 190
    for each in found[-10:]:
        time_s = (each.first_sample + np.arange(2_000)) / RATE_HZ
        speed = np.abs(20.0 * np.pi * np.cos(np.pi * time_s))
        np.testing.assert_allclose(each.data["render"][2], speed, atol=0.5)


def test_a_new_run_does_not_wait_for_the_old_one() -> None:
    touched = TouchedSamples()
    assert not list(touched.take(part(0, run=1)))
    (old,) = touched.take(part(0, run=2))
    assert old.run == 1

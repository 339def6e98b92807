"""Samples get the motion that touch reports tell of them, once these are in."""

from collections.abc import Iterator

import numpy as np
import pytest

from frictus.aligned import AlignedSamples
from frictus.block import Flag
from frictus.messages import TouchState
from frictus_service.tracking.touch_motion import PATIENCE_S, TouchedSamples

RATE_HZ = 20_000.0
SCAN_S = 1.0 / 60.0


def part(first: int, run: int = 1) -> AlignedSamples:
    force = np.full((3, 2_000), 7.0, np.float32)
    return AlignedSamples(run, first, 0, RATE_HZ, 0, Flag(0), {"force": force})


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
    assert np.all(first.data["force"] == 7.0)
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

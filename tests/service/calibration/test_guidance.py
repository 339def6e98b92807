"""Guidance: the reference moves at the target speed, the colour tells the force."""

import re
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.rig_status import rig_status

from frictus.messages import Fault, FingerState
from frictus.rig import Rig
from frictus_service.calibration.session import (
    Cue,
    check_forces,
    colour_of,
    guide,
    reference_x_mm,
    span_of,
    status_of,
)
from frictus_service.errors import CalibrationError

SPAN_MM = (5.0, 65.0)
CUE = Cue(trial=3, trials=10, speed_mm_s=40.0, force_n=0.4, span_mm=SPAN_MM)
FINGER = FingerState(
    sequence=1,
    sample=100,
    utc_ns=1,
    uncertainty_ns=1,
    x_mm=20.0,
    y_mm=17.0,
    vx_mm_s=-38.0,
    vy_mm_s=1.0,
    normal_force_n=0.41,
    in_contact=True,
    source="touch",
    age_ms=20.0,
    stale=False,
    extrapolated=False,
)


@given(
    elapsed_s=st.floats(0.0, 1e4),
    speed=st.floats(1.0, 300.0),
    step_s=st.floats(0.0, 0.1),
)
def test_the_reference_stays_in_the_span_and_keeps_the_speed(
    elapsed_s: float, speed: float, step_s: float
) -> None:
    here = reference_x_mm(elapsed_s, speed, SPAN_MM)
    there = reference_x_mm(elapsed_s + step_s, speed, SPAN_MM)
    assert SPAN_MM[0] <= here <= SPAN_MM[1]
    assert abs(there - here) <= speed * step_s * (1.0 + 1e-6) + 1e-6


def test_the_reference_starts_left_and_comes_back() -> None:
    assert reference_x_mm(0.0, 40.0, SPAN_MM) == 5.0
    assert reference_x_mm(1.5, 40.0, SPAN_MM) == pytest.approx(65.0)
    assert reference_x_mm(3.0, 40.0, SPAN_MM) == pytest.approx(5.0)
    at = np.array([reference_x_mm(t, 40.0, SPAN_MM) for t in np.arange(0.0, 1.5, 0.1)])
    np.testing.assert_allclose(np.diff(at), 4.0)


@pytest.mark.parametrize(
    ("force_n", "in_contact", "colour"),
    [
        (0.35, True, "yellow"),
        (0.361, True, "green"),
        (0.439, True, "green"),
        (0.45, True, "red"),
        (0.40, False, "grey"),
    ],
)
def test_the_colour_tells_the_force(force_n: float, in_contact: bool, colour: str) -> None:
    assert colour_of(force_n, 0.4, in_contact) == colour


def test_guidance_shows_target_and_finger() -> None:
    shown = guide(CUE, "P01", "record", 1.5, 2.0, FINGER, 7)
    assert (shown.reference_x_mm, shown.x_mm, shown.speed_mm_s) == (65.0, 20.0, 38.0)
    assert (shown.colour, shown.seconds_left, shown.trial, shown.trials) == (
        "green",
        2.0,
        3,
        10,
    )


@pytest.mark.parametrize(
    "finger",
    [
        None,
        FINGER.model_copy(update={"stale": True}),
        FINGER.model_copy(update={"in_contact": False}),
    ],
)
def test_a_finger_that_is_not_seen_has_no_figures(finger: FingerState | None) -> None:
    shown = guide(CUE, "P01", "record", 1.0, 2.0, finger, 7)
    assert (shown.x_mm, shown.speed_mm_s, shown.force_n) == (None, None, None)
    assert shown.colour == "grey"


@pytest.mark.parametrize("phase", ["break", "analyse", "done"])
def test_the_reference_waits_outside_of_trials(phase: str) -> None:
    shown = guide(CUE, "P01", phase, 1.5, 2.0, FINGER, 7)  # type: ignore[arg-type]
    assert shown.reference_x_mm == SPAN_MM[0]


def test_strokes_keep_off_the_edges() -> None:
    assert span_of((70.0, 35.0)) == (5.0, 65.0)
    assert span_of((20.0, 20.0)) == (2.0, 18.0)


def test_a_tripped_rig_is_told_in_sentences() -> None:
    fault = Fault(
        kind="safety", reason="1.1 N, 1 N is accepted", utc_ns=1, action="Find out why."
    )
    rig = SimpleNamespace(name="rig1", status=lambda: rig_status(state="tripped", fault=fault))
    with pytest.raises(
        CalibrationError, match=r"tripped: 1\.1 N, 1 N is accepted\. Find out why"
    ):
        status_of(cast(Rig, rig))


@pytest.mark.parametrize("limit_n", [1.0, 0.55, 10.0])
def test_a_force_at_which_the_rig_would_trip_is_not_asked_for(limit_n: float) -> None:
    status = rig_status(force_limit_n=limit_n)
    with pytest.raises(CalibrationError, match="raise force_limit_n") as refused:
        check_forces(status, (0.2, limit_n))
    (advised_n,) = re.findall(r"ask for at most ([\d.]+) N", str(refused.value))
    check_forces(status, (float(advised_n),))
    assert 0.98 * limit_n - 0.01 < 1.1 * float(advised_n) <= limit_n


def test_a_rig_that_does_not_say_its_limit_is_asked_for_any_force() -> None:
    check_forces(rig_status(), (10.0,))

"""Motion from touch reports: exact for strokes, and nothing where it is not known."""

import numpy as np
import pytest

from frictus_hardware.arrays import FloatArray
from frictus_service.identification.observation.touch_path import path_among, path_of

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
    rows = path_among(np.column_stack([x_mm, np.full(x_mm.size, 20.0)]), at_s, time_s)
    x, speed = stroke(time_s)
    assert np.abs(rows[0] - x).max() < 0.06
    assert np.abs(rows[1] - 20.0).max() < 1e-6
    assert abs(rows[2].mean() - speed.mean()) < 1.0
    exact = np.column_stack([stroke(at_s)[0], np.full(at_s.size, 20.0)])
    np.testing.assert_allclose(path_among(exact, at_s, time_s)[2], speed, rtol=1e-6)


def test_nothing_is_said_where_reports_are_few_silent_or_rough() -> None:
    at_s = np.arange(0.25, 0.56, SCAN_S)
    place = np.column_stack([stroke(at_s)[0], np.full(at_s.size, 20.0)])
    time_s = np.arange(0.35, 0.45, 1.0 / RATE_HZ)
    assert not path_among(place[:5], at_s[:5], time_s).any()
    silent = (at_s < 0.33) | (at_s > 0.52)
    assert not path_among(place[silent], at_s[silent], time_s).any()
    jumped = place.copy()
    jumped[10] += 5.0
    assert not path_among(jumped, at_s, time_s).any()


def test_reports_of_one_instant_or_beyond_all_bounds_are_no_path() -> None:
    time_s = np.arange(0.35, 0.45, 1.0 / RATE_HZ)
    assert not path_among(np.full((8, 2), 20.0), np.full(8, 0.4), time_s).any()
    far = np.tile([[1e200, 0.0], [-1e200, 0.0]], (9, 1))
    assert not path_among(far, np.arange(0.25, 0.25 + 17.5 * SCAN_S, SCAN_S), time_s).any()


def test_of_a_trial_every_sample_is_told_where_reports_are() -> None:
    at_s = np.arange(0.0, STROKE_S, SCAN_S)
    place = np.column_stack([stroke(at_s)[0], np.full(at_s.size, 20.0)])
    place[10] = np.nan
    rows = path_of(place, at_s, round(STROKE_S * RATE_HZ), RATE_HZ)
    within = slice(round(0.05 * RATE_HZ), round(0.75 * RATE_HZ))
    x, speed = stroke(np.arange(rows.shape[1]) / RATE_HZ)
    np.testing.assert_allclose(rows[0, within], x[within], atol=1e-6)
    np.testing.assert_allclose(rows[2, within], speed[within], atol=1e-4)


def reversal(time_s: FloatArray, turn_s: float = 0.06) -> FloatArray:
    """Return positions of a finger that turns at 40 mm/s, through half a cosine."""
    within = np.clip(time_s / turn_s, -0.5, 0.5)
    turned = -turn_s / np.pi * np.cos(np.pi * within)
    beyond = np.maximum(np.abs(time_s) - turn_s / 2.0, 0.0)
    return 30.0 + 40.0 * (turned + beyond)


def test_a_turn_too_sharp_for_a_polynomial_is_no_path() -> None:
    """Its speed came out up to 5 mm/s too high beside the turn, and was believed."""
    time_s = np.arange(0.01, 0.11, 1.0 / RATE_HZ)
    for first_s in np.linspace(-0.1, -0.085, 4):
        at_s = np.arange(first_s, 0.21, SCAN_S)
        place = np.column_stack([np.round(reversal(at_s), 1), np.full(at_s.size, 20.0)])
        assert not path_among(place, at_s, time_s).any()
        straight = np.column_stack([np.round(30.0 + 40.0 * at_s, 1), place[:, 1]])
        assert np.all(path_among(straight, at_s, time_s)[2] > 35.0)


def test_reports_that_scatter_by_themselves_are_a_path(rng: np.random.Generator) -> None:
    at_s = np.arange(0.25, 0.56, SCAN_S)
    place = np.column_stack([stroke(at_s)[0], np.full(at_s.size, 20.0)])
    time_s = np.arange(0.35, 0.45, 1.0 / RATE_HZ)
    known = [
        path_among(place + rng.normal(0.0, 0.2, place.shape), at_s, time_s).any()
        for _ in range(50)
    ]
    assert np.mean(known) > 0.8


@pytest.mark.parametrize(
    ("scatter_s", "lost"), [(1e-3, 0.0), (2e-3, 0.0), (3e-3, 0.0), (1e-3, 0.05), (2e-3, 0.05)]
)
def test_stamps_of_arrival_scatter_and_the_reports_were_made_evenly(
    scatter_s: float, lost: float, rng: np.random.Generator
) -> None:
    """At 1, 2 and 3 ms 15, 53 and 75 % of free strokes had no speed: 2 ms are 0.2 mm."""
    time_s = np.arange(0.35, 0.45, 1.0 / RATE_HZ)
    mean_mm_s = stroke(time_s)[1].mean()
    off = []
    for _ in range(50):
        at_s = np.arange(0.25, 0.56, SCAN_S)
        at_s = at_s[rng.random(at_s.size) >= lost]
        place = np.column_stack([np.round(stroke(at_s)[0], 1), np.full(at_s.size, 20.0)])
        stamp_s = np.sort(at_s + rng.normal(0.0, scatter_s, at_s.size))
        speed = path_among(place, stamp_s, time_s)[2]
        assert speed.any() == speed.all()
        if speed.any():
            off.append(speed.mean() / mean_mm_s - 1.0)
    assert len(off) > (0.95 if not lost else 0.8) * 50
    assert np.sqrt(np.mean(np.square(off))) < 0.02


def test_reports_that_are_stamped_together_are_told_apart_by_their_number() -> None:
    at_s = np.arange(0.25, 0.56, SCAN_S / 4.0)
    place = np.column_stack([np.round(stroke(at_s)[0], 1), np.full(at_s.size, 20.0)])
    time_s = np.arange(0.35, 0.45, 1.0 / RATE_HZ)
    together_s = np.ceil(at_s / SCAN_S) * SCAN_S  # as frames of a screen
    speed = path_among(place, together_s, time_s)[2]
    np.testing.assert_allclose(speed.mean(), stroke(time_s)[1].mean(), rtol=0.03)

"""Curves between keyframes: against closed forms, and splines of SciPy."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import BSpline

from frictus.effect_files.curves import CURVES
from frictus.effect_files.timeline import Timeline
from frictus.errors import TextureError


@settings(deadline=None)
@given(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0), st.integers(3, 20))
def test_akima_keeps_straight_lines_and_parabolas(
    slope: float, bend: float, count: int
) -> None:
    time_s = np.linspace(0.0, 1.0, count)
    at_s = np.linspace(0.0, 1.0, 77)
    straight = CURVES["Akima"](at_s, time_s, slope * time_s)
    np.testing.assert_allclose(straight, slope * at_s, atol=1e-9)
    # On even steps the weights of a parabola's chords are equal, so the slopes are exact.
    curved = CURVES["Akima"](at_s, time_s, bend * time_s**2)
    np.testing.assert_allclose(curved, bend * at_s**2, atol=1e-9)


@pytest.mark.parametrize("count", [3, 5, 9])
def test_bezier_arcs_are_those_of_their_three_points(
    count: int, rng: np.random.Generator
) -> None:
    time_s = np.cumsum(rng.uniform(0.01, 0.5, count))
    value = rng.uniform(-1.0, 1.0, count)
    u = np.linspace(0.0, 1.0, 50)
    weights = np.stack([(1.0 - u) ** 2, 2.0 * u * (1.0 - u), u**2])
    for first in range(0, count - 2, 2):
        arc = slice(first, first + 3)
        found = CURVES["Bezier"](time_s[arc] @ weights, time_s, value)
        np.testing.assert_allclose(found, value[arc] @ weights, atol=1e-7)


@pytest.mark.parametrize("count", [3, 4, 5, 20])
def test_bsplines_are_those_of_scipy(count: int, rng: np.random.Generator) -> None:
    points = np.stack([np.cumsum(rng.uniform(0.01, 0.5, count)), rng.uniform(-1, 1, count)], 1)
    inner = np.linspace(0.0, 1.0, count - 1)
    spline = BSpline(np.concatenate([[0.0, 0.0], inner, [1.0, 1.0]]), points, 2)
    at_s, wanted = spline(np.linspace(0.0, 1.0, 300)).T
    np.testing.assert_allclose(CURVES["Bspline"](at_s, *points.T), wanted, atol=1e-7)


@pytest.mark.parametrize("kind", CURVES)
@pytest.mark.parametrize("count", [1, 2, 3, 7])
def test_a_curve_holds_its_ends_outside_of_them(kind: str, count: int) -> None:
    time_s = 1.0 + np.arange(float(count))
    value = np.linspace(0.3, 0.7, count)
    before, first, last, after = CURVES[kind](
        np.array([0.0, 1.0, time_s[-1], time_s[-1] + 5.0]), time_s, value
    )
    assert (before, after) == pytest.approx((value[0], value[-1]))
    assert (first, last) == pytest.approx((value[0], value[-1]))


@pytest.mark.parametrize("duration_s", [1e-12, 5e-324])
def test_an_effect_shorter_than_any_sample_is_refused(duration_s: float) -> None:
    with pytest.raises(TextureError, match="less than a sample of 6000 Hz"):
        Timeline(duration_s)

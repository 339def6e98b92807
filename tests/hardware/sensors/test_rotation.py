"""Rotations: analytic angles, order, and matrices that are none."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from frictus_hardware.errors import ConfigError
from frictus_hardware.sensors.rotation import (
    Axis,
    angle_deg,
    checked_rotation,
    in_turn,
    nearest_rotation,
    rotated,
    rotation_about,
)

angles = st.floats(-720.0, 720.0)
turns = st.lists(st.tuples(st.sampled_from(["x", "y", "z"]), angles), max_size=5)


def test_right_handed_about_each_axis() -> None:
    x, y, z = np.eye(3)
    np.testing.assert_allclose(rotation_about("x", 90.0) @ y, z, atol=1e-15)
    np.testing.assert_allclose(rotation_about("y", 90.0) @ z, x, atol=1e-15)
    np.testing.assert_allclose(rotation_about("z", 90.0) @ x, y, atol=1e-15)


def test_the_first_turn_is_done_first_and_about_fixed_axes() -> None:
    z = np.array([[0.0, 0.0, 1.0]])
    np.testing.assert_allclose(
        rotated(z, in_turn([("x", 90.0), ("z", 90.0)])), [[1.0, 0.0, 0.0]], atol=1e-15
    )
    assert np.array_equal(in_turn([]), np.eye(3))


def test_the_rotations_of_the_paper() -> None:
    cos, sin = np.cos(np.deg2rad(155.0)), np.sin(np.deg2rad(155.0))
    expected = [[-1.0, 0.0, 0.0], [0.0, cos, -sin], [0.0, -sin, -cos]]
    np.testing.assert_allclose(in_turn([("x", 155.0), ("y", 180.0)]), expected, atol=1e-15)


@settings(max_examples=30)
@given(turns)
def test_any_turns_make_a_rotation_that_passes_the_check(
    some: list[tuple[Axis, float]],
) -> None:
    rotation = in_turn(some)
    np.testing.assert_allclose(checked_rotation(rotation), rotation, atol=1e-12)
    np.testing.assert_allclose(checked_rotation(np.round(rotation, 4)), rotation, atol=2e-4)


@given(st.sampled_from(["x", "y", "z"]), st.floats(0.0, 180.0))
def test_the_angle_of_a_rotation(axis: Axis, angle: float) -> None:
    assert angle_deg(rotation_about(axis, angle)) == pytest.approx(angle, abs=1e-6)


def test_the_nearest_rotation_of_a_scaled_one_is_itself() -> None:
    rotation = in_turn([("x", 20.0), ("z", 50.0)])
    np.testing.assert_allclose(nearest_rotation(3.0 * rotation), rotation, atol=1e-14)


@pytest.mark.parametrize(
    ("matrix", "why"),
    [
        (np.eye(2), "shape"),
        (1.01 * np.eye(3), "orthonormal"),
        (np.full((3, 3), np.nan), "orthonormal"),
        (np.diag([1.0, 1.0, -1.0]), "mirrors"),
        (np.zeros((3, 3)), "orthonormal"),
    ],
)
def test_matrices_that_are_no_rotation(matrix: np.ndarray, why: str) -> None:
    with pytest.raises(ConfigError, match=why):
        checked_rotation(matrix)


def test_turns_that_are_none() -> None:
    with pytest.raises(ConfigError, match="about x, y or z"):
        in_turn([("w", 10.0)])  # type: ignore[list-item]
    with pytest.raises(ConfigError, match="not finite"):
        in_turn([("x", np.nan)])

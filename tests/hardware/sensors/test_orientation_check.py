"""Guided taps: the rotation that was mounted is found, and what does not fit is told."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from frictus_hardware.arrays import FloatArray
from frictus_hardware.errors import SensorError
from frictus_hardware.sensors.rotation import (
    angle_deg,
    check_orientation,
    in_turn,
    tap_direction,
)

RATE_HZ = 20_000.0
GRAVITY = np.array([0.0, 0.0, 9.81])

turns = st.tuples(st.floats(-180.0, 180.0), st.floats(-180.0, 180.0), st.floats(-180.0, 180.0))


def ringing(direction: FloatArray) -> FloatArray:
    """Rest, then a decaying swing that begins along the direction."""
    time_s = np.arange(2000) / RATE_HZ
    swing = 30.0 * np.exp(-time_s / 0.003) * np.sin(2.0 * np.pi * 300.0 * time_s)
    along = np.concatenate([np.zeros(3000), swing])
    return GRAVITY + along[:, np.newaxis] * direction


def taps(mounted: FloatArray) -> list[FloatArray]:
    """Three taps as a sensor feels them that is mounted by this rotation."""
    return [ringing(axis) @ mounted for axis in np.eye(3)]


def mounted_by(angles: tuple[float, float, float]) -> FloatArray:
    return in_turn(list(zip(("x", "y", "z"), angles, strict=True)))


@settings(max_examples=30)
@given(turns, turns)
def test_the_mounted_rotation_is_found_whatever_is_configured(
    true: tuple[float, float, float], configured: tuple[float, float, float]
) -> None:
    mounted, guess = mounted_by(true), mounted_by(configured)
    found = check_orientation(taps(mounted), guess)
    np.testing.assert_allclose(found.rotation, mounted, atol=1e-9)
    assert found.off_deg == pytest.approx(angle_deg(guess @ mounted.T), abs=1e-6)
    assert found.fits == all(off <= 20.0 for off in found.tap_off_deg)
    assert not found.mirrored


def test_through_noise_and_a_crooked_hand(rng: np.random.Generator) -> None:
    mounted = in_turn([("x", 155.0), ("y", 180.0)])
    crooked = [
        ringing(axis @ in_turn([("x", 8.0), ("y", -5.0)])) @ mounted
        + rng.normal(scale=0.3, size=(5000, 3))
        for axis in np.eye(3)
    ]
    found = check_orientation(crooked, mounted)
    assert found.fits
    assert found.off_deg == pytest.approx(np.hypot(8.0, 5.0), abs=2.0)
    assert found.text().startswith("the rotation fits")
    wrong = check_orientation(crooked, np.eye(3))
    assert not wrong.fits
    assert f"{wrong.rotation[0, 0]:.4f}" in wrong.text()


def test_a_wrong_sign_is_told_as_such() -> None:
    found = check_orientation([tap * [1.0, -1.0, 1.0] for tap in taps(np.eye(3))], np.eye(3))
    assert found.mirrored
    assert not found.fits
    assert found.tap_off_deg == pytest.approx((0.0, 180.0, 0.0), abs=1e-3)
    assert "wrong sign" in found.text()


def test_what_is_no_tap(rng: np.random.Generator) -> None:
    one = taps(np.eye(3))
    with pytest.raises(SensorError, match="2 were given"):
        check_orientation(one[:2], np.eye(3))
    with pytest.raises(SensorError, match="three different lines"):
        check_orientation([one[0], one[1], one[0]], np.eye(3))
    with pytest.raises(SensorError, match="along y does not stand out"):
        check_orientation([one[0], rng.normal(size=(1000, 3)), one[2]], np.eye(3))
    with pytest.raises(SensorError, match="does not stand out"):
        tap_direction(np.zeros((100, 3)))
    with pytest.raises(SensorError, match="not finite"):
        tap_direction(np.full((100, 3), np.nan))
    stirred = np.zeros((1000, 3))
    angle = np.linspace(0.0, 2.0 * np.pi, 100)
    stirred[500:600, :2] = np.column_stack([np.cos(angle), np.sin(angle)])
    with pytest.raises(SensorError, match="no single line"):
        tap_direction(stirred)

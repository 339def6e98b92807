"""What the accelerometer on a virtual nail senses: the finger, its skin, and gravity."""

import numpy as np
import pytest

from frictus_hardware.arrays import FloatArray
from frictus_hardware.sensors.rotation import in_turn
from frictus_hardware.simulated.config import SimulatedConfig
from frictus_hardware.simulated.rig import SimulatedRig
from frictus_hardware.simulated.sensors import GRAVITY_M_S2, NailConfig
from frictus_hardware.simulated.strokes import SinusoidalStrokes

UPRIGHT = NailConfig(stroke_tilt_deg=0.0, wander_tilt_deg=0.0)
STROKES = SinusoidalStrokes(peak_speed_mm_s=90.0, span_mm=50.0)


def sensed(nail: NailConfig, seconds: float = 2.0) -> tuple[FloatArray, FloatArray]:
    """Return acceleration of the nail and velocity of the finger, both along x, y (and z)."""
    config = SimulatedConfig(
        clock="virtual",
        finger=STROKES,
        nail=nail,
        accel_noise_m_s2=0.0,
        force_noise_n=0.0,
        quantisation=False,
    )
    accel, velocity = [], []
    with SimulatedRig(config) as rig:
        for _ in range(round(200 * seconds)):
            got = rig.exchange(np.zeros(100))
            assert got.truth is not None
            accel.append(got.accel_m_s2)
            velocity.append(got.truth.velocity_mm_s)
    return np.concatenate(accel), np.concatenate(velocity)


def test_the_velocity_is_the_integral_of_what_is_sensed() -> None:
    accel, velocity = sensed(UPRIGHT)
    # Between two turns friction is nearly constant, and so is what the skin gives way.
    fast = np.flatnonzero(velocity[:, 0] < -60.0)
    first, last = fast[0], fast[fast.size // 2]
    gained = 1e3 * np.cumsum(accel[:, 0]) / 20_000.0
    np.testing.assert_allclose(
        gained[last] - gained[first], velocity[last, 0] - velocity[first, 0], atol=1.5
    )


def test_gravity_points_into_the_screen_and_leaks_where_the_nail_leans() -> None:
    upright, _ = sensed(UPRIGHT, 0.5)
    np.testing.assert_allclose(upright[:, 2], -GRAVITY_M_S2)
    leaning, _ = sensed(NailConfig(stroke_tilt_deg=10.0, wander_tilt_deg=0.0), 2.0)
    leak = leaning[:, 0] - sensed(UPRIGHT, 2.0)[0][:, 0]
    # 50 of 70 mm: 3.6 degrees to each side.
    assert np.ptp(leak) == pytest.approx(
        2 * GRAVITY_M_S2 * np.sin(np.deg2rad(25 / 7)), rel=0.01
    )
    assert np.all(leaning[:, 2] > -GRAVITY_M_S2 - 1e-9)


def test_a_sensor_mounted_another_way_senses_the_same_vector() -> None:
    angles = 30.0, -50.0, 170.0
    straight, _ = sensed(UPRIGHT, 0.3)
    turned, _ = sensed(UPRIGHT.model_copy(update={"mounted_deg": angles}), 0.3)
    rotation = in_turn(tuple(zip(("x", "y", "z"), angles, strict=True)))
    np.testing.assert_allclose(turned, straight @ rotation.T, atol=1e-9)


def test_a_resonance_passes_slow_motion_and_rings_at_its_frequency() -> None:
    soft = UPRIGHT.model_copy(update={"resonance_hz": 200.0})
    rigid, ringing = (sensed(nail, 2.0)[0][10_000:, 0] for nail in (UPRIGHT, soft))
    hz = np.fft.rfftfreq(rigid.size, 1.0 / 20_000.0)
    gain = np.abs(np.fft.rfft(ringing)) / np.abs(np.fft.rfft(rigid))
    slow, near = (hz > 0.2) & (hz < 3.0), np.abs(hz - 200.0) < 5.0
    assert np.median(gain[slow]) == pytest.approx(1.0, abs=0.05)
    assert np.median(gain[near]) > 5.0


def test_the_nail_does_not_change_how_the_finger_moves() -> None:
    _, one = sensed(UPRIGHT, 0.2)
    _, other = sensed(NailConfig(wander_tilt_deg=3.0), 0.2)
    np.testing.assert_array_equal(one, other)

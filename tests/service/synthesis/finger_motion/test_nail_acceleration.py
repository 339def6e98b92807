"""The finger's acceleration out of a nail that shakes with the texture."""

import numpy as np
import pytest

from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics import linear
from frictus_hardware.physics.linear import Mobility
from frictus_service.synthesis.finger_motion.nail_acceleration import NailAcceleration

pytestmark = pytest.mark.compiled

RATE = 20_000.0
SECONDS = 3.0
TIME_S = np.arange(round(SECONDS * RATE)) / RATE


def friction(rng: np.random.Generator) -> FloatArray:
    """Return friction of a texture, 20 Hz to 1 kHz, that reverses twice a second."""
    hz = rng.uniform(20.0, 1_000.0, (2, 40))
    phase = rng.uniform(0.0, 2.0 * np.pi, (2, 40))
    force = np.zeros((TIME_S.size, 3))
    for axis, size in ((0, 0.02), (1, 0.004)):
        waves = np.cos(2.0 * np.pi * np.outer(TIME_S, hz[axis]) + phase[axis])
        force[:, axis] = size * waves.sum(axis=1)
    force[:, 0] += 0.2 * np.tanh(200.0 * np.sin(2.0 * np.pi * TIME_S))
    force[:, 2] = 0.4
    return force


def strokes() -> FloatArray:
    """Return the acceleration of a finger that strokes at 1 Hz, m/s²."""
    accel = np.zeros((TIME_S.size, 3))
    accel[:, 0] = 0.8 * np.cos(2.0 * np.pi * TIME_S)
    accel[:, 1] = 0.1
    return accel


def shaken(force_n: FloatArray, skin: Mobility) -> FloatArray:
    response = linear.sample(skin.acceleration, RATE)
    accel = np.zeros_like(force_n)
    accel[:, :2], _ = response.run(-force_n[:, :2], response.at_rest(2))
    return accel


def averages(
    nail: NailAcceleration, force: FloatArray, accel: FloatArray, block: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the time of each average, the averages and their variances, m/s²."""
    rows = []
    for first in range(0, TIME_S.size - block + 1, block):
        part = slice(first, first + block)
        found = nail.follow(force[part], accel[part])
        if found is not None:
            at_s = (first + block) / RATE - found.age_s
            rows.append((at_s, *(1e-3 * found.mm_s2), *(1e-6 * found.variance)))
    table = np.array(rows)
    return table[:, 0], table[:, 1:3], table[:, 3:5]


@pytest.mark.parametrize("late_ms", [-1.0, -0.3, 0.3, 1.0])
def test_a_delay_between_the_sensors_is_found(rng: np.random.Generator, late_ms: float) -> None:
    skin, force = some_skin(rng), friction(rng)
    accel = shaken(force, skin) + strokes()
    late = round(1e-3 * late_ms * RATE)
    nail = NailAcceleration(RATE, 100)
    at_s, found, _ = averages(nail, force, np.roll(accel, late, axis=0), 100)
    assert 1e3 * nail.delay_s == pytest.approx(late_ms, abs=0.06)
    # What is delayed is the earlier of the two, and the average then holds for as much before.
    true = 0.8 * np.cos(2.0 * np.pi * (at_s - 1e-3 * max(late_ms, 0.0)))
    assert np.sqrt(np.mean((found[:, 0] - true)[at_s > 2.0] ** 2)) < 0.3


def some_skin(rng: np.random.Generator) -> Mobility:
    mass, damping, stiffness = np.exp(rng.normal(0.0, 0.3, 3))
    return Mobility(0.0015 * mass, 1.3 * damping, 444.0 * stiffness)


@pytest.mark.parametrize("block", [40, 100, 200])
def test_the_skin_is_found_and_what_it_does_taken_off(
    rng: np.random.Generator, block: int
) -> None:
    skin, force = some_skin(rng), friction(rng)
    noise = 0.05 * rng.standard_normal(force.shape)
    nail = NailAcceleration(RATE, block)
    at_s, found, variance = averages(
        nail, force, shaken(force, skin) + strokes() + noise, block
    )
    later = at_s > 1.0
    true = np.column_stack([0.8 * np.cos(2.0 * np.pi * at_s), np.full(at_s.size, 0.1)])
    error = (found - true)[later]
    assert np.sqrt(np.mean(error**2)) < 0.25
    # Without a force nothing is taken off.
    _, raw, _ = averages(NailAcceleration(RATE, block), 0.0 * force, shaken(force, skin), block)
    shakes = np.std(raw[later, 0])
    assert shakes > 8.0 * np.std(error[:, 0])
    assert np.mean(error**2 / variance[later]) < 2.0
    assert nail.skin is not None
    assert nail.skin.mass_kg == pytest.approx(skin.mass_kg, rel=0.05)
    assert nail.skin.damping_n_s_m == pytest.approx(skin.damping_n_s_m, rel=0.05)
    assert nail.skin.stiffness_n_m == pytest.approx(skin.stiffness_n_m, rel=0.05)


def test_the_variance_is_that_of_the_noise(rng: np.random.Generator) -> None:
    noise = 8.0 * rng.standard_normal((TIME_S.size, 3))
    noise[TIME_S < 1.5] *= 0.25
    nail = NailAcceleration(RATE, 100)
    at_s, found, variance = averages(nail, friction(rng), strokes() + noise, 100)
    true = np.column_stack([0.8 * np.cos(2.0 * np.pi * at_s), np.full(at_s.size, 0.1)])
    share = (found - true) ** 2 / variance
    for part in ((at_s > 0.5) & (at_s < 1.5), at_s > 2.0):
        assert 0.3 < np.mean(share[part]) < 2.0


def test_a_sensor_that_does_not_shake_with_the_skin_is_read_as_it_is(
    rng: np.random.Generator,
) -> None:
    force = friction(rng)
    nail = NailAcceleration(RATE, 100)
    at_s, found, _ = averages(
        nail, force, strokes() + 0.05 * rng.standard_normal(force.shape), 100
    )
    true = 0.8 * np.cos(2.0 * np.pi * at_s)
    assert np.sqrt(np.mean((found[:, 0] - true)[at_s > 1.0] ** 2)) < 0.2


def test_without_friction_the_average_is_that_of_its_window(rng: np.random.Generator) -> None:
    nail = NailAcceleration(RATE, 100)
    accel = np.zeros((TIME_S.size, 3))
    accel[:, 0] = 3.0 + 0.7 * TIME_S  # a straight line has its middle's value
    at_s, found, _ = averages(nail, np.zeros_like(accel), accel, 100)
    np.testing.assert_allclose(found[:, 0], 3.0 + 0.7 * (at_s - 0.5 / RATE), atol=1e-4)
    np.testing.assert_allclose(found[:, 1], 0.0, atol=1e-12)


@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e300, -1e300])
def test_it_recovers_from_any_number(rng: np.random.Generator, bad: float) -> None:
    force = friction(rng)
    accel = shaken(force, Mobility()) + strokes()
    nail = NailAcceleration(RATE, 100)
    averages(nail, force, accel, 100)
    spoilt = accel[:100].copy()
    spoilt[50, 0] = bad
    nail.follow(force[:100], spoilt)
    nail.follow(np.full((100, 3), bad), accel[:100])
    _, found, variance = averages(nail, force, accel, 100)
    assert np.all(np.isfinite(found))
    assert np.all(np.isfinite(variance))
    assert np.sqrt(np.mean(found[-200:, 0] ** 2)) < 1.0

"""Another order of roll-off and of damping, against the exact powers."""

import numpy as np
import pytest
from numpy.typing import NDArray

from frictus_hardware.physics.friction import modes, pole_zero_pairs
from frictus_hardware.physics.skin import damping_of

pytestmark = pytest.mark.compiled

ORDERS = [-0.5, -0.12, 0.03, 0.12, 0.5]
BAND_HZ = np.geomspace(5.0, 3000.0, 300)


def assert_close(found: NDArray[np.complex128], exact: NDArray[np.complexfloating]) -> None:
    ratio = found / exact
    assert np.max(np.abs(20.0 * np.log10(np.abs(ratio)))) <= 0.05
    assert np.max(np.abs(np.angle(ratio, deg=True))) <= 0.5


@pytest.mark.parametrize("cutoff_hz", [150.0, 400.0, 1200.0, 5000.0])
@pytest.mark.parametrize("order", ORDERS)
def test_pairs_meet_the_power_over_the_band(order: float, cutoff_hz: float) -> None:
    u = 1j * BAND_HZ / cutoff_hz
    zero, pole = np.array(pole_zero_pairs(order)).T
    cascade = np.prod((1.0 + u[:, None] / zero) / (1.0 + u[:, None] / pole), axis=1)
    assert_close(cascade, (1.0 + u) ** -order)
    parts = modes(order)
    summed = np.sum(parts.weight / (1.0 + u[:, None] / parts.pole), axis=1)
    np.testing.assert_allclose(summed, cascade / (1.0 + u), rtol=1e-9)


@pytest.mark.parametrize("order", ORDERS)
def test_pairs_are_stable_and_minimum_phase_and_alternate(order: float) -> None:
    zero, pole = np.array(pole_zero_pairs(order)).T
    assert min(zero.min(), pole.min()) > 1.0
    first, second = (pole, zero) if order > 0.0 else (zero, pole)
    assert np.all(first < second)
    assert np.all(second[:-1] < first[1:])


def test_no_excess_is_first_order() -> None:
    assert pole_zero_pairs(0.0) == ()
    np.testing.assert_array_equal(modes(0.0).pole, [1.0])
    np.testing.assert_array_equal(modes(0.0).weight, [1.0])


def test_opposite_orders_swap_poles_and_zeros() -> None:
    swapped = tuple((pole, zero) for zero, pole in pole_zero_pairs(0.2))
    np.testing.assert_allclose(pole_zero_pairs(-0.2), swapped)


@pytest.mark.parametrize("order", [0.0, 0.3])
def test_friction_read_early_is_that_of_a_drive_that_comes_late(order: float) -> None:
    # After a step of the drive, read `early` of a step before the end of each.
    parts, rate_hz, early = modes(order), 80_000.0, 0.3
    friction, _ = parts.respond(
        np.ones(50), np.full(50, 900.0), rate_hz, early, parts.at_rest()
    )
    time_s = (np.arange(1.0, 51.0) - early) / rate_hz
    decay = np.exp(-2.0 * np.pi * 900.0 * np.multiply.outer(time_s, parts.pole))
    np.testing.assert_allclose(friction, 1.0 - decay @ parts.weight, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("order", ORDERS)
def test_damping_of_another_order_over_the_band(order: float) -> None:
    s = 2j * np.pi * BAND_HZ
    found = damping_of(order)
    low_passed = found.pole_rad_s / (s[:, None] + found.pole_rad_s)
    simulated = found.direct + low_passed @ found.weight + s * found.mass + found.spring / s
    assert_close(simulated, (s / (2.0 * np.pi * 200.0)) ** order)
    everywhere = 2j * np.pi * np.geomspace(1e-3, 1e6, 500)
    anywhere = (
        found.direct
        + found.pole_rad_s / (everywhere[:, None] + found.pole_rad_s) @ found.weight
    )
    assert np.all(anywhere.real >= -1e-12)  # it takes energy, at any frequency

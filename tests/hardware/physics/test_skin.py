"""The skin that follows a law moves as its mobility says, however light and strongly damped."""

import numpy as np
import pytest

from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.friction import FrictionLaw
from frictus_hardware.physics.linear import Mobility
from frictus_hardware.physics.schedule import SlidingConditions
from frictus_hardware.physics.skin import NonlinearSkin, SkinLaw
from frictus_hardware.physics.twin import Signals

pytestmark = pytest.mark.compiled

RATE_HZ = 80_000.0  # of the twin within
SECONDS = 0.5


def pushed(force_n: FloatArray) -> Signals:
    """A finger that slides at 60 mm/s and feels a force along x."""
    count = force_n.size
    along = np.zeros((count, 2))
    along[:, 0] = 60.0
    force = np.zeros((count, 3))
    force[:, 0] = force_n
    return Signals(
        sample_rate_hz=RATE_HZ,
        voltage_v=np.zeros(count),
        screen_v=np.zeros(count),
        position_mm=along / 2.0,
        velocity_mm_s=along,
        normal_force_n=np.full(count, 0.4),
        in_contact=np.ones(count, dtype=np.bool_),
        drive_fraction=np.zeros(count),
        friction_n=np.zeros(count),
        finger_force_n=force,
        force_n=np.zeros((count, 3)),
        accel_m_s2=np.zeros((count, 3)),
    )


def response(mobility: Mobility, skin: SkinLaw, tone_hz: float) -> complex:
    """Acceleration over force at a tone, from the second half of a simulation."""
    time_s = np.arange(round(SECONDS * RATE_HZ)) / RATE_HZ
    stage = NonlinearSkin(mobility, skin, FrictionLaw(), 0.0)
    run, _ = stage.run(pushed(np.cos(2.0 * np.pi * tone_hz * time_s)), stage.initial())
    accel = run.accel_m_s2[:, 0]
    assert np.isfinite(accel).all()
    settled = slice(time_s.size // 2, None)
    turn = np.exp(-2j * np.pi * tone_hz * time_s[settled])
    return complex(2.0 * np.mean(accel[settled] * turn))


def assert_close(found: complex, expected: complex, tone_hz: float) -> None:
    """Same size, and late by half a sample at most: a mean over one is that late."""
    ratio = found / expected
    assert abs(abs(ratio) - 1.0) < 0.03
    assert abs(np.angle(ratio)) < np.pi * tone_hz / RATE_HZ + 0.01


@pytest.mark.parametrize(
    ("mass_kg", "damping_n_s_m", "stiffness_n_m"),
    [
        (1.5e-3, 1.3, 444.0),  # as fingers are
        (1e-4, 12.5, 1e5),  # about the last that Runge and Kutta's method follows
        (1e-4, 13.5, 1e5),
        (1e-4, 39.0, 1e5),  # beyond here it would grow
        (1e-4, 100.0, 1e5),
        (1e-4, 100.0, 1.0),
    ],
)
@pytest.mark.parametrize("tone_hz", [60.0, 500.0, 1_500.0])
def test_it_moves_as_its_mobility_says(
    mass_kg: float, damping_n_s_m: float, stiffness_n_m: float, tone_hz: float
) -> None:
    s = 2j * np.pi * tone_hz
    expected = s**2 / (mass_kg * s**2 + damping_n_s_m * s + stiffness_n_m)
    mobility = Mobility(mass_kg, damping_n_s_m, stiffness_n_m)
    assert_close(response(mobility, SkinLaw(), tone_hz), expected, tone_hz)


@pytest.mark.parametrize("order", [-0.5, 0.5])
@pytest.mark.parametrize(("mass_kg", "damping_n_s_m"), [(1.5e-3, 1.3), (1e-4, 40.0)])
def test_damping_of_another_order_is_followed_too(
    mass_kg: float, damping_n_s_m: float, order: float
) -> None:
    mobility, skin = Mobility(mass_kg, damping_n_s_m, 1e4), SkinLaw(damping_excess_order=order)
    nowhere = SlidingConditions(*np.zeros((5, 1)))
    velocity = skin.frequency_response(mobility, np.array([300.0]), nowhere)
    expected = 2j * np.pi * 300.0 * complex(velocity[0])
    assert_close(response(mobility, skin, 300.0), expected, 300.0)

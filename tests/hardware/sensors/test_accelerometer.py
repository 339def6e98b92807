"""Accelerometers: volts to the rig frame, and the ends of the range."""

import numpy as np
import pytest

from frictus_hardware.errors import ConfigError
from frictus_hardware.sensors.analogue import (
    STANDARD_GRAVITY_M_S2,
    Accelerometer,
    acceleration,
    saturated,
    sensed,
)
from frictus_hardware.sensors.rotation import in_turn

ZERO_V = (0.9, 0.91, 0.88)
SLOPE_V_PER_G = (0.08, 0.082, -0.079)


def accelerometer(**changes: object) -> Accelerometer:
    settings: dict[str, object] = {
        "zero_g_v": ZERO_V,
        "sensitivity_v_per_g": SLOPE_V_PER_G,
        "output_range_v": (0.0, 1.8),
        "rotation": in_turn([("x", 155.0), ("y", 180.0)]),
    }
    return Accelerometer(**(settings | changes))  # type: ignore[arg-type]


def test_one_g_on_each_axis() -> None:
    volts = np.array(ZERO_V) + np.diag(SLOPE_V_PER_G)
    np.testing.assert_allclose(
        sensed(accelerometer(), volts), STANDARD_GRAVITY_M_S2 * np.eye(3), atol=1e-12
    )


def test_what_the_rig_does_comes_back_from_volts(rng: np.random.Generator) -> None:
    one = accelerometer()
    in_rig = rng.normal(scale=20.0, size=(100, 3))
    in_sensor = in_rig @ one.rotation  # the inverse of a rotation is its transpose
    volts = np.array(ZERO_V) + in_sensor / STANDARD_GRAVITY_M_S2 * SLOPE_V_PER_G
    np.testing.assert_allclose(acceleration(one, volts), in_rig, atol=1e-10)


def test_saturation_by_sample_and_channel() -> None:
    volts = np.tile(ZERO_V, (5, 1))
    assert not saturated(accelerometer(), volts).any()
    volts[1, 0], volts[2, 1], volts[3, 2] = 1.8, 0.005, np.nan
    assert np.array_equal(
        np.argwhere(saturated(accelerometer(), volts)), [[1, 0], [2, 1], [3, 2]]
    )


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"output_range_v": (1.8, 0.0)}, "the lower comes first"),
        ({"output_range_v": (0.0, np.nan)}, "the lower comes first"),
        ({"zero_g_v": (0.9, 1.9, 0.9)}, "within output_range_v"),
        ({"zero_g_v": (0.9, np.nan, 0.9)}, "within output_range_v"),
        ({"sensitivity_v_per_g": (0.08, 0.0, 0.08)}, "other than 0"),
        ({"sensitivity_v_per_g": (0.08, np.inf, 0.08)}, "finite"),
        ({"rotation": 2.0 * np.eye(3)}, "no rotation"),
    ],
)
def test_what_cannot_be_an_accelerometer(changes: dict[str, object], why: str) -> None:
    with pytest.raises(ConfigError, match=why):
        accelerometer(**changes)

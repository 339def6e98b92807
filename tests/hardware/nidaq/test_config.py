"""The configuration refuses what cannot be, and names the field."""

from dataclasses import replace

import numpy as np
import pytest
from tests.hardware.nidaq.bench import ACCEL, FORCE, conversion, input_volts, wiring

from frictus_hardware.errors import ConfigError
from frictus_hardware.nidaq.config import Inputs


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("amplifier_gain", 0.0),
        ("amplifier_gain", 5.0),  # 15 V at the output
        ("monitor_gain", -50.0),
        ("screen_peak_v", 75.1),
        ("screen_peak_v", np.nan),
        ("screen_mm", (70.0, 0.0)),
        ("sample_rate_hz", 0.0),
        ("block_ms", np.inf),
        ("lead_ms", -1.0),
        ("lead_ms", 12.0),  # less than a block beside the reserve
        ("reserve_ms", -0.1),
        ("deadline_s", 0.0),
        ("device", "Dev1/ai0"),
        ("device", ""),
        ("output", "ai0"),
        ("address", "rig-pc"),
        ("force", Inputs(())),
        ("force", Inputs(("Dev1/ai0",))),
        ("force", replace(FORCE, range_v=11.0)),
        ("accel", replace(ACCEL, terminals="single")),  # type: ignore[arg-type]
        ("accel", Inputs(("ai5", "ai6", "ai7"))),  # ai5 is a gauge
        ("monitor", Inputs(("ai9", "ai10"))),
    ],
)
def test_what_cannot_be_is_refused_by_name(field: str, value: object) -> None:
    with pytest.raises(ConfigError, match=field):
        wiring(**{field: value})


def test_the_lead_is_what_is_in_the_device_and_the_reserve() -> None:
    config = wiring(lead_ms=30.0, reserve_ms=10.0, block_ms=2.0)
    assert config.lead_samples == 600
    assert config.device_lead_samples == 400
    assert config.block_samples == 40
    assert config.channels == tuple(f"ai{index}" for index in range(10))
    assert config.peak_output_v == 1.5


def test_linear_conversion_undoes_the_sensors(rng: np.random.Generator) -> None:
    force_n, accel = rng.normal(size=(2, 50, 3))
    monitor_v = rng.uniform(-1.5, 1.5, 50)
    sensed = conversion(wiring())(input_volts(force_n, accel, monitor_v).T)
    np.testing.assert_allclose(sensed.force_n, force_n, atol=1e-12)
    np.testing.assert_allclose(sensed.accel_m_s2, accel, atol=1e-12)
    np.testing.assert_array_equal(sensed.voltage_v, 50.0 * monitor_v)

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
        ("screen_mm", (10_001.0, 35.0)),
        ("sample_rate_hz", 0.0),
        ("block_ms", np.inf),
        ("lead_ms", -1.0),
        ("lead_ms", 0.9),
        ("reserve_ms", -0.1),
        ("reserve_ms", 30.0),  # nothing is left in the device
        ("reserve_ms", 1_001.0),
        ("max_lead_ms", 29.9),  # less than the lead
        ("max_lead_ms", np.nan),
        ("max_lead_ms", 1_001.0),
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


@pytest.mark.parametrize(
    ("lead_ms", "reserve", "piece"),
    [(2.0, 13, 27), (5.0, 33, 67), (10.0, 67, 100), (20.0, 133, 100), (60.0, 200, 100)],
)
def test_a_short_lead_is_all_that_need_be_configured(
    lead_ms: float, reserve: int, piece: int
) -> None:
    config = wiring(lead_ms=lead_ms)
    assert config.reserve_samples == reserve
    assert config.block_samples == piece <= config.device_lead_samples
    assert config.buffer_samples >= 2 * (400 + piece)


def test_a_lead_that_cannot_hold_names_what_does_not_fit() -> None:
    with pytest.raises(ConfigError) as raised:
        wiring(lead_ms=12.0, reserve_ms=10.0, block_ms=5.0)
    assert str(raised.value) == (
        "lead_ms = 12 less reserve_ms = 10 ms leaves 2 ms in the device, less than a piece of "
        "5 ms that is written at once: raise lead_ms, or lower reserve_ms or transfer_ms "
        "(block_ms)"
    )


@pytest.mark.parametrize(
    ("lead_ms", "fits"), [(2.0, False), (5.0, False), (7.4, False), (7.6, True), (30.0, True)]
)
def test_on_usb_a_part_of_5_ms_has_to_be_in_the_device(lead_ms: float, fits: bool) -> None:
    wrong = wiring(lead_ms=lead_ms).too_short_for_usb
    assert (wrong is None) == fits
    assert wrong is None or f"lead_ms = {lead_ms:g}" in wrong


@pytest.mark.parametrize(
    ("lead_ms", "max_lead_ms", "longest"),
    [(30.0, None, 600), (15.0, None, 400), (15.0, 15.0, 300), (15.0, 40.0, 800)],
)
def test_a_short_lead_may_grow_to_20_ms_or_as_configured(
    lead_ms: float, max_lead_ms: float | None, longest: int
) -> None:
    config = wiring(lead_ms=lead_ms, max_lead_ms=max_lead_ms, reserve_ms=10.0)
    assert config.max_lead_samples == longest
    assert config.max_device_lead_samples == longest - 200


def test_linear_conversion_undoes_the_sensors(rng: np.random.Generator) -> None:
    force_n, accel = rng.normal(size=(2, 50, 3))
    monitor_v = rng.uniform(-1.5, 1.5, 50)
    sensed = conversion(wiring())(input_volts(force_n, accel, monitor_v).T)
    np.testing.assert_allclose(sensed.force_n, force_n, atol=1e-12)
    np.testing.assert_allclose(sensed.accel_m_s2, accel, atol=1e-12)
    np.testing.assert_array_equal(sensed.voltage_v, 50.0 * monitor_v)

"""What a soak is judged by; the soak itself is a command of its own."""

from dataclasses import replace

import numpy as np
import pytest
from tests.campaigns.soak import COUNTERS, Window, judged, slope

GOOD = Window(
    end_s=60.0,
    received=100_000,
    lost=0,
    frames_hz=60.0,
    recorder_lost=0,
    lateness_p99_ms=0.2,
    counted=dict.fromkeys(COUNTERS, 0),
    memory_mb={},
    descriptors={},
)


def test_a_slope_has_its_interval() -> None:
    hours = np.linspace(0.0, 1.0, 60)
    rng = np.random.default_rng(3)
    rise, half = slope(hours, 200.0 + 5.0 * hours + rng.normal(0.0, 0.5, 60))
    assert abs(rise - 5.0) < half < 1.0


def test_the_first_window_is_for_settling() -> None:
    assert judged([replace(GOOD, lost=5_000), GOOD, GOOD]) == []


@pytest.mark.parametrize(
    ("bad", "told"),
    [
        (replace(GOOD, lost=100), "subscribers lost 100"),
        (replace(GOOD, received=0), "subscribers lost 0 of 0"),
        (replace(GOOD, lateness_p99_ms=2.0), "lateness p99 2.00 ms"),
        (replace(GOOD, counted=GOOD.counted | {"trips": 1}), "trips: 1"),
    ],
)
def test_what_a_quiet_soak_must_not_show(bad: Window, told: str) -> None:
    (wrong,) = judged([GOOD, bad])
    assert told in wrong

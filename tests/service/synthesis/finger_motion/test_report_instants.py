"""Reports are taken when they were made: evenly where their stamps scatter, else as stamped."""

import numpy as np
import pytest

from frictus_hardware.arrays import FloatArray
from frictus_service.synthesis.finger_motion.report_instants import ReportInstants

SCAN_S = 1.0 / 60.0
STROKES_HZ = 0.6
SETTLED = 60
"""Reports."""


def off_s(made_s: FloatArray, stamp_s: FloatArray) -> FloatArray:
    """Return how far instants are off, of a finger that goes back and forth over 50 mm."""
    instants, found = ReportInstants(), []
    for made, stamp in zip(made_s, stamp_s, strict=True):
        x_mm = 35.0 + 25.0 * np.sin(2.0 * np.pi * STROKES_HZ * made)
        found.append(instants.instant_s(float(stamp), (round(float(x_mm), 1), 20.0)) - made)
    return np.array(found)


def rms_s(off: FloatArray) -> float:
    return float(np.sqrt(np.mean(np.square(off[SETTLED:] - np.mean(off[SETTLED:])))))


@pytest.mark.parametrize("scatter_s", [1e-3, 2e-3, 3e-3])
@pytest.mark.parametrize("rate_hz", [60.0, 90.0])
def test_stamps_that_scatter_are_smoothed(
    rate_hz: float, scatter_s: float, rng: np.random.Generator
) -> None:
    made_s: FloatArray = np.arange(round(20.0 * rate_hz)) / rate_hz
    stamp_s = np.maximum.accumulate(made_s + rng.normal(0.0, scatter_s, made_s.size))
    stamp_s += np.arange(made_s.size) * 1e-9  # rising
    assert rms_s(off_s(made_s, stamp_s)) < 0.5 * scatter_s


def test_reports_that_are_polled_are_smoothed() -> None:
    made_s: FloatArray = np.arange(1_200, dtype=np.float64) * SCAN_S
    polled_s: FloatArray = 0.008 * np.ceil(made_s / 0.008)
    assert rms_s(off_s(made_s, polled_s)) < 0.2 * rms_s(polled_s - made_s)


def test_reports_that_are_lost_do_not_mislead(rng: np.random.Generator) -> None:
    kept = rng.random(1_200) > 0.05
    made_s = np.arange(1_200, dtype=np.float64)[kept] * SCAN_S
    stamp_s = made_s + rng.normal(0.0, 1e-3, made_s.size)
    assert rms_s(off_s(made_s, stamp_s)) < 0.7e-3


@pytest.mark.parametrize("evenly", [True, False])
def test_exact_stamps_are_believed(evenly: bool, rng: np.random.Generator) -> None:
    """To the last bit: whatever the sensor, it knows best when it looked."""
    between_s = np.full(1_200, SCAN_S) if evenly else rng.uniform(0.008, 0.025, 1_200)
    made_s = np.cumsum(between_s)
    assert not off_s(made_s, made_s).any()


def test_a_sensor_that_changes_its_rate_is_followed(rng: np.random.Generator) -> None:
    between_s = np.repeat([SCAN_S, 0.5 * SCAN_S, SCAN_S], 600)
    made_s = np.cumsum(between_s)
    stamp_s = made_s + rng.normal(0.0, 1e-3, made_s.size)
    off = off_s(made_s, stamp_s)
    for part in np.split(off, 3):
        assert rms_s(part) < 0.6e-3


def test_no_stamps_end_it(rng: np.random.Generator) -> None:
    """Bursts, silences, steps of a clock, and places beyond any screen."""
    instants = ReportInstants()
    for stamp_s in np.cumsum(10.0 ** np.arange(-300.0, -30.0, 2.0)).tolist():
        assert np.isfinite(instants.instant_s(stamp_s, (20.0, 20.0)))
    stamp_s = 1.0
    for between_s in 10.0 ** rng.uniform(-300.0, 6.0, 3_000):
        stamp_s += float(between_s)
        place = rng.normal(0.0, 1e4, 2)
        assert np.isfinite(instants.instant_s(stamp_s, (float(place[0]), float(place[1]))))
        if between_s > 1.0:
            instants.lift()

"""The touch sensor: 60 Hz, 0.1 mm, and late."""

import numpy as np
import pytest

from frictus_hardware.base import TouchReport
from frictus_hardware.simulated.motion import FingerMotion
from frictus_hardware.simulated.sensors import TouchConfig, TouchSensor

RATE = 20_000.0


def sliding(first: int, n_samples: int) -> FingerMotion:
    """60 mm/s along x, from 1 mm."""
    time_s = np.arange(first, first + n_samples) / RATE
    position = np.column_stack([1.0 + 60.0 * time_s, np.full(n_samples, 17.03)])
    velocity = np.tile([60.0, 0.0], (n_samples, 1))
    return FingerMotion(
        position, velocity, np.full(n_samples, 0.4), np.ones(n_samples, dtype=np.bool_)
    )


def reports(config: TouchConfig, blocks: list[int]) -> list[tuple[int, int, TouchReport]]:
    """Every report, with the block that it arrived in."""
    sensor = TouchSensor(config, RATE)
    out = []
    first = 0
    for n_samples in blocks:
        for report in sensor.step(first, sliding(first, n_samples)):
            out.append((first, n_samples, report))
        first += n_samples
    return out


def test_a_report_arrives_one_latency_after_its_measurement() -> None:
    got = reports(TouchConfig(latency_s=0.030), [100] * 200)
    assert len(got) == pytest.approx(60 * (1.0 - 0.030), abs=1)
    for first, n_samples, report in got:
        arrival = report.measured_sample + 600.0
        assert first <= arrival < first + n_samples
        assert report.x_mm == pytest.approx(
            1.0 + 60.0 * report.measured_sample / RATE, abs=0.05 + 1e-9
        )
        assert report.y_mm == pytest.approx(17.0)
    measured = [report.measured_sample for _, _, report in got]
    np.testing.assert_allclose(np.diff(measured), RATE / 60.0, atol=1.0)


def test_a_wrong_declaration_shifts_the_measured_sample() -> None:
    true = reports(TouchConfig(latency_s=0.030), [100] * 100)
    wrong = reports(TouchConfig(latency_s=0.030, declared_latency_s=0.020), [100] * 100)
    for (first, _, honest), (same, _, mistaken) in zip(true, wrong, strict=True):
        assert first == same
        assert mistaken.measured_sample == pytest.approx(honest.measured_sample + 200.0)
        assert mistaken.x_mm == honest.x_mm


def test_does_not_depend_on_how_time_is_split(rng: np.random.Generator) -> None:
    sizes = [*rng.integers(1, 900, 30).tolist()]
    whole = reports(TouchConfig(), [sum(sizes)])
    split = reports(TouchConfig(), sizes)
    assert [report for _, _, report in whole] == [report for _, _, report in split]


@pytest.mark.parametrize("resolution_mm", [0.0, 0.1, 0.5])
def test_positions_come_in_steps(resolution_mm: float) -> None:
    got = reports(TouchConfig(resolution_mm=resolution_mm, rate_hz=100.0), [20_000])
    x = np.array([report.x_mm for _, _, report in got])
    if resolution_mm:
        np.testing.assert_allclose(x / resolution_mm, np.rint(x / resolution_mm), atol=1e-9)
    else:
        np.testing.assert_allclose(np.diff(x), 0.6, atol=1e-9)


def test_reports_say_when_the_finger_is_off() -> None:
    sensor = TouchSensor(TouchConfig(latency_s=0.0), RATE)
    motion = sliding(0, 1_000)
    motion.in_contact[500:] = False
    assert [report.in_contact for report in sensor.step(0, motion)] == [True, True, False]


def test_a_latency_that_differs_is_in_the_times_of_the_reports() -> None:
    config = TouchConfig(latency_sd_s=0.002)
    got = reports(config, [100] * 4_000)
    off = np.array([report.measured_sample for _, _, report in got])
    off -= np.ceil(np.arange(off.size) * RATE / config.rate_hz)
    assert off.std() == pytest.approx(0.002 * RATE, rel=0.1)
    assert abs(off.mean()) < 0.2 * off.std()
    for first, n_samples, report in got:
        arrival = report.measured_sample + 600.0
        assert arrival < first + n_samples
    assert [report for _, _, report in got] == [
        report for _, _, report in reports(config, [250] * 1_600)
    ]

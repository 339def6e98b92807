"""What a calibration hears is what was sensed, and it says what is not as configured."""

import re
from dataclasses import replace

import numpy as np
import pytest

from frictus.block import Block, Flag
from frictus.messages import TouchState
from frictus_hardware import SimulatedConfig
from frictus_hardware.simulated.rig import SimulatedRig
from frictus_hardware.simulated.sensors import NailConfig, TouchConfig
from frictus_hardware.simulated.strokes import SteadyStrokes
from frictus_service.calibration.checks import KEPT_S, StrokesCapture, alignment_of

RATE_HZ = 20_000.0
N = 400


def block(first: int, data: np.ndarray) -> Block:
    values = np.ascontiguousarray(data.T, dtype=np.float32)
    return Block(1, 1, first // N, first, 0, 1, RATE_HZ, Flag(0), values)


def touch(sample: float, x_mm: float, y_mm: float, in_contact: bool = True) -> TouchState:
    return TouchState(
        run=1, source="simulated", sample=sample, x_mm=x_mm, y_mm=y_mm, in_contact=in_contact
    )


def heard(config: SimulatedConfig, seconds: float) -> StrokesCapture:
    capture = StrokesCapture()
    with SimulatedRig(config) as rig:
        for _ in range(round(seconds * RATE_HZ / N)):
            got = rig.exchange(np.zeros(N))
            capture.add_block("force", block(got.first_sample, got.force_n))
            capture.add_block("accel", block(got.first_sample, got.accel_m_s2))
            capture.add_block("voltage", block(got.first_sample, got.voltage_v[:, np.newaxis]))
            for each in got.touches:
                capture.add_touch(touch(each.measured_sample, each.x_mm, each.y_mm))
    return capture


@pytest.mark.parametrize(
    ("nail", "declared_s", "said"),
    [
        (NailConfig(), 0.030, ()),
        (NailConfig(mounted_deg=(0.0, 0.0, 90.0)), 0.030, ("90 .*° off what is configured",)),
        (NailConfig(), 0.012, (r"1[6-9]\.\d ± .* ms older .* a latency of (28|29|30|31)\.",)),
    ],
)
def test_a_calibration_says_what_is_not_as_configured(
    nail: NailConfig, declared_s: float, said: tuple[str, ...], seed: int
) -> None:
    config = SimulatedConfig(
        clock="virtual",
        finger=SteadyStrokes(speed_mm_s=90.0),
        nail=nail,
        touch=TouchConfig(latency_s=0.030, declared_latency_s=declared_s),
        seed=seed,
    )
    details, notes = alignment_of(list(heard(config, 12.0).strokes()), declared_s)
    assert details is not None
    assert details["along"] == (True, False)
    assert len(notes) == len(said)
    for note, pattern in zip(notes, said, strict=True):
        assert re.search(pattern, note), note


def test_what_cannot_be_told_is_a_note() -> None:
    details, notes = alignment_of([], 0.03)
    assert details is None
    assert len(notes) == 1
    assert "unknown" in notes[0]


def test_a_pause_parts_the_strokes_and_a_lost_block_is_missing(
    rng: np.random.Generator,
) -> None:
    capture = StrokesCapture()
    data = rng.standard_normal((40 * N, 3))
    pause = round(0.6 * RATE_HZ)
    for index in range(40):
        first = index * N + (pause if index >= 20 else 0)
        if index != 5:
            capture.add_block("force", block(first, data[index * N : (index + 1) * N]))
        capture.add_block("accel", block(first, -data[index * N : (index + 1) * N]))
    capture.add_touch(touch(150.5, 1.0, 2.0))
    capture.add_touch(touch(160.5, 0.0, 0.0, in_contact=False))
    capture.add_touch(touch(20 * N + pause + 10.0, 3.0, 4.0))
    before, after = capture.strokes()
    np.testing.assert_array_equal(np.isnan(before.force_n[:, 0]), np.arange(20 * N) // N == 5)
    np.testing.assert_allclose(before.accel_m_s2, -data[: 20 * N], rtol=1e-6)
    np.testing.assert_allclose(after.force_n, data[20 * N :], rtol=1e-6)
    np.testing.assert_allclose(before.touch_s, [150.5 / RATE_HZ])
    np.testing.assert_allclose(before.touch_mm, [[1.0, 2.0]])
    np.testing.assert_allclose(after.touch_s, [10.0 / RATE_HZ])


def test_a_rig_that_begins_anew_is_heard_anew() -> None:
    capture = StrokesCapture()
    capture.add_block("force", block(0, np.ones((N, 3))))
    capture.add_touch(touch(10.0, 1.0, 2.0))
    capture.add_block("force", replace(block(0, np.zeros((N, 3))), run=2))
    capture.add_touch(touch(20.0, 1.0, 2.0))  # of the run before
    (heard_anew,) = capture.strokes()
    np.testing.assert_array_equal(heard_anew.force_n, 0.0)
    assert heard_anew.touch_s.size == 0


def test_only_the_newest_is_kept() -> None:
    capture = StrokesCapture()
    zeros = np.zeros((20_000, 3))
    for second in range(round(KEPT_S) + 5):
        for stream in ("force", "accel"):
            capture.add_block(stream, block(second * 20_000, zeros))
        capture.add_touch(touch(second * RATE_HZ, 0.0, 0.0))
    (kept,) = capture.strokes()
    assert kept.force_n.shape[0] == pytest.approx(KEPT_S * RATE_HZ, abs=RATE_HZ)
    assert kept.touch_s[0] >= 0.0
    assert kept.touch_s.size <= KEPT_S + 1

"""A recording played as a rig: every sample as it was, and what is missing told."""

from pathlib import Path

import numpy as np
import pytest
from tests.hardware.replay.tapes import (
    LATENCY_S,
    RATE_HZ,
    STEP_N,
    accel_of,
    force_counts,
    sine_tape,
    volts_of,
)

from frictus_hardware import Exchange, ReplayConfig, TouchReport
from frictus_hardware.errors import (
    ConfigError,
    DeviceLostError,
    HardwareError,
    StreamLostError,
)
from frictus_hardware.replay.rig import ReplayRig
from frictus_hardware.replay.tape import Tape
from frictus_hardware.simulated.clock import RealClock, VirtualClock

GAPPED = ((1_000, 3_000), (3_050, 6_000), (8_000, 8_070), (9_000, 12_000))


def config(**changes: object) -> ReplayConfig:
    return ReplayConfig.model_validate(
        {"file": Path("sines.npz"), "clock": "virtual"} | changes
    )


def rig_of(tape: Tape, **changes: object) -> ReplayRig:
    rig = ReplayRig(config(**changes), tape)
    rig.open()
    return rig


def played(rig: ReplayRig, sizes: list[int]) -> list[Exchange]:
    """Exchange blocks of these sizes, or as many of them as there are."""
    got = []
    try:
        for n_samples in sizes:
            got.append(rig.exchange(np.zeros(n_samples)))
    except DeviceLostError:
        pass
    return got


def assert_as_recorded(block: Exchange, shift: int = 0) -> None:
    index = block.first_sample - shift + np.arange(block.voltage_v.size)
    np.testing.assert_array_equal(block.force_n, force_counts(index) * STEP_N)
    np.testing.assert_array_equal(block.accel_m_s2, accel_of(index))


@pytest.mark.parametrize("first", [0, 123_457])
def test_every_sample_is_as_recorded_in_blocks_of_any_size(
    rng: np.random.Generator, first: int
) -> None:
    rig = rig_of(sine_tape([(first, first + 20_000)]))
    blocks = played(rig, rng.integers(1, 400, 60).tolist())
    assert blocks[0].first_sample == first, "samples count as they did when it was recorded"
    for block in blocks:
        assert_as_recorded(block)
        assert block.overrun_samples == block.underrun_samples == 0
        assert block.truth is None


def test_touch_reports_come_in_the_block_in_which_they_came(rng: np.random.Generator) -> None:
    tape = sine_tape([(500, 20_500)])
    rig = rig_of(tape)
    blocks = played(rig, rng.integers(1, 400, 60).tolist())
    reports: list[TouchReport] = []
    for block in blocks:
        for report in block.touches:
            arrival = report.measured_sample + LATENCY_S * RATE_HZ
            assert block.first_sample <= arrival < block.first_sample + block.voltage_v.size
        reports += block.touches
    end = blocks[-1].first_sample + blocks[-1].voltage_v.size
    due = tape.touch_arrival_sample < end
    measured = [report.measured_sample for report in reports]
    np.testing.assert_array_equal(measured, tape.touch_measured_sample[due])
    contact = [report.in_contact for report in reports]
    np.testing.assert_array_equal(contact, tape.touch_in_contact[due])


@pytest.mark.parametrize("n_samples", [10, 100, 130])
def test_what_is_missing_is_an_overrun(n_samples: int) -> None:
    tape = sine_tape(GAPPED)
    blocks = played(rig_of(tape), [n_samples] * 2_000)
    end, touches = tape.first_sample, 0
    for block in blocks:
        assert_as_recorded(block)
        assert block.first_sample == end + block.overrun_samples
        assert block.underrun_samples == block.overrun_samples, "as long nothing was played"
        assert block.margin_samples == tape.lead_samples, "a gap takes no time"
        end = block.first_sample + n_samples
        touches += len(block.touches)
    assert touches == np.count_nonzero(tape.touch_arrival_sample < end), "none is lost in a gap"
    lost = sum(block.overrun_samples for block in blocks)
    gaps = 50 + 2_000 + 930
    unfilled = sum((last - first) % n_samples for first, last in GAPPED[:-1])
    assert lost == gaps + unfilled


def test_time_is_that_of_what_is_played() -> None:
    now_s = 0.0

    def sleep(seconds: float) -> None:
        nonlocal now_s
        now_s += seconds

    clock = RealClock(RATE_HZ, 4.0, now=lambda: now_s, sleep=sleep)
    rig = ReplayRig(config(), sine_tape(GAPPED), clock)
    with rig:
        blocks = played(rig, [100] * 60)
        assert now_s == pytest.approx(len(blocks) * 100 / RATE_HZ / 4.0)


def test_end_is_a_lost_device_for_good() -> None:
    rig = rig_of(sine_tape([(0, 1_050)]))
    rig.arm()
    for _ in range(10):
        rig.exchange(np.full(100, 20.0))
    for _ in range(2):
        with pytest.raises(DeviceLostError, match=r"'sines' is over, after 0\.05 s.*at_end"):
            rig.exchange(np.zeros(100))
    assert "is over" in (rig.health() or "")
    rig.close()
    with pytest.raises(DeviceLostError, match="is over"):
        rig.open()
    assert rig.health() == "not open"


def test_loop_plays_again_one_sample_later() -> None:
    tape = sine_tape([(700, 1_200), (1_300, 1_700)])
    lap = 1_700 - 700 + 1
    rig = rig_of(tape, at_end="loop")
    blocks = played(rig, [100] * 27)
    assert len(blocks) == 27
    for number, block in enumerate(blocks):
        assert_as_recorded(block, number // 9 * lap)
        seam, gap = number % 9 == 0 and number > 0, number % 9 == 5
        assert block.overrun_samples == (1 if seam else 100 if gap else 0)
    measured = np.array([touch.measured_sample for block in blocks for touch in block.touches])
    laps = tape.touch_measured_sample + lap * np.arange(3)[:, np.newaxis]
    np.testing.assert_array_equal(measured, laps.ravel())
    then = rig.voltage_then(700 + lap, lap)
    np.testing.assert_array_equal(then[:500], volts_of(np.arange(700, 1_200)))
    assert np.all(np.isnan(then[500:600]))
    assert np.isnan(then[-1]), "the seam"


def test_volts_of_then_are_missing_where_the_recording_is() -> None:
    tape = sine_tape(GAPPED)
    then = rig_of(tape).voltage_then(0, 13_000)
    index = np.arange(13_000)
    known = np.logical_or.reduce([(index >= a) & (index < b) for a, b in GAPPED])
    np.testing.assert_array_equal(then[known], volts_of(index[known]))
    assert np.all(np.isnan(then[~known]))


def test_drive_of_now_is_monitored_and_changes_nothing(rng: np.random.Generator) -> None:
    tape = sine_tape()
    driven, still = rig_of(tape), rig_of(tape)
    driven.arm()
    drive = rng.uniform(-50.0, 50.0, 2_000)
    blocks = [driven.exchange(part) for part in np.split(drive, 20)]
    silent = [still.exchange(np.zeros(100)) for _ in range(20)]
    for one, other in zip(blocks, silent, strict=True):
        np.testing.assert_array_equal(one.force_n, other.force_n)
        assert one.touches == other.touches
    heard = np.concatenate([block.voltage_v for block in blocks])
    np.testing.assert_array_equal(heard[tape.lead_samples :], drive[: -tape.lead_samples])


def test_says_what_it_is() -> None:
    info = rig_of(sine_tape()).info
    assert (info.backend, info.simulated, info.finger_source) == ("replay", True, "simulated")
    assert info.converter_steps == {"force": STEP_N}, "the acceleration holds no counts"
    assert info.screen_peak_v == 60.0
    pointer = sine_tape(finger_source="pointer")
    assert rig_of(pointer).info.finger_source == "pointer", "a substitute stays one"


def test_another_rate_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"backend\.sample_rate_hz = 10000.*20000 Hz"):
        ReplayRig(config(sample_rate_hz=10_000.0), sine_tape())


def test_blocks_that_fit_between_no_gaps_are_refused() -> None:
    rig = rig_of(sine_tape([(0, 300), (400, 550)]), at_end="loop")
    with pytest.raises(ConfigError, match=r"1 to 300 samples accepted.*between two gaps"):
        rig.exchange(np.zeros(301))
    assert len(played(rig, [300] * 5)) == 5


def test_far_behind_the_stream_is_lost_until_opened_again() -> None:
    clock = VirtualClock()
    rig = ReplayRig(config(), sine_tape(), clock)
    with rig:
        rig.exchange(np.zeros(100))
        clock.wait_until(250_000)
        with pytest.raises(StreamLostError, match="behind"):
            rig.exchange(np.zeros(100))
        with pytest.raises(HardwareError):
            rig.arm()
    with rig:
        assert rig.exchange(np.zeros(100)).first_sample == 0

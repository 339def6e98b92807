"""Each fault of the plan surfaces as its type or as counted data, at its sample."""

import numpy as np
import pytest

from frictus_hardware import SimulatedConfig
from frictus_hardware.base import Exchange
from frictus_hardware.errors import HardwareError, StreamLostError
from frictus_hardware.simulated.clock import VirtualClock
from frictus_hardware.simulated.faults import (
    ERRORS,
    LASTING,
    EmptyOutput,
    Fault,
    LateBlock,
    LostSamples,
    MonitorMismatch,
    Raised,
    SensorFault,
    SilentTouch,
    StuckTouch,
)
from frictus_hardware.simulated.rig import SimulatedRig

N = 100
LEAD = 400
RAMP = 400
"""After a gap."""


def rig_with(*faults: Fault) -> SimulatedRig:
    return SimulatedRig(SimulatedConfig(clock="virtual", faults=faults))


def run(rig: SimulatedRig, n_blocks: int, drive_v: float = 30.0) -> list[Exchange]:
    rig.arm()
    return [rig.exchange(np.full(N, drive_v)) for _ in range(n_blocks)]


@pytest.mark.parametrize("name", list(ERRORS))
def test_raised_once_at_its_sample_with_nothing_output(name: str) -> None:
    planned = Raised.model_validate({"at_sample": 450, "error": name})
    with rig_with(planned) as rig:
        run(rig, 4)
        play = rig.next_play_sample
        with pytest.raises(ERRORS[name], match="450") as caught:
            rig.exchange(np.full(N, 60.0))
        assert isinstance(caught.value, HardwareError)
        assert rig.next_play_sample == play
        if issubclass(ERRORS[name], LASTING):
            assert rig.health() is not None
            with pytest.raises(ERRORS[name]):
                rig.exchange(np.zeros(N))
            rig.stop(0.01)  # safe nevertheless
        else:
            assert rig.health() is None
            again = run(rig, 6)
            heard = np.concatenate([got.voltage_v for got in again])
            assert np.all(heard == 30.0)  # and never 60


def test_a_lost_stream_is_started_anew() -> None:
    with rig_with(Raised(at_sample=0, error="stream_lost")) as rig:
        with pytest.raises(StreamLostError):
            rig.exchange(np.zeros(N))
        rig.close()
        rig.open()
        assert rig.exchange(np.zeros(N)).first_sample == 0


def test_lost_samples_are_counted_and_time_goes_on() -> None:
    with rig_with(LostSamples(at_sample=650, samples=70)) as rig:
        got = run(rig, 20)
    assert [one.overrun_samples for one in got[:8]] == [0] * 6 + [70, 0]
    assert got[6].underrun_samples == 70
    assert got[6].first_sample == 670
    assert got[7].first_sample == 770
    assert got[6].play_sample == 670 + LEAD
    start = got[6].play_sample - 70 - got[10].first_sample
    hole = np.concatenate([one.voltage_v for one in got[10:12]])[start : start + 70]
    assert not np.any(hole)
    touches = [report.measured_sample for one in got for report in one.touches]
    np.testing.assert_allclose(np.diff(touches), 20_000.0 / 60.0, atol=1.0)


def test_empty_output_plays_zero_and_keeps_the_time() -> None:
    with rig_with(EmptyOutput(at_sample=150, samples=30)) as rig:
        got = run(rig, 12)
    assert [one.underrun_samples for one in got[:3]] == [0, 30, 0]
    heard = np.concatenate([one.voltage_v for one in got])
    hole = got[1].play_sample
    assert not np.any(heard[hole : hole + 30])
    back = hole + 30 + RAMP
    np.testing.assert_allclose(heard[hole + 30 : back], 30.0 * np.arange(1, RAMP + 1) / RAMP)
    assert np.all(heard[back:] == 30.0)


@pytest.mark.parametrize(("late", "missed"), [(300, 0), (430, 30), (900, N)])
def test_a_late_block_eats_the_margin_then_the_block(late: int, missed: int) -> None:
    with rig_with(LateBlock(at_sample=150, samples=late)) as rig:
        got = run(rig, 8)
    assert got[0].margin_samples == LEAD
    assert got[1].margin_samples == max(LEAD - late, 0)
    assert got[1].underrun_samples == missed
    assert got[2].margin_samples == LEAD
    heard = np.concatenate([one.voltage_v for one in got])[500:600]
    assert np.count_nonzero(heard == 0.0) == missed


def test_a_stuck_touch_sensor_repeats_itself() -> None:
    with rig_with(StuckTouch(at_sample=4_000, samples=8_000)) as rig:
        got = run(rig, 200)
    stuck = {r.x_mm for one in got[40:120] for r in one.touches}
    free = {r.x_mm for one in got[120:] for r in one.touches}
    assert len(stuck) == 1
    assert len(free) > 5


def test_a_silent_touch_sensor_says_nothing() -> None:
    with rig_with(SilentTouch(at_sample=4_000, samples=8_000)) as rig:
        got = run(rig, 200)
    assert not any(one.touches for one in got[40:120])
    assert any(one.touches for one in got[:40])
    assert any(one.touches for one in got[120:])


def test_the_monitor_may_contradict_the_drive() -> None:
    with rig_with(MonitorMismatch(at_sample=650, samples=100, factor=1.5)) as rig:
        heard = np.concatenate([one.voltage_v for one in run(rig, 10)])
    assert np.all(heard[LEAD:650] == 30.0)
    assert np.all(heard[650:750] == 45.0)
    assert np.all(heard[750:] == 30.0)


def test_faults_can_be_added_while_it_runs() -> None:
    with rig_with() as rig:
        run(rig, 2)
        rig.faults.add(Raised(at_sample=250, error="transient"))
        with pytest.raises(ERRORS["transient"]):
            run(rig, 1)
        run(rig, 1)


def test_faults_come_from_a_configuration_file() -> None:
    read = SimulatedConfig.model_validate(
        {"clock": "virtual", "faults": [{"kind": "underrun", "at_sample": 5, "samples": 2}]}
    )
    assert read.faults == (EmptyOutput(at_sample=5, samples=2),)


class ManualClock(VirtualClock):
    """Goes on by itself when the test says so."""

    def advance(self, samples: int) -> None:
        self.wait_until(self.sample() + samples)


def test_a_stalled_loop_underruns_and_catches_up() -> None:
    clock = ManualClock()
    with SimulatedRig(SimulatedConfig(clock="virtual"), clock=clock) as rig:
        rig.arm()
        got = [rig.exchange(np.full(N, 30.0)) for _ in range(10)]
        clock.advance(650)  # 250 more than the lead
        got += [rig.exchange(np.full(N, 30.0)) for _ in range(20)]
    assert [one.underrun_samples for one in got[10:14]] == [100, 100, 50, 0]
    assert [one.first_sample for one in got] == list(range(0, 3_000, N))
    heard = np.concatenate([one.voltage_v for one in got])
    expected = np.full(3_000, 30.0)
    expected[:LEAD] = 0.0
    expected[1_400:1_650] = 0.0
    expected[1_650 : 1_650 + RAMP] *= np.arange(1, RAMP + 1) / RAMP
    np.testing.assert_array_equal(heard, expected)


def test_a_loop_that_is_far_behind_has_lost_the_stream() -> None:
    clock = ManualClock()
    with SimulatedRig(SimulatedConfig(clock="virtual"), clock=clock) as rig:
        clock.advance(250_000)
        with pytest.raises(StreamLostError, match="behind"):
            rig.exchange(np.zeros(N))


@pytest.mark.parametrize("sensor", ["force", "accel"])
@pytest.mark.parametrize("becomes", ["dead", "stuck", "saturated", "loose"])
def test_a_sensor_fails_for_its_samples_alone(sensor: str, becomes: str) -> None:
    fault = SensorFault.model_validate(
        {"at_sample": 250, "samples": 300, "sensor": sensor, "becomes": becomes}
    )
    with rig_with() as sound, rig_with(fault) as faulty:
        right, wrong = (run(rig, 8) for rig in (sound, faulty))
    field = {"force": "force_n", "accel": "accel_m_s2"}
    for name in field.values():
        expected, found = (
            np.concatenate([getattr(got, name) for got in blocks]) for blocks in (right, wrong)
        )
        np.testing.assert_array_equal(found[:250], expected[:250])
        np.testing.assert_array_equal(found[550:], expected[550:])
        during = found[250:550]
        if name != field[sensor]:
            np.testing.assert_array_equal(during, expected[250:550])
        elif becomes == "dead":
            assert not np.any(during)
        elif becomes == "stuck":
            assert np.all(during == expected[250])
        elif becomes == "saturated":
            assert np.ptp(np.abs(during)) == 0.0
            assert np.abs(during[0, 0]) > np.abs(expected).max()
        else:
            assert np.all(np.isfinite(during))
            assert not np.array_equal(during, expected[250:550])
    counted = [got.saturated_samples for got in wrong]
    ends = becomes == "saturated" and sensor == "accel"
    assert counted == ([0, 0, N, N, N, N, 0, 0] if ends else [0] * 8)

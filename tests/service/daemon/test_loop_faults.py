"""What the loop does about faults of device, sensors, monitor and clock."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from frictus.messages import FaultKind
from frictus.textures import Scene
from frictus_hardware.arrays import FloatArray
from frictus_hardware.base import Exchange
from frictus_hardware.errors import LinkLostError, StreamLostError, TransientError
from frictus_hardware.simulated.faults import (
    FOR_GOOD,
    EmptyOutput,
    LostSamples,
    MonitorMismatch,
    Raised,
    SilentTouch,
)
from frictus_service.config import Limits
from frictus_service.daemon.block_loop.lead import RetryingBackend
from frictus_service.daemon.safety import FaultRaised, Reset, Stop

from .driven import SETTLED_S, driven


@pytest.mark.parametrize(
    ("pressing_n", "once_n", "trips"),
    [
        (0.4, 0.4, False),
        (9.9, 9.9, False),  # together far beyond the limit, and none of them
        (0.0, 10.1, True),
        (9.9, -10.1, True),
        (0.0, np.nan, True),
        (0.0, np.inf, True),
    ],
)
def test_a_single_force_beyond_the_limit_trips(
    make_bench: Any, pressing_n: float, once_n: float, trips: bool
) -> None:
    bench = make_bench(Limits(force_limit_n=10.0))
    (turn,) = bench.turn(0.005)
    force_n = np.zeros((100, 3))
    force_n[:, 2] = pressing_n
    force_n[70, 2] = once_n
    exchange = replace(turn.exchange, force_n=force_n)
    bench.loop._checks.check(exchange, bench.loop._zero_from)
    assert bench.interlock.state.state == ("tripped" if trips else "disarmed")


def test_momentary_faults_are_counted_not_fatal(make_bench: Any, texture: Scene) -> None:
    bench = driven(make_bench(), texture)
    at = bench.clock.sample() + 1_000
    bench.rig.faults.add(LostSamples(at_sample=at, samples=150))
    bench.rig.faults.add(EmptyOutput(at_sample=at + 4_000, samples=40))
    bench.turn(SETTLED_S)
    assert bench.loop.tally.overruns == 1
    assert bench.loop.tally.underruns == 2, "what was lost played zero too"
    assert bench.interlock.state.state == "armed", bench.interlock.state.fault


def test_underruns_that_keep_coming_do_not_blind_the_monitor(
    make_bench: Any, texture: Scene
) -> None:
    bench = driven(make_bench(), texture)
    at = bench.clock.sample()
    for block in range(0, 60, 4):
        bench.rig.faults.add(EmptyOutput(at_sample=at + 100 * block, samples=10))
    bench.turn(0.15)
    assert bench.interlock.trips == 0
    bench.rig.faults.add(MonitorMismatch(at_sample=at + 3_000, factor=0.0))
    bench.turn(0.1)
    assert bench.interlock.state.state == "tripped"


@pytest.mark.parametrize("stopped", [False, True])
def test_a_monitor_that_reads_no_number_trips_whatever_is_played(
    make_bench: Any, texture: Scene, stopped: bool
) -> None:
    bench = driven(make_bench(), texture)
    if stopped:
        bench.feed(Stop("ben"))
    at = bench.clock.sample()
    bench.rig.faults.add(
        MonitorMismatch.model_construct(at_sample=at, samples=FOR_GOOD, factor=np.nan)
    )
    bench.turn(0.01)
    assert bench.interlock.state.state == "tripped"


def test_transient_errors_are_tried_again(make_bench: Any, texture: Scene) -> None:
    bench = driven(make_bench(), texture)
    for _ in range(3):
        bench.rig.faults.add(Raised(at_sample=bench.clock.sample() + 500, error="transient"))
    turns = bench.turn(SETTLED_S)
    firsts = [turn.exchange.first_sample for turn in turns]
    assert set(np.diff(firsts)) == {100}
    assert bench.interlock.state.state == "armed"


def test_errors_beyond_the_lead_lose_the_stream(make_bench: Any) -> None:
    class Failing:
        def __init__(self, inner: Any) -> None:
            self.info, self.next_play_sample = inner.info, inner.next_play_sample

        def exchange(self, drive_v: FloatArray) -> Exchange:
            raise TransientError("no answer")

    times = iter(range(0, 10**9, 1_000_000))
    patient = RetryingBackend(Failing(make_bench().rig), lambda: next(times))  # type: ignore[arg-type]
    with pytest.raises(StreamLostError, match="20 ms"):
        patient.exchange(np.zeros(100))
    assert patient.retries == 21


@pytest.mark.parametrize("error", ["stream_lost", "device_lost"])
def test_lost_device_trips_and_comes_back_disarmed(
    make_bench: Any, texture: Scene, error: Any
) -> None:
    bench = driven(make_bench(), texture)
    bench.rig.faults.add(Raised(at_sample=bench.clock.sample() + 500, error=error))
    bench.turn(SETTLED_S)
    safety = bench.interlock.state
    assert (safety.state, safety.fault[0], safety.device_ready) == ("tripped", error, True)
    assert {turn.run for turn in bench.turns} == {7, 8}
    assert not bench.voltage_v().any()
    bench.feed(Reset())
    bench.arm()
    turns = bench.turn(SETTLED_S)
    assert any(turn.exchange.voltage_v.any() for turn in turns), "the scene stands again"


def test_lost_link_ends_the_lease_without_latching(make_bench: Any, texture: Scene) -> None:
    bench = driven(make_bench(), texture)
    bench.rig.faults.add(Raised(at_sample=bench.clock.sample() + 500, error="link_lost"))
    bench.turn(SETTLED_S)
    safety = bench.interlock.state
    assert (safety.state, safety.lasting, safety.owner) == ("disarmed", (), None)
    bench.arm()


def test_sensor_fault_suspends_while_it_lasts(make_bench: Any, texture: Scene) -> None:
    bench = driven(make_bench(), texture)
    bench.rig.faults.add(Raised(at_sample=bench.clock.sample() + 500, error="sensor"))
    bench.turn(0.1)
    assert bench.interlock.state.lasting[0][0] == "sensor"
    turns = bench.turn(1.0)
    silent = [not turn.exchange.voltage_v.any() for turn in turns]
    assert any(silent)
    assert not silent[-1], "rendering resumed by itself"
    assert bench.interlock.state.state == "armed"


def test_silent_touch_sensor_ends_the_output_and_is_counted(
    make_bench: Any, texture: Scene
) -> None:
    bench = driven(make_bench(), texture)
    silent_s = bench.now_s
    bench.rig.faults.add(SilentTouch(at_sample=bench.clock.sample()))
    bench.turn(SETTLED_S)
    stale_s, lead_s, ramp_s, report_s = 0.1, 0.02, 0.02, 1.0 / 60.0
    assert bench.last_output_s() < silent_s + stale_s + lead_s + ramp_s + report_s + 0.02
    assert bench.loop.tally.stale_touches == 1
    assert bench.turns[-1].stale
    assert bench.interlock.state.state == "armed", "the client is there; the finger may return"


def test_monitor_that_contradicts_the_drive_trips(make_bench: Any, texture: Scene) -> None:
    bench = driven(make_bench(), texture)
    at = bench.clock.sample() + 500
    bench.rig.faults.add(MonitorMismatch(at_sample=at, factor=0.0))
    bench.turn(0.3)
    safety = bench.interlock.state
    assert (safety.state, safety.fault[0]) == ("tripped", "safety")
    assert "V rms" in safety.fault[1]


def test_monitor_is_silent_over_stops_and_underruns(make_bench: Any, texture: Scene) -> None:
    bench = make_bench()
    for _ in range(4):
        driven(bench, texture)
        at = bench.clock.sample() + 200
        bench.rig.faults.add(EmptyOutput(at_sample=at, samples=70))
        bench.turn(0.1)
        bench.feed(Stop("ben"))
        bench.turn(0.1)
    assert bench.interlock.trips == 0


def test_trip_silences_at_once(make_bench: Any, texture: Scene) -> None:
    bench = driven(make_bench(), texture)
    told_s = bench.now_s
    bench.feed(FaultRaised("safety", "force limit"))
    bench.turn(0.2)
    assert bench.last_output_s() <= told_s + 0.03
    assert bench.interlock.state.state == "tripped"


def test_late_blocks_in_a_row_trip(make_bench: Any, texture: Scene) -> None:
    bench = driven(make_bench(limits=Limits(missed_deadlines=5)), texture)
    bench.delay_ns += 8_000_000
    bench.turn(0.01)
    assert bench.interlock.state.state == "armed", "late for a moment is only counted"
    for _ in range(12):
        bench.delay_ns += 6_000_000
        bench.turn(0.005)
    kind, reason = bench.interlock.state.fault
    assert (bench.interlock.state.state, kind) == ("tripped", "deadline")
    assert "in a row" in reason
    assert bench.loop.tally.deadline_misses >= 5
    assert bench.loop.lateness.max_ms > 5.0


def test_a_clock_that_stood_still_can_be_armed_again(make_bench: Any, texture: Scene) -> None:
    bench = driven(make_bench(limits=Limits(missed_deadlines=5)), texture)
    bench.delay_ns += 20_000_000  # the device counted no samples meanwhile, and lost none
    bench.turn(0.1)
    kind, _ = bench.interlock.state.fault
    assert (bench.interlock.state.state, kind) == ("tripped", "deadline")
    bench.feed(Reset())
    bench.arm()
    turns = bench.turn(SETTLED_S)
    assert bench.interlock.state.state == "armed"
    assert any(turn.exchange.voltage_v.any() for turn in turns)


def broken(*_arguments: object, **_named: object) -> None:
    raise ZeroDivisionError("a bug")


def test_bug_trips_once_and_a_second_one_ends_the_loop(
    make_bench: Any, texture: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench = driven(make_bench(), texture)
    monkeypatch.setattr("frictus_service.synthesis.renderer.Renderer.render", broken)
    bench.loop.turn()
    safety = bench.interlock.state
    kind: FaultKind = safety.fault[0]
    assert (safety.state, kind) == ("tripped", "internal")
    with pytest.raises(ZeroDivisionError):
        bench.loop.turn()


def test_a_bug_while_the_device_cannot_be_stopped_is_waited_out(
    make_bench: Any, texture: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench = driven(make_bench(), texture)

    def gone(_ramp_s: float) -> None:
        raise LinkLostError("no answer")

    with monkeypatch.context() as patch:
        patch.setattr("frictus_service.synthesis.renderer.Renderer.render", broken)
        patch.setattr(bench.rig, "stop", gone)
        assert not bench.loop.turn()
    assert bench.interlock.state.state == "tripped"
    assert bench.loop.parked
    bench.turn(0.1)  # closed, which makes it safe, and opened anew
    bench.feed(Reset())
    driven(bench, texture)


def test_a_lead_of_any_length_is_compared_with_what_was_told(
    make_bench: Any, texture: Scene
) -> None:
    bench = make_bench(sample_rate_hz=200_000.0, lead_ms=400.0)
    driven(bench, texture)
    assert bench.interlock.state.state == "armed"

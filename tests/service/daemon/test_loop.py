"""The block loop on a virtual clock: what it plays, counts, and does about faults."""

import threading
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.lib.stride_tricks import sliding_window_view

from frictus.block import Flag
from frictus.errors import RefusedError
from frictus.keys import RENDER, TRUTH, VOLTAGE
from frictus.messages import Excitation, FaultKind, ModelRequest
from frictus.model import Effect, Model
from frictus.stream import StreamFrame
from frictus.textures import Component, Region, Scene, Spectrum
from frictus_hardware.arrays import FloatArray
from frictus_hardware.base import Exchange
from frictus_hardware.errors import StreamLostError, TransientError
from frictus_hardware.output import RETURN_S
from frictus_hardware.physics.friction import FrictionLaw
from frictus_hardware.physics.screen import Screen, drive_fraction_of, screen_voltage
from frictus_hardware.simulated.faults import (
    FOR_GOOD,
    EmptyOutput,
    LateBlock,
    LostSamples,
    MonitorMismatch,
    Raised,
    SilentTouch,
)
from frictus_service.config import Limits
from frictus_service.daemon.block_loop.block_record import blocks_of, flags_of
from frictus_service.daemon.block_loop.lead import RetryingBackend
from frictus_service.daemon.block_loop.loop import HANDOVER_BLOCKS
from frictus_service.daemon.block_loop.timebase import Stamp
from frictus_service.daemon.inboxes import ModelUpdate, SceneUpdate
from frictus_service.daemon.model_controller import ModelController, rendered_model
from frictus_service.daemon.safety import ClientVanished, Disarm, FaultRaised, Reset, Stop
from frictus_service.daemon.scene_controller import SceneController
from frictus_service.json_text import etag_of
from frictus_service.synthesis.compensability import placeholder_model
from frictus_service.synthesis.compensator import Inverter
from frictus_service.synthesis.renderer import RAMP_S, Rendered, Renderer
from frictus_service.synthesis.scene import StreamBudget, compile_excitation, compile_scene

SETTLED_S = 0.5
PERIOD = 20
"""Samples in which the carrier takes all its phases."""


def driven(bench: Any, texture: Scene, lease_s: float = 10.0) -> Any:
    """Return the bench armed, its finger followed, its output on."""
    bench.play(texture)
    bench.turn(0.2)
    bench.arm(lease_s)
    turns = bench.turn(SETTLED_S)
    assert any(turn.exchange.voltage_v.any() for turn in turns)
    return bench


def stronger() -> Model:
    model = placeholder_model()
    return model.model_copy(update={"base": model.base.model_copy(update={"gain_n": 0.5})})


def ordered(bench: Any, model: Model, texture: Scene) -> ModelUpdate:
    """Return an order of a model that the loop was left."""
    rendered = rendered_model(model, Screen())
    scene = compile_scene(texture, rendered.inverse, Screen(), bench.rate_hz)
    bench.orders.model.offer(order := ModelUpdate(rendered, scene))
    return order


def test_nothing_is_output_while_disarmed(make_bench: Any, texture: Scene) -> None:
    bench = make_bench()
    bench.play(texture)
    bench.turn(1.0)
    assert not bench.voltage_v().any()
    assert bench.heartbeat.value == 200
    assert not any(turn.armed for turn in bench.turns)


def test_samples_are_handed_over_without_a_gap(make_bench: Any) -> None:
    bench = make_bench()
    turns = bench.turn(0.3)
    assert [turn.number for turn in turns] == list(range(60))
    assert [turn.exchange.first_sample for turn in turns] == [100 * n for n in range(60)]


def test_a_block_is_handed_over_before_it_is_counted(
    make_bench: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench = make_bench()
    waiting: list[int] = []

    def note(*_block: object) -> int:
        waiting.append(bench.loop.handover.qsize())
        return 0

    monkeypatch.setattr(bench.loop.lateness, "note", note)
    bench.loop.turn()
    bench.loop.turn()
    assert waiting == [1, 2]


@pytest.mark.parametrize("event", [Stop("ben"), Disarm("ann"), ClientVanished("ann")])
def test_output_is_zero_soon_after_it_has_to_be(
    make_bench: Any, texture: Scene, event: Any
) -> None:
    bench = driven(make_bench(), texture)
    told_s = bench.now_s
    bench.feed(event)
    bench.turn(0.2)
    assert told_s < bench.last_output_s() <= told_s + 0.1
    assert bench.interlock.state.state == "disarmed"


def test_output_is_zero_soon_after_the_lease(make_bench: Any, texture: Scene) -> None:
    bench = driven(make_bench(), texture, lease_s=0.6)
    ends_s = 0.2 + 0.6
    bench.turn(0.5)
    assert ends_s - 0.01 < bench.last_output_s() <= ends_s + 0.1
    assert bench.interlock.state.state == "disarmed"


def test_output_comes_back_after_arming_again(make_bench: Any, texture: Scene) -> None:
    bench = driven(make_bench(), texture)
    bench.feed(Stop("ben"))
    bench.turn(0.2)
    bench.arm()
    turns = bench.turn(SETTLED_S)
    assert any(turn.exchange.voltage_v.any() for turn in turns)


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


def envelope_v(bench: Any) -> FloatArray:
    """Return the largest published volts from each sample on, over a period of the carrier.

    NaN where samples were lost on the way here.
    """
    played = np.full(bench.rig.next_play_sample + PERIOD - 1, np.nan)
    for turn in bench.turns:
        for block in blocks_of(turn, Stamp(0, 0), Flag(0), bench.rate_hz):
            if block.stream == VOLTAGE:
                first = block.first_sample
                played[first : first + block.data.shape[1]] = block.data[0]
    largest: FloatArray = np.max(sliding_window_view(np.abs(played), PERIOD), 1)
    return largest


@pytest.mark.parametrize("lead_ms", [20.0, 17.3, 5.0])
def test_what_is_rendered_is_published_for_the_samples_at_which_it_plays(
    make_bench: Any, texture: Scene, lead_ms: float
) -> None:
    bench = driven(make_bench(lead_ms=lead_ms), texture)
    bench.turns.clear()
    bench.turn(1.0)
    streams: dict[int, dict[int, FloatArray]] = {RENDER: {}, VOLTAGE: {}, TRUTH: {}}
    for turn in bench.turns:
        flags = flags_of(turn, bench.rig.info, False)
        for block in blocks_of(turn, Stamp(0, 0), flags, bench.rate_hz):
            if block.stream in streams:
                at = range(block.first_sample, block.first_sample + block.data.shape[1])
                streams[block.stream] |= dict(zip(at, block.data.T, strict=True))
                later = block.first_sample - turn.exchange.first_sample
                assert block.utc_ns == round(1e9 * later / bench.rate_hz)
    rendered, monitored, true = (streams[which] for which in (RENDER, VOLTAGE, TRUTH))
    both = sorted(rendered.keys() & monitored.keys())
    assert len(both) > 0.9 * bench.rate_hz
    drive = np.array([rendered[sample][4] for sample in both], dtype=np.float64)
    played = screen_voltage(Screen(), drive, both[0], bench.rate_hz)
    np.testing.assert_allclose(played, [monitored[sample][0] for sample in both], atol=1e-3)
    felt = [sample for sample in both if sample > both[0] + 10_000]
    apart = [rendered[sample][0] - true[sample][0] for sample in felt]
    assert np.sqrt(np.mean(np.square(apart))) < 0.6
    speeds = np.array([rendered[sample][2] for sample in felt])
    moved = np.diff([rendered[sample][0] for sample in felt]) * bench.rate_hz
    assert np.median(np.abs(np.abs(moved) - speeds[:-1])) < 0.1 * np.median(speeds)
    assert {int(rendered[sample][5]) for sample in felt} == {7}, "touch, acceleration and force"
    assert all(np.isfinite(rendered[sample][3]) for sample in felt)


def steady(bench: Any) -> None:
    """Arm the bench and have it play a drive that does not change."""
    bench.arm()
    excitation = Excitation(bias=0.5)
    compiled = compile_excitation(excitation, FrictionLaw(), bench.rate_hz)
    bench.orders.scene.append(SceneUpdate(compiled, arming=1))


@pytest.mark.parametrize("samples", [1, 40, 260, 730])
@pytest.mark.parametrize("fault", [EmptyOutput, LostSamples, LateBlock])
def test_output_comes_back_over_a_ramp_after_a_gap(
    make_bench: Any, fault: Any, samples: int
) -> None:
    bench = make_bench()
    steady(bench)
    bench.turn(SETTLED_S)
    at = bench.clock.sample() + 1_000
    bench.rig.faults.add(fault(at_sample=at, samples=samples))
    bench.turn(SETTLED_S)
    envelope = envelope_v(bench)[at - 500 : at + 3_000]
    full_v = bench.rig.info.screen_peak_v * np.sqrt(0.5)
    assert envelope[0] == pytest.approx(full_v, rel=1e-6)
    assert envelope[-1] == pytest.approx(full_v, rel=1e-6)
    rises = envelope[PERIOD:] - envelope[:-PERIOD]
    assert np.nanmax(rises) <= 2.0 * PERIOD * full_v / (RETURN_S * bench.rate_hz)
    margin = bench.rig.info.lead_samples if fault is LateBlock else 0
    if samples > margin + PERIOD:
        assert np.nanmin(envelope) < 0.1 * full_v


@pytest.mark.parametrize("blocks", range(6))
def test_a_block_that_was_not_taken_does_not_tear_the_ramp(
    make_bench: Any, blocks: int
) -> None:
    bench = make_bench()
    bench.turn(0.2)
    steady(bench)
    if blocks:
        bench.turn(0.005 * blocks)
    bench.rig.faults.add(Raised(at_sample=bench.clock.sample(), error="sensor"))
    bench.turn(SETTLED_S)
    envelope = envelope_v(bench)
    full_v = bench.rig.info.screen_peak_v * np.sqrt(0.5)
    rises = envelope[PERIOD:] - envelope[:-PERIOD]
    # The square root of the drive's ramp begins sqrt(3) times as steep as a straight one.
    assert np.nanmax(rises) <= 2.0 * PERIOD * 1.8 * full_v / (RAMP_S * bench.rate_hz)


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


def flagged(bench: Any, flag: Flag) -> list[range]:
    """Return the samples of each published block with a flag."""
    blocks = [
        block
        for turn in bench.turns
        for block in blocks_of(
            turn, Stamp(0, 0), flags_of(turn, bench.rig.info, False), bench.rate_hz
        )
        if block.stream == VOLTAGE and flag in block.flags
    ]
    return [
        range(block.first_sample, block.first_sample + block.data.shape[1]) for block in blocks
    ]


@pytest.mark.parametrize("lead_ms", [20.0, 17.3])
@pytest.mark.parametrize(("fault", "samples"), [(EmptyOutput, 40), (LostSamples, 150)])
def test_the_block_flagged_with_an_underrun_is_the_one_that_lacks_samples(
    make_bench: Any, texture: Scene, fault: Any, samples: int, lead_ms: float
) -> None:
    bench = driven(make_bench(lead_ms=lead_ms), texture)
    bench.rig.faults.add(fault(at_sample=bench.clock.sample() + 1_000, samples=samples))
    bench.turn(SETTLED_S)
    (gap,) = [turn.exchange for turn in bench.turns if turn.exchange.underrun_samples]
    play = gap.play_sample - gap.overrun_samples
    lacking = set(range(play, play + samples))
    ranges = flagged(bench, Flag.UNDERRUN)
    assert lacking <= {sample for each in ranges for sample in each}
    assert all(lacking & set(each) for each in ranges)


@pytest.mark.parametrize(
    ("count", "flag"),
    [("clipped_samples", Flag.CLIPPED), ("extrapolated_samples", Flag.EXTRAPOLATED)],
)
@pytest.mark.parametrize("lead_ms", [20.0, 17.3])
def test_the_blocks_flagged_are_those_whose_samples_did_not_fit(
    make_bench: Any,
    texture: Scene,
    count: str,
    flag: Flag,
    lead_ms: float,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    bench = driven(make_bench(lead_ms=lead_ms), texture)
    render = Renderer.render
    rendered_at: list[int] = []

    def render_one_badly(*arguments: Any, **named: Any) -> Rendered:
        rendered = render(*arguments, **named)
        bad = len(rendered_at) == 10
        rendered_at.append(arguments[1])
        counts = {"clipped_samples": 0, "extrapolated_samples": 0, count: int(bad)}
        return replace(rendered, **counts)  # type: ignore[arg-type]

    monkeypatch.setattr(Renderer, "render", render_one_badly)
    bench.turn(0.1)
    cause = set(range(rendered_at[10], rendered_at[10] + 100))
    ranges = [each for each in flagged(bench, flag) if each[0] >= rendered_at[0]]
    assert cause <= {sample for each in ranges for sample in each}
    assert all(cause & set(each) for each in ranges)


def test_blocks_are_flagged_as_scaled_from_the_sample_on_that_is(
    make_bench: Any, texture: Scene
) -> None:
    bench = driven(make_bench(), texture)
    region = texture.regions[0].model_copy(update={"gain": 100.0})
    bench.play(Scene(regions=[region]))
    first = bench.rig.next_play_sample
    bench.turn(0.1)
    assert flagged(bench, Flag.SCALED)[0] == range(first, first + 100)


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
            self.info = inner.info

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


def test_what_the_publisher_does_not_take_is_counted(make_bench: Any) -> None:
    bench = make_bench()
    for _ in range(HANDOVER_BLOCKS + 10):
        bench.loop.turn()
    assert bench.loop.tally.blocks_dropped == 10
    first = bench.turn(0.005)
    assert len(first) == HANDOVER_BLOCKS
    (after,) = bench.turn(0.005)
    assert after.number == first[-1].number + 12, "the gap shows"


def test_bug_trips_once_and_a_second_one_ends_the_loop(
    make_bench: Any, texture: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench = driven(make_bench(), texture)

    def broken(*_arguments: object, **_named: object) -> None:
        raise ZeroDivisionError("a bug")

    monkeypatch.setattr("frictus_service.synthesis.renderer.Renderer.render", broken)
    bench.loop.turn()
    safety = bench.interlock.state
    kind: FaultKind = safety.fault[0]
    assert (safety.state, kind) == ("tripped", "internal")
    with pytest.raises(ZeroDivisionError):
        bench.loop.turn()


def test_stream_without_updates_fades_to_its_bias(make_bench: Any, texture: Scene) -> None:
    bench = driven(make_bench(), texture)
    budget = StreamBudget.open(0.1, FrictionLaw())
    wave = 0.08 * np.sin(2.0 * np.pi * np.arange(64) / 64.0)
    frame = StreamFrame(1, 0, 0, 1, 1.0, True, 0.0, wave.astype(np.float32))
    update = budget.compile(frame)
    bench.orders.scene.append(SceneUpdate(update, bench.now_s + 0.2, budget.quiet, 1))
    bench.turn(0.1)
    assert not bench.loop.rendering.stream_stale
    bench.turn(0.3)
    assert bench.loop.rendering.stream_stale
    target = bench.loop.rendering.chain.renderer._target
    assert np.allclose(target, budget.quiet.applied.bias_n)
    bench.orders.scene.append(SceneUpdate(update, bench.now_s + 0.2, budget.quiet, 1))
    bench.turn(0.05)
    assert not bench.loop.rendering.stream_stale


def test_stream_does_not_outlive_its_lease(make_bench: Any, texture: Scene) -> None:
    bench = driven(make_bench(), texture)
    budget = StreamBudget.open(0.1, FrictionLaw())
    bench.orders.scene.append(SceneUpdate(budget.quiet, afterwards=budget.quiet, arming=1))
    bench.turn(0.1)
    assert (Flag.SCALED in bench.turns[-1].output) == budget.applied.scaled
    bench.feed(Stop("ben"))
    bench.turn(0.1)
    bench.arm()
    bench.turn(SETTLED_S)
    targets = [
        bench.loop.rendering.chain.renderer._target.copy()
        for _ in range(40)
        if bench.turn(0.005)
    ]
    assert np.ptp(targets) > 0.05, "the standing scene is back"


def test_law_changes_only_without_output(make_bench: Any, texture: Scene) -> None:
    bench = driven(make_bench(), texture)
    order = ordered(bench, stronger(), texture)
    before = bench.orders.model.in_force
    bench.turn(0.1)
    assert not order.done.is_set()
    assert bench.orders.model.in_force is before
    bench.feed(Stop("ben"))
    bench.turn(0.2)
    assert order.done.is_set()
    assert bench.orders.model.in_force is order.model


def test_a_scene_compiled_for_the_former_model_gives_way(
    make_bench: Any, texture: Scene
) -> None:
    bench = make_bench()
    bench.turn(0.2)
    bench.play(Scene())
    order = ordered(bench, stronger(), texture)
    bench.turn(0.1)
    assert bench.loop.rendering.chain.renderer.scene is order.scene


def test_reply_state_and_loop_agree_on_the_model_though_the_loop_stands_still(
    make_bench: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench = make_bench()
    stage = SceneController(
        Screen(), bench.rate_hz, bench.interlock, bench.orders, lambda: bench.now_s
    )
    models = ModelController(
        Screen(), bench.interlock, bench.orders, stage, lambda: bench.now_s
    )
    bench.turn(0.1)
    stands, goes_on = threading.Event(), threading.Event()

    class Slow(Inverter):
        def __init__(self, *arguments: Any) -> None:
            stands.set()
            assert goes_on.wait(30.0)
            super().__init__(*arguments)

    def turn_until_it_stands() -> None:
        while not stands.is_set():
            bench.loop.turn()

    monkeypatch.setattr("frictus_service.synthesis.renderer.Inverter", Slow)
    loop = threading.Thread(target=turn_until_it_stands)
    loop.start()
    try:
        request = ModelRequest(client="ann", utc_ns=0, model=stronger())
        try:
            etag = models.set_model(request).etag
        except RefusedError:
            etag = etag_of(placeholder_model())
    finally:
        goes_on.set()
        loop.join()
    in_force = bench.orders.model.in_force
    assert etag == models.model.etag == in_force.state.etag
    assert bench.loop.rendering.chain.renderer.inverse is in_force.inverse


def test_a_drift_counts_from_when_the_law_came_and_through_armings(
    make_bench: Any,
) -> None:
    hum = Spectrum(components=[Component(amplitude_n=0.05, hz=100.0)])
    texture = Scene(regions=[Region(texture=hum)])
    bench = make_bench()
    bench.turn(1.0)
    drift = Effect(id="gain_drift", parameters={"per_minute": 1.0})
    drifting = placeholder_model().model_copy(update={"effects": [drift]})
    scene = ordered(bench, drifting, texture).scene
    bench.turn(0.005)
    came_s = bench.now_s
    levels = []
    for _ in range(2):
        bench.turn(1.5)
        bench.arm()
        bench.turn(0.5)
        turns = bench.turn(0.5)
        voltage = np.concatenate([turn.exchange.voltage_v for turn in turns])
        since_min = (bench.now_s - 0.25 - came_s) / 60.0
        levels.append(drive_fraction_of(Screen(), voltage).mean() * np.exp(since_min))
        bench.feed(Stop("ann"))
        bench.turn(0.2)
    assert levels[1] == pytest.approx(levels[0], rel=2e-3)
    assert levels[0] * FrictionLaw().gain_n == pytest.approx(scene.applied.bias_n, rel=5e-3)


def test_stopping_plays_the_ramp_out(make_bench: Any, texture: Scene) -> None:
    bench = driven(make_bench(), texture)
    assert bench.rig.armed
    stop = threading.Event()
    stop.set()
    stopped_at = bench.clock.sample()
    bench.loop.run_until(stop)
    assert not bench.rig.armed
    assert bench.clock.sample() >= stopped_at + bench.rig.info.lead_samples
    assert not bench.rig.holding


@pytest.mark.parametrize("is_read", [True, False])
def test_the_loop_gives_way_to_who_publishes_what_is_read(
    make_bench: Any, monkeypatch: pytest.MonkeyPatch, is_read: bool
) -> None:
    bench = make_bench()
    stop = threading.Event()
    slept: list[tuple[int, float]] = []  # blocks that wait to be published, and for how long

    def render(*_given: object, **_named: object) -> object:
        if bench.loop.tally.blocks == 5:
            stop.set()
        return step(*_given, **_named)

    step = bench.loop.rendering.chain.step
    monkeypatch.setattr(bench.loop.rendering.chain, "step", render)
    monkeypatch.setattr(
        bench.loop, "_sleep", lambda s: slept.append((bench.loop.handover.qsize(), s))
    )
    bench.loop.is_read = is_read
    bench.loop.run_until(stop)
    block_s = 100 / bench.rig.info.clock_hz
    assert [waiting for waiting, _ in slept] == (list(range(1, 7)) if is_read else [])
    assert all(0.0 < pause_s <= 0.1 * block_s for _, pause_s in slept)


@pytest.mark.parametrize("scale", [0.1, 1.0, 10.0])
def test_no_block_is_late_by_a_clock_of_any_scale(
    make_bench: Any, texture: Scene, scale: float
) -> None:
    bench = make_bench(clock=scale)
    bench.play(texture)
    bench.arm(lease_s=100.0)
    turns = bench.turn(3.0)
    assert bench.interlock.state.state == "armed"
    assert bench.loop.tally.deadline_misses == 0
    assert bench.loop.lateness.max_ms < 1.0
    assert any(turn.exchange.voltage_v.any() for turn in turns)

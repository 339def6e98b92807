"""The block loop on a virtual clock: when it outputs, and what it plays."""

import threading
from typing import Any

import numpy as np
import pytest
from numpy.lib.stride_tricks import sliding_window_view

from frictus.block import Flag
from frictus.keys import VOLTAGE
from frictus.messages import Excitation
from frictus.stream import StreamFrame
from frictus.textures import Scene
from frictus_hardware.arrays import FloatArray
from frictus_hardware.output import RETURN_S
from frictus_hardware.physics.friction import FrictionLaw
from frictus_hardware.simulated.faults import (
    EmptyOutput,
    LateBlock,
    LostSamples,
    Raised,
)
from frictus_service.daemon.block_loop.block_record import blocks_of
from frictus_service.daemon.block_loop.timebase import Stamp
from frictus_service.daemon.inboxes import SceneUpdate
from frictus_service.daemon.safety import ClientVanished, Disarm, Stop
from frictus_service.synthesis.renderer import RAMP_S
from frictus_service.synthesis.scene import StreamBudget, compile_excitation

from .driven import PERIOD, SETTLED_S, driven


def test_nothing_is_output_while_disarmed(make_bench: Any, texture: Scene) -> None:
    bench = make_bench()
    bench.play(texture)
    bench.turn(1.0)
    assert not bench.voltage_v().any()
    assert bench.heartbeat.value == 200
    assert not any(turn.armed for turn in bench.turns)


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


def steady(bench: Any) -> None:
    """Arm the bench and have it play a drive that does not change."""
    bench.arm()
    excitation = Excitation(bias=0.5)
    compiled = compile_excitation(excitation, FrictionLaw(), bench.rate_hz)
    bench.orders.scene.append(SceneUpdate(compiled, arming=1))


@pytest.mark.parametrize("when", ["armed within the block", "left of another arming"])
def test_what_is_ordered_within_the_block_that_arms_is_played(
    make_bench: Any, when: str
) -> None:
    """The block began with the state before; its order must neither be lost nor come early."""
    bench = make_bench()
    if when == "left of another arming":
        bench.arm()
        bench.turn(SETTLED_S)
        bench.feed(Disarm("ann"))
    bench.turn(SETTLED_S)
    tick, arming = bench.interlock.tick, bench.interlock.state.armings + 1
    compiled = compile_excitation(Excitation(bias=0.5), FrictionLaw(), bench.rate_hz)

    def armed_right_after(now_s: float) -> Any:
        before = tick(now_s)
        bench.interlock.tick = tick
        bench.arm()
        bench.orders.scene.append(SceneUpdate(compiled, arming=arming))
        return before

    bench.interlock.tick = armed_right_after
    first, *others = bench.turn(SETTLED_S)
    assert not first.exchange.applied_v.any()
    assert others[-1].exchange.voltage_v.any()


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
    bench.turn(0.3)
    assert bench.loop.rendering.stream_stale
    bench.feed(Stop("ben"))
    bench.turn(0.1)
    assert not bench.loop.rendering.stream_stale  # it ended with its lease


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

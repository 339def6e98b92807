"""The blocks that the loop hands over: whole, in order, flagged where something was lost."""

import threading
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from frictus.block import Flag
from frictus.keys import RENDER, TRUTH, VOLTAGE
from frictus.textures import Scene
from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.screen import Screen, screen_voltage
from frictus_hardware.simulated.faults import (
    EmptyOutput,
    LostSamples,
)
from frictus_service.daemon.block_loop.block_record import blocks_of, flags_of
from frictus_service.daemon.block_loop.loop import HANDOVER_BLOCKS
from frictus_service.daemon.block_loop.timebase import Stamp
from frictus_service.synthesis.renderer import Rendered, Renderer

from .driven import SETTLED_S, driven


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


def test_what_the_publisher_does_not_take_is_counted(make_bench: Any) -> None:
    bench = make_bench()
    for _ in range(HANDOVER_BLOCKS + 10):
        bench.loop.turn()
    assert bench.loop.tally.blocks_dropped == 10
    first = bench.turn(0.005)
    assert len(first) == HANDOVER_BLOCKS
    (after,) = bench.turn(0.005)
    assert after.number == first[-1].number + 12, "the gap shows"


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

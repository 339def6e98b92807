"""How the lead grows: by what was missing, at the next arming, never while there is output."""

from typing import Any

import numpy as np
import pytest

from frictus.block import Flag
from frictus.keys import RENDER, TRUTH, VOLTAGE
from frictus.textures import Scene
from frictus_hardware.physics.screen import Screen, screen_voltage
from frictus_hardware.simulated.faults import EmptyOutput, LostSamples
from frictus_service.daemon.block_loop.block_checks import RING_SAMPLES
from frictus_service.daemon.block_loop.block_record import blocks_of, flags_of
from frictus_service.daemon.block_loop.lead import LeadGrowth, grown_lead
from frictus_service.daemon.block_loop.timebase import Stamp
from frictus_service.daemon.safety import Disarm

from .ni_bench import running

LEAD_MS = 5.0
LONGER = 200
"""Samples: 5 ms and a block more."""


@pytest.mark.parametrize(
    ("lead", "missing", "longest", "grown"),
    [
        (100, 0, 400, 200),
        (100, 1, 400, 200),
        (100, 100, 400, 200),
        (100, 101, 400, 300),
        (100, 5_000, 400, 400),
        (350, 1, 400, 400),
        (400, 1, 400, 400),
        (600, 1, 0, 600),  # fixed
    ],
)
def test_the_lead_grows_by_whole_blocks_to_the_longest(
    lead: int, missing: int, longest: int, grown: int
) -> None:
    assert grown_lead(lead, missing, 100, longest) == grown


def test_blocks_in_a_row_make_one_gap() -> None:
    growth = LeadGrowth(100)
    for missing in (100, 100, 30, 0, 100, 0):
        growth.note(missing)
    assert growth.wanted(100, 1_000) == 400
    growth.forget()
    assert growth.wanted(400, 1_000) == 400


def test_a_sensor_that_failed_costs_no_lead() -> None:
    """The device lost a block before it was sensed: none came too late to play."""
    with running(lead_ms=10.0, max_lead_ms=30.0, reserve_ms=3.0) as bench:
        bench.arm()
        bench.world.overloaded = True
        bench.turn(1)
        bench.world.overloaded = False
        bench.turn(150)
        assert bench.loop.tally.overruns > 0
        bench.interlock.feed(Disarm("ann"), 1e-9 * bench.time())
        bench.turn(40)
        bench.arm()
        assert bench.loop.tally.lead_growths == 0
        assert bench.backend.info.lead_samples == 200


def test_an_output_that_ran_dry_costs_a_block() -> None:
    growth = LeadGrowth(100)
    growth.note_run_dry()
    assert growth.wanted(100, 1_000) == 200


def armed(bench: Any, texture: Scene) -> Any:
    bench.play(texture)
    bench.turn(0.2)
    bench.arm()
    bench.turn(0.3)
    return bench


def starve(bench: Any, samples: int = 40) -> None:
    at = bench.clock.sample() + 1_000
    bench.rig.faults.add(EmptyOutput(at_sample=at, samples=samples))
    bench.turn(0.2)
    assert bench.loop.tally.underruns


def arm_anew(bench: Any) -> None:
    bench.feed(Disarm("ann"))
    bench.turn(0.2)
    bench.arm()
    bench.turn(0.3)


def test_the_lead_grows_at_the_next_arming_and_not_before(
    make_bench: Any, texture: Scene
) -> None:
    bench = armed(make_bench(lead_ms=LEAD_MS), texture)
    starve(bench)
    assert bench.rig.info.lead_samples == bench.loop.tally.lead_samples == 100
    bench.feed(Disarm("ann"))
    bench.turn(0.2)
    assert bench.rig.info.lead_samples == 100, "it is not armed"
    bench.arm()
    bench.turn(0.3)
    assert bench.rig.info.lead_samples == bench.loop.tally.lead_samples == LONGER
    assert bench.loop.tally.lead_growths == 1
    assert bench.interlock.state.state == "armed", "nothing tripped"
    assert bench.loop.run == 7, "the device was not opened anew"
    assert bench.loop.lateness.least_margin_ms() == pytest.approx(10.0), "of the longer lead"
    arm_anew(bench)
    assert bench.rig.info.lead_samples == LONGER, "once for what was missing once"


def test_what_is_output_has_no_step_and_zeros_where_the_lead_grew(
    make_bench: Any, texture: Scene
) -> None:
    bench = armed(make_bench(lead_ms=LEAD_MS), texture)
    starve(bench)
    bench.feed(Disarm("ann"))
    bench.turn(0.2)
    del bench.turns[:-1]
    bench.arm()
    bench.turn(0.3)
    ends = [turn.exchange.play_sample + 100 for turn in bench.turns]
    begins = [turn.exchange.play_sample for turn in bench.turns]
    jumps = [b - e for b, e in zip(begins[1:], ends[:-1], strict=True)]
    assert sorted(set(jumps)) == [0, 100]
    assert jumps.count(100) == 1
    gap = ends[jumps.index(100)]
    first = bench.turns[0].exchange.first_sample
    voltage = np.concatenate([turn.exchange.voltage_v for turn in bench.turns])
    assert not voltage[gap - first : gap - first + 100].any()
    assert voltage[gap - first + 100 :].any()


def test_the_monitor_is_not_compared_with_what_played_there_long_ago(
    make_bench: Any, texture: Scene
) -> None:
    bench = armed(make_bench(lead_ms=LEAD_MS), texture)
    bench.turn(1.2 * RING_SAMPLES / bench.rate_hz)
    starve(bench)
    arm_anew(bench)
    assert bench.loop.tally.lead_growths == 1
    assert bench.interlock.state.state == "armed", bench.interlock.state.fault


def test_after_it_grew_what_is_rendered_is_where_the_finger_then_is(
    make_bench: Any, texture: Scene
) -> None:
    bench = armed(make_bench(lead_ms=LEAD_MS), texture)
    starve(bench)
    arm_anew(bench)
    assert bench.rig.info.lead_samples == LONGER
    bench.turns.clear()
    bench.turn(1.0)
    seen: dict[int, dict[int, Any]] = {RENDER: {}, VOLTAGE: {}, TRUTH: {}}
    for turn in bench.turns:
        flags = flags_of(turn, bench.rig.info, False)
        for block in blocks_of(turn, Stamp(0, 0), flags, bench.rate_hz):
            if block.stream in seen:
                at = range(block.first_sample, block.first_sample + 100)
                seen[block.stream] |= dict(zip(at, block.data.T, strict=True))
    both = sorted(seen[RENDER].keys() & seen[VOLTAGE].keys())
    assert len(both) > 0.9 * bench.rate_hz
    drive = np.array([seen[RENDER][sample][4] for sample in both], dtype=np.float64)
    played = screen_voltage(Screen(), drive, both[0], bench.rate_hz)
    np.testing.assert_allclose(played, [seen[VOLTAGE][sample][0] for sample in both], atol=1e-3)
    apart = [seen[RENDER][sample][0] - seen[TRUTH][sample][0] for sample in both]
    assert np.sqrt(np.mean(np.square(apart))) < 0.4


def test_flags_still_name_the_samples_that_are_missing(make_bench: Any, texture: Scene) -> None:
    bench = armed(make_bench(lead_ms=LEAD_MS), texture)
    starve(bench)
    arm_anew(bench)
    bench.turns.clear()
    starve(bench)
    (gap,) = [turn.exchange for turn in bench.turns if turn.exchange.underrun_samples]
    lacking = set(range(gap.play_sample, gap.play_sample + 40))
    flagged = {
        sample
        for turn in bench.turns
        if Flag.UNDERRUN in turn.output
        for sample in range(turn.exchange.first_sample, turn.exchange.first_sample + 100)
    }
    assert lacking <= flagged
    assert len(flagged) <= 200


def test_a_stop_still_ramps_to_zero(make_bench: Any, texture: Scene) -> None:
    bench = armed(make_bench(lead_ms=LEAD_MS), texture)
    starve(bench)
    arm_anew(bench)
    stopped_s = bench.clock.sample() / bench.rate_hz
    bench.feed(Disarm("ann"))
    bench.turn(0.3)
    assert bench.last_output_s() - stopped_s <= 0.005 + 0.02
    assert bench.interlock.state.state == "disarmed"


@pytest.mark.parametrize("settings", [{}, {"lead_ms": 20.0}, {"max_lead_ms": LEAD_MS}])
def test_a_lead_that_may_not_grow_does_not(
    make_bench: Any, texture: Scene, settings: dict[str, float]
) -> None:
    # 20 ms, the default, is as long as a lead grows where nothing else is configured.
    if "max_lead_ms" in settings:
        settings = {"lead_ms": LEAD_MS, **settings}
    bench = armed(make_bench(**settings), texture)
    lead = bench.rig.info.lead_samples
    starve(bench)
    arm_anew(bench)
    assert bench.rig.info.lead_samples == lead
    assert bench.loop.tally.lead_growths == 0


def test_it_ends_at_the_longest(make_bench: Any, texture: Scene) -> None:
    bench = armed(make_bench(lead_ms=LEAD_MS, max_lead_ms=12.0), texture)
    leads = []
    for _ in range(3):
        starve(bench)
        arm_anew(bench)
        leads.append(bench.rig.info.lead_samples)
    assert leads == [200, 240, 240]
    assert bench.loop.tally.lead_growths == 2


def test_what_the_device_lost_or_nobody_felt_makes_no_lead_longer(
    make_bench: Any, texture: Scene
) -> None:
    bench = make_bench(lead_ms=LEAD_MS)
    bench.play(texture)
    starve(bench)  # disarmed: it played zero anyhow
    bench.arm()
    bench.turn(0.3)
    at = bench.clock.sample() + 1_000
    bench.rig.faults.add(LostSamples(at_sample=at, samples=150))
    bench.turn(0.2)
    assert bench.loop.tally.overruns
    arm_anew(bench)
    assert bench.rig.info.lead_samples == 100
    assert bench.loop.tally.lead_growths == 0

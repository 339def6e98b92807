"""The fault table at the daemon: every row, at random moments and in any order.

The rig is on a fake NI device whose clock passes by reads alone: bounds are counted in samples.
"""

from dataclasses import replace

import grpc
import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from tests.hardware.nidaq.fake_server import Fault

from frictus_service.config import Limits
from frictus_service.daemon.safety import LATCHING, Disarm
from frictus_service.synthesis.renderer import RAMP_S

from .ni_bench import BLOCK, RATE_HZ, Bench, World, running

STALE_S = 1e-3 * Limits().finger_stale_ms
READ, WRITE, COUNT = "ReadAnalogF64", "WriteAnalogF64", "GetReadAttributeUInt64"


def bound_samples(bench: Bench) -> int:
    """From a fault to zero: the block it is seen in and the next, the lead, and the ramp."""
    return 2 * BLOCK + bench.backend.info.lead_samples + round(RAMP_S * RATE_HZ)


def quiet_after(bench: Bench, began: int) -> None:
    """Expect the output to be zero within the bound, and to stay so."""
    bound = bound_samples(bench)
    bench.turn(2 * bound // BLOCK)
    driven = np.flatnonzero(bench.device.played_v)
    assert not driven.size or driven[-1] <= began + bound
    assert bench.device.output_v == 0.0


LOST = {
    "stream_lost": (-200290, -200279, -200361, -200018, -200621),
    "device_lost": (-88709, -88710, -50405, -200045, -200088, -209999),
}
CODES = [(kind, code) for kind, codes in LOST.items() for code in codes]


def lose(bench: Bench, kind: str, failure: int | grpc.StatusCode, rpc: str, wait: int) -> None:
    """A stream, a device or a link is lost: at zero when the fault is known."""
    bench.server.plan(Fault(failure, rpc, at_sample=bench.device.now + wait))
    resets = bench.device.resets
    bench.turn(wait // BLOCK + 3)
    assert bench.seen, "nothing came up"
    assert set(bench.seen) == {kind}
    assert bench.device.resets > resets, "opening resets the device"
    assert not np.any(bench.device.played_v), "and plays zeros since"
    assert bench.device.output_v == 0.0
    assert (bench.interlock.state.state == "tripped") == (kind in LATCHING)
    assert bench.interlock.state.state != "armed"
    assert bench.loop.run > 7


def fail_sensor(bench: Bench, which: str) -> None:
    """No rendering while it lasts; it comes back by itself, in the same arming."""
    setattr(bench.world, which, True)
    if which == "silent":  # a finger of which nothing is told is believed for so long
        bench.turn(round(STALE_S * RATE_HZ) // BLOCK)
    quiet_after(bench, bench.device.now)
    assert bench.interlock.state.state == "armed"
    setattr(bench.world, which, False)
    bench.turn(250)  # the device's health is asked for twice a second
    assert np.any(bench.device.played_v[-2_000:])
    assert bench.interlock.state.state == "armed"
    assert not bench.interlock.state.lasting


def break_safety(bench: Bench, change: dict[str, float]) -> None:
    """It trips, and stays tripped when the cause has gone."""
    began = bench.device.now
    for name, value in change.items():
        setattr(bench.world, name, value)
    quiet_after(bench, began)
    assert set(bench.seen) == {"safety"}
    for name, value in vars(World()).items():
        setattr(bench.world, name, value)
    bench.turn(250)
    assert bench.interlock.state.state == "tripped"
    assert bench.device.output_v == 0.0


def try_again(bench: Bench, code: int, rpc: str, wait: int) -> None:
    """What is transient is tried again, counted, and costs no sample."""
    retries, tally = bench.backend.retries, replace(bench.loop.tally)
    bench.server.plan(Fault(code, rpc, at_sample=bench.device.now + wait, partial=0))
    bench.turn(wait // BLOCK + 3)
    assert bench.backend.retries == retries + 1
    assert bench.loop.tally.overruns == tally.overruns
    assert bench.loop.tally.underruns == tally.underruns
    assert bench.interlock.state.state == "armed"
    assert not bench.seen


def try_in_vain(bench: Bench, wait: int) -> None:
    """Beyond the lead it is a lost stream."""
    bench.server.plan(Fault(-200284, READ, at_sample=bench.device.now + wait, times=100_000))
    for _ in range(wait // BLOCK + 2):
        bench.loop.turn()
    bench.server.servicer.faults.clear()
    bench.turn(3)
    assert bench.interlock.state.state == "tripped"
    fault = bench.interlock.state.fault
    assert fault is not None
    assert fault[0] == "stream_lost"
    assert bench.device.output_v == 0.0


ROWS = st.one_of(
    st.tuples(st.just("lost"), st.sampled_from(CODES), st.sampled_from([READ, WRITE, COUNT])),
    st.tuples(
        st.just("link"),
        st.sampled_from([grpc.StatusCode.UNAVAILABLE, grpc.StatusCode.DEADLINE_EXCEEDED]),
        st.sampled_from([READ, WRITE, COUNT]),
    ),
    st.tuples(st.just("sensor"), st.sampled_from(["overloaded", "silent"]), st.just("")),
    st.tuples(
        st.just("safety"),
        st.sampled_from([{"monitor_gain": 0.5}, {"monitor_gain": 0.0}, {"force_n": 50.0}]),
        st.just(""),
    ),
    st.tuples(st.just("transient"), st.just(-200284), st.just(READ)),
    st.tuples(st.just("transient"), st.just(-200292), st.just(WRITE)),
    st.tuples(st.just("vain"), st.just(None), st.just("")),
)
WAITS = st.integers(1, 1_500)


def strike(bench: Bench, row: tuple[str, object, str], wait: int) -> None:
    name, what, rpc = row
    bench.forget()
    match name, what:
        case "lost", (str(kind), int(code)):
            lose(bench, kind, code, rpc, wait)
        case "link", grpc.StatusCode() as status:
            lose(bench, "link_lost", status, rpc, wait)
        case "sensor", str(which):
            fail_sensor(bench, which)
        case "safety", dict(change):
            break_safety(bench, change)
        case "transient", int(code):
            try_again(bench, code, rpc, wait)
        case "vain", None:
            try_in_vain(bench, wait)
        case _:
            raise AssertionError(row)


def strike_all(faults: list[tuple[tuple[str, object, str], int]]) -> None:
    with running() as bench:
        bench.arm()
        for row, wait in faults:
            strike(bench, row, wait)
            if bench.interlock.state.state != "armed":
                bench.arm()


@given(faults=st.lists(st.tuples(ROWS, WAITS), min_size=1, max_size=4))
@settings(
    max_examples=3,
    deadline=None,
    phases=[Phase.generate],
    suppress_health_check=[HealthCheck.too_slow],
)
def test_faults_in_any_order_are_typed_counted_safe_and_over(
    faults: list[tuple[tuple[str, object, str], int]],
) -> None:
    strike_all(faults)


@pytest.mark.parametrize(
    "row",
    [
        ("lost", ("stream_lost", -200290), READ),
        ("lost", ("device_lost", -88709), WRITE),
        ("link", grpc.StatusCode.UNAVAILABLE, READ),
        ("sensor", "overloaded", ""),
        ("sensor", "silent", ""),
        ("safety", {"monitor_gain": 0.5}, ""),
        ("safety", {"force_n": 50.0}, ""),
        ("transient", -200284, READ),
        ("transient", -200292, WRITE),
        ("vain", None, ""),
    ],
    ids=lambda row: f"{row[0]}-{row[1]}",
)
def test_each_row_of_the_fault_table(
    rng: np.random.Generator, row: tuple[str, object, str]
) -> None:
    with running() as bench:
        bench.arm()
        strike(bench, row, int(rng.integers(1, 1_500)))
        if bench.interlock.state.state != "armed":
            bench.arm()


@pytest.mark.parametrize("lead_ms", [2.0, 5.0, 10.0, 20.0])
def test_a_short_lead_is_driven_without_a_fault_and_stops_in_time(lead_ms: float) -> None:
    with running(lead_ms=lead_ms) as bench:
        bench.arm()
        assert bench.backend.info.lead_samples == round(20 * lead_ms)
        bench.turn(100)
        assert not bench.seen
        began = bench.device.now
        assert bench.interlock.feed(Disarm("ann"), 1e-9 * bench.time()) is None
        quiet_after(bench, began)
        assert bench.interlock.state.state == "disarmed"
        assert bench.loop.tally.underruns == bench.loop.tally.overruns == 0


def test_an_output_that_ran_dry_while_armed_makes_the_lead_longer_at_the_next_arming() -> None:
    with running(lead_ms=20.0, reserve_ms=5.0, max_lead_ms=27.0) as bench:
        leads = []
        for underruns in (1, 2, 3):
            bench.arm()
            leads.append(bench.backend.info.lead_samples)
            bench.forget()
            bench.device.pass_time(600)  # the loop is late by more than is queued
            bench.turn(3)
            assert bench.seen == ["stream_lost"] * len(bench.seen)
            assert bench.seen
            assert bench.interlock.state.state == "tripped"
            assert bench.loop.tally.underruns == underruns
            assert bench.backend.info.lead_samples == leads[-1], "not before the next arming"
        assert leads == [400, 500, 540]
        assert bench.loop.tally.lead_growths == 2
        quiet_after(bench, bench.device.now)


@pytest.mark.campaign
@pytest.mark.timeout(2_400)
@given(faults=st.lists(st.tuples(ROWS, WAITS), min_size=1, max_size=8))
@settings(
    max_examples=150,
    deadline=None,
    phases=[Phase.generate],
    suppress_health_check=list(HealthCheck),
)
def test_many_faults_in_any_order(
    faults: list[tuple[tuple[str, object, str], int]],
) -> None:
    strike_all(faults)

"""Sensors that send what no sensor can: the screen goes to zero or stays within its limits."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Final

import numpy as np
import pytest
from tests.service.daemon.conftest import Bench, MakeBench

from frictus.textures import Scene
from frictus_hardware.arrays import FloatArray
from frictus_hardware.base import Exchange, TouchReport
from frictus_service.daemon.block_loop.block_record import finger_of, touch_of
from frictus_service.daemon.block_loop.timebase import Stamp
from frictus_service.daemon.safety import Reset

Lie = Callable[[Exchange], Exchange]
NUMBERS: Final = (
    *(math.nan, math.inf, -math.inf, 1.7e308, -1.7e308, 1e155, -1e155, 1e39, 1e5),
    *(5e-324, -5e-324, 1e-310),
)
LATE_S: Final = 0.5
"""Longer than any bound until zero."""


def lying(**values: float) -> Lie:
    """Return a lie: a number in place of what a sensor says."""

    def lie(exchange: Exchange) -> Exchange:
        changed: dict[str, object] = {}
        for name, value in values.items():
            if name in ("x_mm", "y_mm", "measured_sample"):
                changed["touches"] = tuple(
                    replace(report, **{name: value})  # type: ignore[arg-type]
                    for report in exchange.touches
                )
                continue
            column, _, axis = name.partition("__")
            data = getattr(exchange, column).copy()
            data[:, int(axis)] = value
            changed[column] = data
        return replace(exchange, **changed)  # type: ignore[arg-type]

    return lie


def monitor(value: float) -> Lie:
    return lambda exchange: replace(exchange, voltage_v=np.full_like(exchange.voltage_v, value))


def told(bench: Bench, lie: Lie | None) -> None:
    """Have the rig's sensors lie from now on; None: no more."""
    exchange = type(bench.rig).exchange

    def lied(drive_v: FloatArray) -> Exchange:
        honest = exchange(bench.rig, drive_v)
        return honest if lie is None else lie(honest)

    bench.rig.exchange = lied  # type: ignore[method-assign]


@pytest.fixture
def bench(make_bench: MakeBench, texture: Scene) -> Bench:
    """Return a rig that drives the screen."""
    bench = make_bench()
    bench.play(texture)
    bench.turn(0.2)
    bench.arm(60.0)
    assert any(turn.exchange.applied_v.any() for turn in bench.turn(LATE_S))
    return bench


LIES: Final = {
    **{f"tangential force {v}": lying(force_n__0=v) for v in NUMBERS},
    **{f"normal force {v}": lying(force_n__2=v) for v in NUMBERS},
    **{f"nail {v}": lying(accel_m_s2__0=v, accel_m_s2__1=v) for v in NUMBERS},
    **{f"monitor {v}": monitor(v) for v in NUMBERS},
    **{f"place {v}": lying(x_mm=v) for v in NUMBERS},
    **{f"time {v}": lying(measured_sample=v) for v in (*NUMBERS, 1e18, -1e300)},
}


@pytest.mark.parametrize("lie", LIES.values(), ids=LIES)
def test_no_number_of_a_sensor_drives_the_screen_beyond_its_limit_or_ends_the_loop(
    bench: Bench, lie: Lie
) -> None:
    told(bench, lie)
    turns = bench.turn(2.0 * LATE_S)
    info = bench.rig.info
    for turn in turns:
        assert np.all(np.abs(turn.exchange.applied_v) <= info.screen_peak_v)
        assert np.all((turn.drive >= 0.0) & (turn.drive <= 1.0))
        finger_of(turn, Stamp(10**18, 0), info)
        for report in turn.exchange.touches:
            touch_of(report, turn.run, info)
    # And it drives again once the sensors say what is so.
    told(bench, None)
    bench.turn(0.2)
    if bench.interlock.state.state == "tripped":
        bench.feed(Reset())
    bench.turn(0.2)
    bench.arm(60.0)
    assert any(turn.exchange.applied_v.any() for turn in bench.turn(LATE_S))
    driven_v = np.concatenate([turn.drive for turn in bench.turn(LATE_S)])
    assert np.ptp(driven_v) > 0.05  # a texture, and not its bias alone


@pytest.mark.parametrize("lie", [lying(force_n__2=math.nan), monitor(math.inf)])
def test_what_is_no_number_is_told_as_such(bench: Bench, lie: Lie) -> None:
    told(bench, lie)
    bench.turn(0.1)
    fault = bench.interlock.state.fault
    assert fault is not None
    assert fault[0] == "safety"
    assert "is no finite number" in fault[1]


@pytest.mark.parametrize("ahead_s", [0.2, 10.0, 1e12])
def test_a_report_of_a_time_to_come_does_not_keep_a_finger_fresh(
    bench: Bench, ahead_s: float
) -> None:
    ahead = ahead_s * bench.rate_hz
    once: list[TouchReport] = []

    def lie(exchange: Exchange) -> Exchange:
        if once:
            return replace(exchange, touches=())  # and then nothing any more
        once.append(TouchReport(exchange.first_sample + ahead, 30.0, 17.0, True))
        return replace(exchange, touches=tuple(once))

    told(bench, lie)
    bench.turn(LATE_S)
    assert not any(turn.exchange.applied_v.any() for turn in bench.turn(LATE_S))


@pytest.mark.parametrize("with_force", [True, False])
def test_a_touch_sensor_that_freezes_with_fresh_stamps_has_no_air_driven(
    bench: Bench, with_force: bool
) -> None:
    """The finger lifts, which the force alone says; or there was no finger to begin with."""
    lifted = bench.now_s + 1.0

    def lie(exchange: Exchange) -> Exchange:
        frozen = (replace(each, x_mm=30.0, y_mm=17.0) for each in exchange.touches)
        if bench.now_s > lifted or not with_force:
            force = 0.002 * np.random.default_rng(exchange.first_sample).standard_normal(
                exchange.force_n.shape
            )
            exchange = replace(exchange, force_n=force)
        return replace(exchange, touches=tuple(frozen))

    told(bench, lie)
    felt = any(turn.exchange.applied_v.any() for turn in bench.turn(1.0)[100:])
    assert felt == with_force
    bench.turn(LATE_S)
    assert not any(turn.exchange.applied_v.any() for turn in bench.turn(5.0))
    told(bench, None)
    assert any(turn.exchange.applied_v.any() for turn in bench.turn(2.0))


def test_a_report_of_a_time_to_come_does_not_hold_off_those_that_follow(bench: Bench) -> None:
    once: list[TouchReport] = []

    def lie(exchange: Exchange) -> Exchange:
        if once:
            return exchange
        once.append(TouchReport(1e18, 30.0, 17.0, True))
        return replace(exchange, touches=tuple(once))

    told(bench, lie)
    bench.turn(0.1)
    assert not any(turn.stale for turn in bench.turn(LATE_S))
    assert bench.turns[-1].report_age_s > 0.0


def test_a_state_of_the_finger_that_is_not_finite_is_not_published(
    make_bench: MakeBench,
) -> None:
    bench = make_bench()
    told(bench, lying(force_n__2=math.nan))
    turn = bench.turn(0.05)[-1]
    assert finger_of(turn, Stamp(10**18, 0), bench.rig.info) is None


MISSHAPEN: Final[dict[str, Lie]] = {
    "fewer forces": lambda e: replace(e, force_n=e.force_n[:50]),
    "forces by axis": lambda e: replace(e, force_n=e.force_n.T),
    "accelerations by axis": lambda e: replace(e, accel_m_s2=e.accel_m_s2.T),
    "more of the monitor": lambda e: replace(e, voltage_v=np.tile(e.voltage_v, 2)),
    "an output that is no number": lambda e: replace(e, applied_v=e.applied_v * math.nan),
}


@pytest.mark.parametrize("lie", MISSHAPEN.values(), ids=MISSHAPEN)
def test_a_backend_that_returns_what_none_may_is_told_and_its_screen_goes_to_zero(
    bench: Bench, lie: Lie
) -> None:
    told(bench, lie)
    bench.loop.turn()
    safety = bench.interlock.state
    assert safety.state == "tripped"
    assert safety.fault is not None
    assert safety.fault[0] == "internal"
    assert "the backend simulated returned" in safety.fault[1]
    told(bench, None)
    bench.turn(0.1)
    assert not bench.voltage_v()[-100:].any()

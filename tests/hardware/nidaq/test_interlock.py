"""The line to the amplifier's interlock: high only while the rig is alive and well."""

import numpy as np
import pytest
from tests.hardware.nidaq.bench import Bench, BenchMaker, wiring
from tests.hardware.nidaq.fake_server import Fault

from frictus_hardware.errors import ConfigError, DeviceLostError, HardwareError, StreamLostError
from frictus_hardware.nidaq.config import InterlockLine

LINE = "Dev1/port0/line3"
INTERLOCK = InterlockLine("port0/line3", timeout_ms=100.0)


@pytest.fixture
def bench(make_bench: BenchMaker) -> Bench:
    return make_bench(interlock=INTERLOCK)


def test_it_is_high_while_the_rig_runs_and_low_before_and_after(bench: Bench) -> None:
    lines = bench.device.lines
    assert not lines.get(LINE)
    with bench.rig as rig:
        for _ in range(50):  # longer than the timeout
            rig.exchange(np.zeros(100))
            assert lines[LINE]
    assert not bench.device.lines.get(LINE)
    assert not bench.device.tasks


def test_the_device_pulls_it_low_when_nobody_feeds_it(bench: Bench) -> None:
    """As when the program or its computer has died: the output may go on, the line does not."""
    with bench.rig as rig:
        rig.arm()
        for _ in range(20):
            rig.exchange(np.full(100, 50.0))
        assert bench.device.output_v != 0.0
        bench.device.pass_time(2_001)
        assert not bench.device.lines[LINE]
        with pytest.raises(HardwareError, match="The output is at 0 V"):
            rig.exchange(np.zeros(100))
    assert not bench.device.lines.get(LINE)


def test_an_expired_watchdog_is_a_lost_device(bench: Bench) -> None:
    with bench.rig as rig:
        rig.exchange(np.zeros(100))
        for watched in bench.device.watched.values():
            watched.expired = True
        with pytest.raises(DeviceLostError, match="feeding the watchdog of the interlock"):
            rig.exchange(np.zeros(100))


def test_a_fault_opens_it_at_once(bench: Bench) -> None:
    with bench.rig as rig:
        rig.exchange(np.zeros(100))
        bench.server.plan(Fault(-200290, "ReadAnalogF64"))
        with pytest.raises(StreamLostError):
            rig.exchange(np.zeros(100))
        assert not bench.device.lines.get(LINE)


@pytest.mark.parametrize(
    ("interlock", "words"),
    [
        (InterlockLine("line0"), "interlock.line = 'line0'"),
        (InterlockLine(timeout_ms=30.0), "more than the longest lead and a block"),
        (InterlockLine(timeout_ms=5.0), "interlock.timeout_ms = 5"),
    ],
)
def test_what_cannot_be_is_refused(interlock: InterlockLine, words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        wiring(interlock=interlock)


def test_a_line_that_the_device_has_not_is_named(make_bench: BenchMaker) -> None:
    bench = make_bench(interlock=InterlockLine("port1/line0"))
    with pytest.raises(ConfigError, match=r"interlock: line = 'port1/line0'"):
        bench.rig.open()
    assert not bench.device.tasks

"""A touch sensor of its own thread, by bytes at its port and a clock that is handed in."""

import queue
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np
import pytest
from tests.hardware.sensors.frames import BOOT, DOWN, ENABLED, MODE_SET, MOVE, UP, touch

from frictus_hardware.errors import DeviceLostError
from frictus_hardware.nidaq.touch import TouchSensorSource
from frictus_hardware.sensors.hid import TouchLink
from frictus_hardware.sensors.neonode import Touchpad
from frictus_hardware.sensors.timing import TICKS_PER_S, WRAP

RATE_HZ = 20_000.0
LATENCY_S = 0.016


@dataclass
class FakePort:
    """Answers the requests; what else comes is put there."""

    coming: "queue.Queue[bytes]" = field(default_factory=queue.Queue)
    plugged: bool = True
    taken: bool = False

    def open(self) -> None:
        if not self.plugged:
            raise DeviceLostError("touch sensor cannot be opened: it is not plugged in")

    def send(self, data: bytes) -> None:
        self.coming.put(MODE_SET if data[8] == MODE_SET[8] else ENABLED)

    def receive(self, timeout_s: float) -> bytes:
        if self.taken:
            self.coming.task_done()  # what was read last has been dealt with
        self.taken = False
        if not self.plugged:
            raise DeviceLostError("touch sensor: read failed; plug it in again")
        try:
            data = self.coming.get(timeout=timeout_s)
        except queue.Empty:
            return b""
        self.taken = True
        return data

    def close(self) -> None:
        """Stay as it is."""


@dataclass
class Bench:
    port: FakePort
    source: TouchSensorSource
    now_s: float = 1_000.0
    sample: int = 0

    def tell(self, data: bytes) -> None:
        """Let bytes come, and wait until they are dealt with."""
        self.port.coming.put(data)
        self.port.coming.join()

    def block(self, n_samples: int = 100):  # type: ignore[no-untyped-def]
        """Let a block pass and return the reports that came in it."""
        self.now_s += n_samples / RATE_HZ
        first, self.sample = self.sample, self.sample + n_samples
        return self.source.arrived(first, n_samples)

    def until(self, holds: Callable[[], bool]) -> None:
        """Let time pass until something holds."""
        for _ in range(2_000):
            if holds():
                return
            self.now_s += 0.05
            self.source._stopping.wait(0.005)
        raise AssertionError("it never held")


@pytest.fixture
def bench() -> Iterator[Bench]:
    port = FakePort()

    def clock() -> float:
        return one.now_s

    def make_link(wait: Callable[[float], object]) -> TouchLink:
        return TouchLink(Touchpad(stale_s=0.1), port, clock, wait)

    one = Bench(port, TouchSensorSource(make_link, RATE_HZ, LATENCY_S, clock))
    one.source.start()
    port.coming.join()
    try:
        yield one
    finally:
        one.source.stop()


def test_a_report_is_of_the_sample_at_which_the_finger_was_there(bench: Bench) -> None:
    assert bench.source.health() is None
    assert bench.block() == ()
    bench.tell(touch(DOWN, 123))
    (report,) = bench.block()
    assert (report.x_mm, report.y_mm, report.in_contact) == (pytest.approx(12.3), 20.0, True)
    assert report.measured_sample == pytest.approx(100 - LATENCY_S * RATE_HZ, abs=0.1)
    bench.tell(touch(MOVE, 130))
    (report,) = bench.block()
    assert report.measured_sample == pytest.approx(200 - LATENCY_S * RATE_HZ, abs=0.1)


def test_what_holds_reports_up_does_not_move_the_finger_in_time(
    bench: Bench, rng: np.random.Generator
) -> None:
    made_s = 0.04 * np.arange(1, 51)
    held_s = rng.uniform(0.0, 0.03, made_s.size)
    off = []
    for made, held in zip(made_s, held_s, strict=True):
        assert bench.block(round((made + held) * RATE_HZ) - bench.sample) == ()
        ticks = round(made * TICKS_PER_S) % WRAP
        bench.tell(touch(MOVE, 100, ticks=ticks))
        (report,) = bench.block(20)
        off.append(report.measured_sample - (made - LATENCY_S) * RATE_HZ)
    # The report that was held up least places all after it; two clocks may drift, by 2e-4.
    least = RATE_HZ * np.minimum.accumulate(held_s)
    assert np.all(np.abs(np.array(off) - least) < 2e-4 * made_s[-1] * RATE_HZ + 2.0)


def test_a_sensor_that_was_set_up_again_counts_anew(bench: Bench) -> None:
    for restarted in (False, True):
        if restarted:
            bench.tell(BOOT)
            bench.block(2_000)
        bench.tell(touch(DOWN, 100, ticks=50_000 if restarted else 7))
        (report,) = bench.block(100)
        measured = bench.sample - 100 - LATENCY_S * RATE_HZ
        assert report.measured_sample == pytest.approx(measured, abs=0.1)


def test_a_sensor_that_sees_no_finger_is_told_to_see_none(bench: Bench) -> None:
    bench.tell(touch(DOWN, 100))
    bench.tell(touch(UP, 110))
    assert [report.in_contact for report in bench.block()] == [True, False]
    reports = [report for _ in range(100) for report in bench.block()]  # 0.5 s
    assert {report.in_contact for report in reports} == {False}
    assert 24 <= len(reports) <= 30


def test_a_finger_that_is_lost_is_not_told_of(bench: Bench) -> None:
    bench.tell(touch(DOWN, 100))
    bench.block()
    bench.until(lambda: bench.source.health() is not None)
    assert "no touch report" in str(bench.source.health())
    assert bench.block() == ()
    bench.tell(touch(MOVE, 100))
    assert bench.source.health() is None
    assert len(bench.block()) == 1


def test_unplugged_and_plugged_again(bench: Bench) -> None:
    bench.port.plugged = False
    bench.until(lambda: bench.source.health() is not None)
    assert "plug" in str(bench.source.health())
    bench.port.plugged = True
    bench.until(lambda: bench.source.health() is None)
    bench.tell(touch(DOWN, 100))
    assert [report.in_contact for report in bench.block()] == [True]


def test_a_bug_in_reading_is_the_sensors_trouble(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(timeout_s: float) -> bytes:
        raise ArithmeticError("what nobody thought of")

    monkeypatch.setattr(bench.port, "receive", broken)
    bench.until(lambda: bench.source.health() is not None)
    assert "ArithmeticError: what nobody thought of" in str(bench.source.health())


def test_it_begins_anew(bench: Bench) -> None:
    bench.tell(touch(DOWN, 100))
    bench.source.stop()
    bench.source.stop()
    bench.source.start()
    bench.port.coming.join()
    bench.sample = 0
    assert bench.block() == ()
    assert bench.source.health() is None

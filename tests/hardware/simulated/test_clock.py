"""Clocks: absolute deadlines, scale and skew."""

import pytest

from frictus_hardware.simulated.clock import RealClock, VirtualClock


class Machine:
    """A machine whose sleeps overshoot."""

    def __init__(self, overshoot_s: float) -> None:
        self.time_s = 1_000.0
        self.sleeps = 0
        self._overshoot_s = overshoot_s

    def now(self) -> float:
        return self.time_s

    def sleep(self, seconds: float) -> None:
        self.sleeps += 1
        self.time_s += seconds + self._overshoot_s


def test_lateness_does_not_add_up() -> None:
    machine = Machine(overshoot_s=2e-3)
    clock = RealClock(20_000.0, now=machine.now, sleep=machine.sleep)
    for block in range(1, 1_001):
        clock.wait_until(100 * block)
    assert machine.time_s - 1_000.0 == pytest.approx(5.0, abs=2.1e-3)
    assert machine.sleeps == 1_000


def test_does_not_sleep_when_late() -> None:
    machine = Machine(overshoot_s=0.0)
    clock = RealClock(20_000.0, now=machine.now, sleep=machine.sleep)
    machine.time_s += 1.0
    clock.wait_until(100)
    assert machine.sleeps == 0
    assert clock.sample() == 20_000


@pytest.mark.parametrize(("scale", "skew_ppm"), [(1.0, 50.0), (4.0, 0.0), (0.5, -50.0)])
def test_scale_and_skew(scale: float, skew_ppm: float) -> None:
    machine = Machine(overshoot_s=0.0)
    clock = RealClock(20_000.0, scale, skew_ppm, machine.now, machine.sleep)
    clock.start()
    machine.time_s += 1_000.0
    expected = 20_000_000.0 * scale * (1.0 + 1e-6 * skew_ppm)
    assert clock.sample() == pytest.approx(expected, abs=1.0)


def test_a_clock_starts_at_0() -> None:
    machine = Machine(overshoot_s=0.0)
    clock = RealClock(20_000.0, now=machine.now, sleep=machine.sleep)
    machine.time_s += 3.0
    clock.start()
    assert clock.sample() == 0


def test_the_virtual_clock_jumps_and_never_goes_back() -> None:
    clock = VirtualClock()
    clock.wait_until(500)
    clock.wait_until(100)
    assert clock.sample() == 500
    clock.start()
    assert clock.sample() == 0

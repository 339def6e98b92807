"""Stamps on LSL's clock: right, rising, and not to be led astray."""

from typing import Any

import numpy as np
import pytest

from frictus_service.bridges.lsl_clock import LslClock

UTC_NS = 1_795_000_000_000_000_000


class Clocks:
    """A UTC that is 1e9 s and something ahead of the local clock."""

    def __init__(self) -> None:
        self.local = 5.0
        self.ahead_ns = UTC_NS

    def local_s(self) -> float:
        self.local += 1e-6
        return self.local

    def utc_ns(self) -> int:
        self.local += 1e-6
        return self.ahead_ns + round(1e9 * self.local)


@pytest.fixture
def clocks() -> Clocks:
    return Clocks()


def test_a_sample_has_the_local_time_of_its_utc(clocks: Clocks, hand: Any) -> None:
    clock = LslClock(clocks.local_s, clocks.utc_ns)
    assert clock.run is None
    assert clock.begin(1, 400, UTC_NS + 2_000_000_000, 5e4)
    assert clock.stamp_s(1, 400) == pytest.approx(2.0, abs=1e-6)
    assert clock.stamp_s(1, 20_400) == pytest.approx(3.0, abs=1e-6)
    assert clock.local_s(clock.utc_of(7.25)) == pytest.approx(7.25, abs=1e-9)


def test_a_new_run_goes_on_whatever_utc_was_set_to(clocks: Clocks) -> None:
    clock = LslClock(clocks.local_s, clocks.utc_ns)
    clock.begin(1, 0, UTC_NS + 9_000_000_000, 5e4)
    last_s = clock.stamp_s(1, 1_000)
    assert clock.begin(2, 0, UTC_NS + 1_000_000_000, 5e4)
    assert clock.stamp_s(2, 0) > last_s


def test_fits_are_approached_and_stamps_rise(clocks: Clocks, hand: Any, rng: Any) -> None:
    hand.began_ns = UTC_NS
    clock = LslClock(clocks.local_s, clocks.utc_ns)
    stamps = []
    for sequence in range(2_000):
        if sequence % 100 == 0:
            error_ns = int(rng.integers(-28_000, 279_000))
            assert clock.follow(hand.fit(3, 100 * sequence, error_ns))
        stamps += [clock.stamp_s(3, 100 * sequence + n) for n in (0, 99)]
    assert np.all(np.diff(stamps) > 0.0)
    samples = np.add.outer(100 * np.arange(2_000), [0, 99]).ravel()
    assert np.max(np.abs(stamps - samples / 20_000.0)) < 4e-4


@pytest.mark.parametrize(
    ("sample", "ns_per_sample"), [(2**63, 5e4), (0, 0.0), (0, float("nan")), (0, 1e300)]
)
def test_what_no_clock_says_begins_no_run(
    clocks: Clocks, sample: int, ns_per_sample: float
) -> None:
    clock = LslClock(clocks.local_s, clocks.utc_ns)
    assert not clock.begin(1, sample, UTC_NS, ns_per_sample)
    assert clock.run is None


def test_a_leap_of_a_day_is_refused(clocks: Clocks) -> None:
    clock = LslClock(clocks.local_s, clocks.utc_ns)
    assert clock.begin(5, 100, UTC_NS, 5e4)
    assert not clock.begin(5, 20_000 * 86_401, UTC_NS, 5e4)


def test_the_runs_that_are_spoken_of_are_kept_whatever_their_numbers(clocks: Clocks) -> None:
    clock = LslClock(clocks.local_s, clocks.utc_ns)
    stamps = []
    for sample, run in enumerate((4, 2**32 - 1, 4, 2**32 - 2, 4)):
        assert clock.begin(run, sample, UTC_NS, 5e4)
        stamps.append(clock.stamp_s(run, sample))
    assert (clock.run, clock.knows(2**32 - 2), clock.knows(2**32 - 1)) == (4, True, False)
    assert np.all(np.diff(stamps) > 0.0)

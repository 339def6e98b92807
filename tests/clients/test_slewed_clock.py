"""Stamps that rise whatever the fits do, and come to the fit in the time that is said."""

import numpy as np

from frictus.slewed_clock import SLEW, SlewedClock

PERIOD_NS = 50_000.0
UTC_NS = 1_795_000_000_000_000_000


def test_without_a_new_fit_it_is_the_line() -> None:
    clock = SlewedClock(1_000, UTC_NS, PERIOD_NS)
    assert clock.time_of(1_000) == UTC_NS
    assert clock.time_of(21_000) == UTC_NS + 1_000_000_000


def test_stamps_rise_whatever_the_fits_say(rng: np.random.Generator) -> None:
    clock = SlewedClock(0, UTC_NS, PERIOD_NS)
    last, first = UTC_NS, 1
    for _ in range(500):
        n = int(rng.integers(1, 400))
        stamps = clock.time_ns(np.arange(first, first + n))
        assert stamps[0] > last
        assert np.all(np.diff(stamps) > 0)
        last, first = int(stamps[-1]), first + n
        if rng.random() < 0.3:
            fit_ns = UTC_NS + round(first * PERIOD_NS + rng.normal(0.0, 3e5))
            clock.approach(first, fit_ns, PERIOD_NS * (1.0 + rng.normal(0.0, 50e-6)))


def test_an_error_is_gone_after_it_was_slewed_and_no_further() -> None:
    for error_ns in (-279_000, 28_000):
        clock = SlewedClock(0, UTC_NS, PERIOD_NS)
        clock.time_of(20_000)
        clock.approach(20_000, UTC_NS + 1_000_000_000 - error_ns, PERIOD_NS)
        assert clock.error_ns == error_ns
        half = round(0.5 * abs(error_ns) / (SLEW * PERIOD_NS))
        off = [
            clock.time_of(20_000 + n) - (UTC_NS + round((20_000 + n) * PERIOD_NS) - error_ns)
            for n in (0, half, 2 * half, 100 * half)
        ]
        assert np.allclose(off, [error_ns, 0.5 * error_ns, 0.0, 0.0], atol=60.0)


def test_what_was_told_is_told_again() -> None:
    clock = SlewedClock(0, UTC_NS, PERIOD_NS)
    samples = np.arange(0, 10_000, 100)
    before = clock.time_ns(samples)
    clock.approach(10_000, UTC_NS + 500_300_000, PERIOD_NS)
    clock.time_of(12_000)
    clock.approach(12_000, UTC_NS + 599_900_000, PERIOD_NS)
    assert [clock.time_of(sample) for sample in samples.tolist()] == before.tolist()
    # A stream that lags behind the others has the stamps that they have.
    assert np.array_equal(clock.time_ns(samples), before)

"""The 16-bit counter: wraps, losses, late arrivals, restarts."""

import itertools

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from frictus_hardware.sensors.timing import TICKS_PER_S, WRAP, Instant, unwrapped

gaps_s = st.lists(st.floats(0.001, 30.0), min_size=1, max_size=30)
jitters_s = st.lists(st.floats(0.0, 0.1), min_size=31, max_size=31)


@settings(max_examples=30)
@given(gaps_s, jitters_s, st.integers(0, WRAP - 1), st.floats(0.0, 1e6))
def test_time_is_that_of_the_sensor_over_any_losses(
    gaps: list[float], jitters: list[float], start: int, arrival_s: float
) -> None:
    made_s = [0.0, *itertools.accumulate(gaps)]
    instant: Instant | None = None
    for time_s, jitter_s in zip(made_s, jitters, strict=False):
        ticks = (start + round(time_s * TICKS_PER_S)) % WRAP
        instant = unwrapped(instant, ticks, arrival_s + time_s + jitter_s)
        assert not instant.jumped
        assert instant.time_s == pytest.approx(time_s, abs=1.0 / TICKS_PER_S)


def test_reports_held_up_together_keep_their_own_times() -> None:
    first = unwrapped(None, 65000, 10.0)
    second = unwrapped(first, (65000 + 328) % WRAP, 10.05)
    third = unwrapped(second, (65000 + 656) % WRAP, 10.05)
    assert [second.time_s, third.time_s] == pytest.approx([0.01, 0.02], abs=1e-4)


@pytest.mark.parametrize("ticks", [100 + 32768, 100 + 16384, 60000])
def test_a_jump_is_told_and_time_goes_on_by_the_arrival(ticks: int) -> None:
    first = unwrapped(None, 100, 5.0)
    jumped = unwrapped(first, ticks, 5.01)
    assert jumped.jumped
    assert jumped.time_s == pytest.approx(0.01)
    after = unwrapped(jumped, (ticks + 328) % WRAP, 5.02)
    assert not after.jumped
    assert after.time_s == pytest.approx(0.02, abs=1e-4)

"""A process that helps to measure is waited for as long as it gets on."""

from multiprocessing.connection import Connection

import pytest

from frictus_laboratory.benchmarks.lateness import compute
from frictus_laboratory.benchmarks.processes import _await_word, neighbour, used_s
from frictus_service.daemon.processes.child_process import StartProgress
from frictus_service.errors import StartError


def test_who_computes_may_take_as_long_as_it_likes() -> None:
    clock_s, words = [0.0], iter([False] * 500 + [True])

    def has_come(seconds: float) -> bool:
        clock_s[0] += seconds
        return next(words)

    _await_word(has_come, lambda: clock_s[0] // 20.0, StartProgress(lambda: clock_s[0]), 60.0)
    assert clock_s[0] > 500.0


def test_who_stands_still_is_given_up() -> None:
    clock_s = [0.0]

    def has_come(seconds: float) -> bool:
        clock_s[0] += seconds
        return False

    with pytest.raises(StartError, match="stood still for 60 s"):
        _await_word(
            has_come, lambda: min(clock_s[0], 30.0), StartProgress(lambda: clock_s[0]), 60.0
        )
    assert clock_s[0] == pytest.approx(90.0, abs=2.0)


def test_the_processor_time_of_a_neighbour_is_known() -> None:
    with neighbour(compute) as other:
        assert used_s(other.pid) > 0.0


def test_one_that_ends_is_told_at_once() -> None:
    with pytest.raises(StartError, match="has ended"), neighbour(Connection.close):
        pass

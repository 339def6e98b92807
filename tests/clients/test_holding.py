"""What is open is closed with the client, whatever fails of it."""

import sys
from concurrent.futures import ThreadPoolExecutor

import pytest

from frictus.closing import Held, close_all
from frictus.errors import LinkError


class Thing:
    def __init__(self, error: BaseException | None = None) -> None:
        self.closed = False
        self._error = error

    def close(self) -> None:
        self.closed = True
        if self._error is not None:
            raise self._error


def test_all_are_closed_though_the_link_is_gone() -> None:
    held = Held()
    things = [held.keep(thing) for thing in (Thing(), Thing(LinkError("gone")), Thing())]
    held.close()
    assert all(thing.closed for thing in things)


def test_what_is_not_expected_is_told_once_all_are_closed() -> None:
    things = [Thing(), Thing(ZeroDivisionError()), Thing()]
    with pytest.raises(ZeroDivisionError):
        close_all([thing.close for thing in things])
    assert all(thing.closed for thing in things)


def test_what_was_closed_is_let_go_of() -> None:
    held, first = Held(), Thing()
    held.keep(first).close()
    held.keep(Thing())
    first.closed = False
    held.close()
    assert not first.closed


def test_what_threads_open_at_the_same_time_is_all_closed() -> None:
    held = Held()
    interval_s = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        with ThreadPoolExecutor(8) as pool:
            parts = list(pool.map(lambda _: [held.keep(Thing()) for _ in range(100)], range(8)))
    finally:
        sys.setswitchinterval(interval_s)
    held.close()
    assert all(thing.closed for part in parts for thing in part)

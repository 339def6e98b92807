"""What is open is closed with the client, whatever fails of it."""

import pytest

from frictus.errors import LinkError
from frictus.readings import Held, close_all


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

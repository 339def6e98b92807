"""What is open until it is closed, and what is held open for a client and closed with it."""

import contextlib
import threading
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import Protocol, Self, TypeVar


class Closing(ABC):
    """Closed at the end of a with statement, whatever happened."""

    @abstractmethod
    def close(self) -> None:
        """Release it."""

    def __enter__(self) -> Self:
        """Return self."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close."""
        self.close()


class Closable(Protocol):
    """What a client closes with itself."""

    @property
    def closed(self) -> bool:
        """Whether that was done already."""
        ...

    def close(self) -> None:
        """Release it."""
        ...


C = TypeVar("C", bound=Closable)


class Held:
    """Feeds and streams that are open; those that were closed are let go of. For any thread."""

    def __init__(self) -> None:
        self._changing = threading.Lock()
        self._open: list[Closable] = []

    def keep(self, closable: C) -> C:
        """Hold something until `close`, and return it.

        Parameters
        ----------
        closable : Closable
            Closed with the holder, newest first.
        """
        with self._changing:
            self._open = [other for other in self._open if not other.closed] + [closable]
        return closable

    def close(self) -> None:
        """Close everything, whatever fails of it. Closing twice is harmless."""
        with self._changing:
            closables, self._open = self._open, []
        close_all([closable.close for closable in closables])


def close_all(closes: Sequence[Callable[[], None]]) -> None:
    """Close everything in order, whatever fails of it.

    The session goes next, and with it the lease: the rig ramps to zero by itself.

    Parameters
    ----------
    closes : sequence of callable
        Each takes nothing.
    """
    with contextlib.ExitStack() as all_of_them:
        for close in reversed(closes):
            all_of_them.callback(_quietly, close)


def _quietly(close: Callable[[], None]) -> None:
    with contextlib.suppress(RuntimeError, LookupError, ConnectionError):
        close()

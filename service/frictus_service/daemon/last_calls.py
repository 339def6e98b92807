"""Who changed what: in the status of a rig no change is seen without its author."""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from frictus.messages import LastCall


class LastCalls:
    """The last call of each name that was accepted, or is being carried out.

    Parameters
    ----------
    utc_ns : callable
        Clock.
    """

    def __init__(self, utc_ns: Callable[[], int]) -> None:
        self._utc_ns = utc_ns
        self._lock = threading.Lock()
        self._accepted: dict[str, LastCall] = {}
        self._under_way: dict[str, list[LastCall]] = {}

    @contextmanager
    def noted(self, name: str, client: str) -> Iterator[None]:
        """Note a call while it is carried out, and afterwards unless it is refused.

        Whoever publishes in between sees what it has changed, and whose it is.
        """
        call = LastCall(client=client, utc_ns=self._utc_ns())
        with self._lock:
            under_way = self._under_way.setdefault(name, [])
            under_way.append(call)
        try:
            yield
            with self._lock:
                self._accepted[name] = call
        finally:
            with self._lock:
                under_way.remove(call)

    def by_name(self) -> dict[str, LastCall]:
        """Return the calls by their names."""
        with self._lock:
            newest = {name: calls[-1] for name, calls in self._under_way.items() if calls}
            return self._accepted | newest

"""Who changed what: in the status of a rig no change is seen without its author."""

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
        self._calls: dict[str, LastCall] = {}

    @contextmanager
    def noted(self, name: str, client: str) -> Iterator[None]:
        """Note a call while it is carried out, and afterwards unless it is refused.

        Whoever publishes in between sees what it has changed, and whose it is.
        """
        before = self._calls.get(name)
        self._calls[name] = LastCall(client=client, utc_ns=self._utc_ns())
        try:
            yield
        except BaseException:
            del self._calls[name]
            if before is not None:
                self._calls[name] = before
            raise

    def by_name(self) -> dict[str, LastCall]:
        """Return the calls by their names."""
        return self._calls.copy()

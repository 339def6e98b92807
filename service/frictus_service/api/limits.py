"""How much is done at once, and for one client: what comes beyond is told to come again."""

import asyncio
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Final

from starlette.types import ASGIApp, Receive, Scope, Send

from frictus_service.api.problems import BusyError, TooOftenError

MAX_STREAMS: Final = 100
"""Streams of events at once; each is looked at five times a second."""
MAX_BODY_BYTES: Final = 64_000_000
"""Bodies in memory at once, all together."""
LARGE_BYTES: Final = 1_000_000
MAX_LARGE: Final = 2
"""Bodies beyond `LARGE_BYTES` that are parsed at once; others wait."""
BURST_S: Final = 2.0
CLIENTS: Final = 10_000


class Places:
    """Places for what is done at once, in one event loop.

    Parameters
    ----------
    most : int
        How many there are.
    what : str
        What they are for.
    """

    def __init__(self, most: int, what: str) -> None:
        self._most = most
        self._what = what
        self._taken = 0

    @contextmanager
    def held(self, count: int = 1) -> Iterator[None]:
        """Hold places within the block.

        Raises
        ------
        BusyError
            If there are not so many left.
        """
        if self._taken + count > self._most:
            raise BusyError(f"at most {self._most} {self._what} at once: try again later")
        self._taken += count
        try:
            yield
        finally:
            self._taken -= count


class RequestLimits:
    """What one API does at once."""

    def __init__(self) -> None:
        self.streams = Places(MAX_STREAMS, "streams of events")
        self.bodies = Places(MAX_BODY_BYTES, "bytes of bodies")
        self.large = asyncio.Semaphore(MAX_LARGE)


class Rate:
    """ASGI middleware: a bound on the requests of each client address.

    Parameters
    ----------
    app : ASGIApp
        What is behind it.
    per_s : float
        Requests per second in the long run; twice as many may come at once.
    now_s : callable
        Clock.
    """

    def __init__(
        self, app: ASGIApp, per_s: float, now_s: Callable[[], float] = time.monotonic
    ) -> None:
        self._app = app
        self._per_s = per_s
        self._now_s = now_s
        self._idle_s: dict[str, float] = {}
        """When each client will have its whole burst again; who is not here has it."""

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on, or answer it with 429."""
        if scope["type"] != "lifespan" and not self._allows((scope.get("client") or ("",))[0]):
            error = TooOftenError(
                f"at most {self._per_s:g} requests per second are answered to one address",
                headers={"Retry-After": "1"},
            )
            await error.response(scope["path"])(scope, receive, send)
        else:
            await self._app(scope, receive, send)

    def _allows(self, client: str) -> bool:
        now_s = self._now_s()
        if len(self._idle_s) > CLIENTS:
            self._idle_s = {who: at for who, at in self._idle_s.items() if at > now_s}
        idle_s = max(self._idle_s.get(client, now_s), now_s) + 1.0 / self._per_s
        if idle_s - now_s > BURST_S:
            return False
        self._idle_s[client] = idle_s
        return True

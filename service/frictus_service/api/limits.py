"""What is refused or ended before any path is looked at: too much, too slow, from elsewhere.

A connection costs memory and a descriptor. uvicorn ends those that are idle between two
requests; not those that never send a whole head, nor those that do not take their answer: here
they end.

A page of another origin can send simple requests to 127.0.0.1, and with a DNS name that it
rebinds to 127.0.0.1 it can even read the answers. So a server bound to loopback answers only
to loopback names, and no request that changes something may come from another origin; nor may
a WebSocket, which browsers let any page open and read.
"""

import asyncio
import threading
import time
from collections import Counter
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from typing import Any, Final
from urllib.parse import urlsplit

import anyio
import h11
from starlette.datastructures import Headers
from starlette.requests import Request
from starlette.types import ASGIApp, Receive, Scope, Send
from uvicorn.protocols.http.h11_impl import H11Protocol

from frictus_service.api.access import is_loopback
from frictus_service.api.problems import (
    ApiError,
    BusyError,
    CrossOriginError,
    HttpError,
    TooOftenError,
    WrongHostError,
)

MAX_STREAMS: Final = 100
"""Streams of events at once; each is looked at five times a second."""
MAX_BODY_BYTES: Final = 64_000_000
"""Bodies in memory at once, all together."""
LARGE_BYTES: Final = 1_000_000
MAX_LARGE: Final = 2
"""Bodies beyond `LARGE_BYTES` that are parsed at once; others wait."""
MAX_UPLOADS: Final = 2
"""Studies that come at once."""
MAX_COURSES: Final = 8
"""Recordings of which the course is read at once; each takes about a second."""
MAX_EXPORTS: Final = 4
"""Recordings that are exported, and sent, at once: each is a file on the disk until then."""
MAX_STOPS: Final = 64
"""Rigs that are stopped at once, in threads of their own: no stop waits for other requests."""
BURST_S: Final = 2.0
CLIENTS: Final = 10_000


class Places:
    """Places for what is done at once, by any thread; no holder takes more than half.

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
        self._taken: Counter[str] = Counter()
        self._changing = threading.Lock()

    @contextmanager
    def held(self, holder: str, count: int = 1) -> Iterator[None]:
        """Hold places within the block.

        Parameters
        ----------
        holder : str
            Whose they are.
        count : int
            How many.

        Raises
        ------
        BusyError
            If there are not so many left, or the holder has some and would have more than half.
        """
        with self._changing:
            self._check(holder, count)
            self._taken[holder] += count
        try:
            yield
        finally:
            with self._changing:
                self._taken[holder] -= count
                self._taken = +self._taken  # who holds none is forgotten

    def _check(self, holder: str, count: int) -> None:
        taken = self._taken.get(holder, 0)
        if taken and 2 * (taken + count) > self._most:
            raise BusyError(
                f"you hold {taken} of the {self._most} {self._what}, and nobody holds more "
                "than half: try again later"
            )
        if self._taken.total() + count > self._most:
            raise BusyError(f"at most {self._most} {self._what} at once: try again later")


class RequestLimits:
    """What one API does at once."""

    def __init__(self) -> None:
        self.streams = Places(MAX_STREAMS, "streams of events")
        self.bodies = Places(MAX_BODY_BYTES, "bytes of bodies")
        self.uploads = Places(MAX_UPLOADS, "studies that are sent")
        self.courses = Places(MAX_COURSES, "recordings that are read")
        self.exports = Places(MAX_EXPORTS, "recordings that are exported")
        self.large = asyncio.Semaphore(MAX_LARGE)
        self.stops = anyio.CapacityLimiter(MAX_STOPS)


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


class Pace:
    """How fast one connection is read: whoever sends more waits for it, and nobody else.

    Parameters
    ----------
    per_s : float
        What may come per second in the long run.
    burst : float
        What may come at once.
    now_s : callable
        Clock.
    """

    def __init__(
        self, per_s: float, burst: float, now_s: Callable[[], float] = time.monotonic
    ) -> None:
        self._per_s = per_s
        self._burst_s = burst / per_s
        self._now_s = now_s
        self._idle_s = now_s()

    def wait_s(self, cost: float) -> float:
        """Return for how long no more is to be read.

        Parameters
        ----------
        cost : float
            Of what has come.
        """
        now_s = self._now_s()
        self._idle_s = max(self._idle_s, now_s) + cost / self._per_s
        return max(0.0, self._idle_s - now_s - self._burst_s)


HEAD_S: Final = 10.0
"""For the head of a request: since the connection began, or since the answer before."""
TAKE_S: Final = 30.0
"""A client that takes nothing of its answer for so long has its connection cut."""
HEAD_BYTES: Final = 16_384
"""Longest head: request line and headers."""
_TOO_MANY: Final = (
    b"HTTP/1.1 503 Service Unavailable\r\nContent-Type: text/plain\r\nConnection: close\r\n"
    b"Content-Length: 70\r\n\r\n"
    b"your address has half of all connections: end some, or try again later"
)
"""To an address that has half of all connections: the others are for everybody else."""


class PatientProtocol(H11Protocol):
    """uvicorn's HTTP, with deadlines for heads and for answers; bodies have their own."""

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self._head_due: asyncio.TimerHandle | None = None
        self._take_due: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Begin, unless too many connections are of this address; the first head is due."""
        super().connection_made(transport)
        addresses = [(getattr(each, "client", None) or ("",))[0] for each in self.connections]
        held = addresses.count((self.client or ("",))[0])
        if self.limit_concurrency is not None and 2 * held > self.limit_concurrency:
            transport.write(_TOO_MANY)
            transport.close()
        else:
            self._await_head()

    def on_response_complete(self) -> None:
        """Go on with the next request, whose head is due from now."""
        super().on_response_complete()
        self._await_head()

    def send_400_response(self, msg: str) -> None:
        """Refuse what is not HTTP as every other error is told, and end."""
        if self.conn.our_state in (h11.IDLE, h11.SEND_RESPONSE):
            accepted = "accepted: HTTP/1.1, one Host header, a path that is percent-encoded"
            refusal = HttpError(f"{msg} {accepted}").response("")
            head = [*refusal.raw_headers, (b"connection", b"close")]
            for event in (
                h11.Response(
                    status_code=refusal.status_code, headers=head, reason=b"Bad Request"
                ),
                h11.Data(data=bytes(refusal.body)),
                h11.EndOfMessage(),
            ):
                self.transport.write(self.conn.send(event))
        self.transport.close()

    def handle_websocket_upgrade(self, event: h11.Request) -> None:
        """Hand the connection over; the WebSocket has deadlines of its own."""
        self._cancel()
        super().handle_websocket_upgrade(event)

    def connection_lost(self, exc: Exception | None) -> None:
        """End."""
        self._cancel()
        super().connection_lost(exc)

    def handle_events(self) -> None:
        """Read on, and begin what was asked; not while the answer before it is not taken.

        uvicorn would do the whole work of the next request before it waits.
        """
        if self.flow.write_paused:
            self.flow.pause_reading()
        else:
            super().handle_events()

    def pause_writing(self) -> None:
        """Stop sending: the client does not take what was sent."""
        super().pause_writing()
        self._take_due = self.loop.call_later(TAKE_S, self.transport.abort)

    def resume_writing(self) -> None:
        """Go on: it does."""
        if self._take_due is not None:
            self._take_due.cancel()
        super().resume_writing()
        self.flow.resume_reading()
        self.handle_events()

    def _await_head(self) -> None:
        if self._head_due is not None:
            self._head_due.cancel()
        self._head_due = self.loop.call_later(HEAD_S, self._end_if_nothing_was_asked)

    def _end_if_nothing_was_asked(self) -> None:
        if self.cycle is None or self.cycle.response_complete:
            self.transport.abort()

    def _cancel(self) -> None:
        for due in (self._head_due, self._take_due):
            if due is not None:
                due.cancel()


_SAFE: Final = frozenset({"GET", "HEAD", "OPTIONS"})


class OriginCheck:
    """ASGI middleware; see the module.

    Parameters
    ----------
    app : ASGIApp
        What is behind it.
    loopback_only : bool
        The server is bound to loopback: check the Host header.
    allowed : collection of str
        Other origins whose pages may open a WebSocket; requests they may not make.
    """

    def __init__(
        self, app: ASGIApp, loopback_only: bool, allowed: Collection[str] = ()
    ) -> None:
        self._app = app
        self._loopback_only = loopback_only
        self._allowed = frozenset(allowed)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on, or answer it with the reason why not."""
        if scope["type"] != "lifespan" and (error := self._refusal(scope)):
            await error.response(scope["path"])(scope, receive, send)
        else:
            await self._app(scope, receive, send)

    def _refusal(self, scope: Scope) -> ApiError | None:
        headers = Headers(scope=scope)
        host = headers.get("host", "")
        if self._loopback_only and not is_loopback(_name(host)):
            return WrongHostError(
                f"Host {host[:100]!r}: this server answers to localhost and 127.0.0.1 only"
            )
        origin = headers.get("origin")
        does = "connect" if scope["type"] == "websocket" else scope["method"]
        if does == "connect" and origin in self._allowed:
            return None
        if origin is not None and does not in _SAFE and _netloc(origin) != host:
            return CrossOriginError(
                f"Origin {origin[:100]!r} is not this server: pages of other origins may not "
                f"{does}"
            )
        return None


def address_of(request: Request) -> str:
    """Return from where a request comes: by it places are held."""
    return request.client.host if request.client else ""


def _name(host: str) -> str:
    try:
        return urlsplit(f"//{host}").hostname or ""
    except ValueError:
        return ""


def _netloc(origin: str) -> str:
    try:
        return urlsplit(origin).netloc
    except ValueError:
        return ""

"""The events of a job as a stream, until it runs no more."""

import logging
from collections.abc import AsyncIterator, Callable, Sequence
from typing import Annotated, Final, Protocol

import anyio
from fastapi import Depends, Header, Request
from fastapi.concurrency import run_in_threadpool
from fastapi.sse import ServerSentEvent
from starlette.types import ASGIApp, Receive, Scope, Send

from frictus_service.api.access import needs
from frictus_service.api.limits import RequestLimits

_LOG: Final = logging.getLogger(__name__)
LOOK_S: Final = 0.2
"""How often a stream of events looks for more."""
LastEventId = Annotated[int, Header(ge=0, le=2**31 - 1, description="Begin behind this event")]
"""What a client that comes back has heard already."""


class Event(Protocol):
    """One thing that a job told."""

    @property
    def number(self) -> int:
        """From 1, without gaps."""

    @property
    def kind(self) -> str:
        """``state`` or ``progress``."""

    @property
    def data(self) -> str:
        """JSON."""


class Departures:
    """ASGI middleware: a client that leaves its stream of events is no fault of the server.

    FastAPI then raises what its keep-alive met, an end of its own stream.

    Parameters
    ----------
    app : ASGIApp
        What is behind it.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve a request until its client has all of the answer, or has left."""
        try:
            await self._app(scope, receive, send)
        except* anyio.BrokenResourceError:
            _LOG.info("%s: its client left", scope["path"])


async def place(
    request: Request, person: Annotated[str, Depends(needs("read"))]
) -> AsyncIterator[None]:
    """Hold one of the places for streams of events while a request is served; a dependency."""
    limits: RequestLimits = request.app.state.limits
    with limits.streams.held(person):
        yield


async def follow(
    active: Callable[[], bool],
    events: Callable[[int], Sequence[Event]],
    closing: Callable[[], bool],
    after: int,
) -> AsyncIterator[ServerSentEvent]:
    """Yield what a job tells, from the event behind `after` until it runs no more.

    Parameters
    ----------
    active : callable
        Whether the job is queued or runs.
    events : callable
        What it told after an event.
    closing : callable
        Whether the API is about to end.
    after : int
        Number of the last event that is known; 0: from the beginning.
    """

    def look(after: int) -> tuple[bool, Sequence[Event]]:
        # First the state: what was told before it changed is then among the events.
        return active(), events(after)

    while not closing():
        still, told = await run_in_threadpool(look, after)
        for event in told:
            yield ServerSentEvent(raw_data=event.data, event=event.kind, id=str(event.number))
            after = event.number
        if not told:
            if not still:
                return
            await anyio.sleep(LOOK_S)

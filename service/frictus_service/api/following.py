"""The events of a job as a stream, until it runs no more."""

from collections.abc import AsyncIterator, Callable, Sequence
from typing import Final, Protocol

import anyio
from fastapi import Request
from fastapi.concurrency import run_in_threadpool
from fastapi.sse import ServerSentEvent

from frictus_service.api.limits import Limits

LOOK_S: Final = 0.2
"""How often a stream of events looks for more."""


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


async def place(request: Request) -> AsyncIterator[None]:
    """Hold one of the places for streams of events while a request is served; a dependency."""
    limits: Limits = request.app.state.limits
    with limits.streams.held():
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

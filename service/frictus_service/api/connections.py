"""HTTP connections that end when their client neither asks nor takes what it asked for.

A connection costs memory and a descriptor. uvicorn ends those that are idle between two
requests; not those that never send a whole head, nor those that do not take their answer.
"""

import asyncio
from typing import Any, Final

import h11
from uvicorn.protocols.http.h11_impl import H11Protocol

HEAD_S: Final = 10.0
"""For the head of a request: since the connection began, or since the answer before."""
TAKE_S: Final = 30.0
"""A client that takes nothing of its answer for so long has its connection cut."""
HEAD_BYTES: Final = 16_384
"""Longest head: request line and headers."""


class PatientProtocol(H11Protocol):
    """uvicorn's HTTP, with deadlines for heads and for answers; bodies have their own."""

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self._head_due: asyncio.TimerHandle | None = None
        self._take_due: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Begin; the first head is due."""
        super().connection_made(transport)
        self._await_head()

    def on_response_complete(self) -> None:
        """Go on with the next request, whose head is due from now."""
        super().on_response_complete()
        self._await_head()

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

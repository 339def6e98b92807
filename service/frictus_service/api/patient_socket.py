"""WebSockets that end when their peer floods them with frames, or does not take what it gets.

uvicorn answers every ping whether or not its answers are taken, gathers any number of empty
fragments, and waits for ever for a peer that does not take the rest of what it was sent.
"""

import asyncio
import logging
from typing import Any, Final

from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
from websockets.frames import Frame

from frictus_service.api import limits
from frictus_service.api.limits import Pace

FRAMES_PER_S: Final = 2_000.0
"""Of frames that complete no message: pings, pongs and fragments."""
BURST: Final = 1_000
SLICE_BYTES: Final = 4_096
"""Read at once: up to 700 frames, before those who come after them are served."""
_LOG: Final = logging.getLogger(__name__)


class PatientSocket(WebSocketsSansIOProtocol):
    """uvicorn's WebSocket, with bounds on frames beside messages, and on what is untaken."""

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self._frames_pace = Pace(FRAMES_PER_S, BURST)
        self._end_due: asyncio.TimerHandle | None = None

    def data_received(self, data: bytes) -> None:
        """Read a slice at a time, until one of them ends the connection."""
        for start in range(0, len(data), SLICE_BYTES):
            if self.transport.is_closing():
                return
            super().data_received(data[start : start + SLICE_BYTES])

    def handle_ping(self) -> None:
        """Answer, unless answers are not taken: nothing is kept for who reads nothing."""
        if self.writable.is_set():
            super().handle_ping()
        else:
            self.conn.data_to_send()
        self._count_frame()

    def handle_pong(self, event: Frame) -> None:
        """Take note of it."""
        super().handle_pong(event)
        self._count_frame()

    def handle_cont(self, event: Frame) -> None:
        """Gather a fragment."""
        super().handle_cont(event)
        self._count_frame()

    def send_receive_event_to_app(self) -> None:
        """Hand a message over; what comes after the end is dropped, and counted."""
        super().send_receive_event_to_app()
        if self.close_sent:
            self._count_frame()

    async def send(self, message: Any) -> None:
        """Send what the app says; a page that it refused has been answered."""
        await super().send(message)
        if message["type"] == "websocket.http.response.body" and self.close_sent:
            # Else uvicorn logs an error of the app: each refused page would write one.
            self.handshake_complete = True

    def keepalive_timeout(self) -> None:
        """End, for the peer does not answer."""
        super().keepalive_timeout()
        self._end_soon()

    def on_task_complete(self, task: asyncio.Task[None]) -> None:
        """End, for all has been said: the peer may take it, but not for ever."""
        super().on_task_complete(task)
        self._end_soon()

    def connection_lost(self, exc: Exception | None) -> None:
        """Have ended."""
        if self._end_due is not None:
            self._end_due.cancel()
        super().connection_lost(exc)

    def _count_frame(self) -> None:
        if self._frames_pace.wait_s(1.0) > 0.0 and not self.transport.is_closing():
            _LOG.warning(
                "a page sent more than %g frames per second that are no messages: its "
                "connection is ended",
                FRAMES_PER_S,
            )
            self.transport.abort()

    def _end_soon(self) -> None:
        if self._end_due is None and not self.disconnected:
            self._end_due = self.loop.call_later(limits.TAKE_S, self.transport.abort)

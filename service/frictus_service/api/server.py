"""The API process: serves until it is told to stop."""

import contextlib
import socket
from collections.abc import Callable
from typing import Final

import uvicorn

from frictus_service.api.app import build_app
from frictus_service.api.connections import HEAD_BYTES, PatientProtocol
from frictus_service.api.dashboard.messages import MAX_BYTES
from frictus_service.config import Config
from frictus_service.errors import StartError
from frictus_service.signals import ReadySignal, StopSignal

GRACE_S: Final = 3
SEND_BYTES: Final = 262_144
"""What the kernel keeps of answers that a client does not take; Linux would keep megabytes."""


class _Server(uvicorn.Server):
    """Tells when it listens, stops when it is told to, and leaves signals to its caller."""

    def __init__(
        self,
        config: uvicorn.Config,
        stop: StopSignal,
        ready: ReadySignal,
        ending: Callable[[], None],
    ) -> None:
        super().__init__(config)
        self._ending = ending
        self._stop = stop
        self._ready = ready

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        await super().startup(sockets)
        if self.started:
            self._ready.set()

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        self._ending()  # streams of events would hold the end up
        await super().shutdown(sockets)

    async def on_tick(self, counter: int) -> bool:
        return await super().on_tick(counter) or self._stop.is_set()

    def capture_signals(self) -> contextlib.AbstractContextManager[None]:  # type: ignore[override]
        return contextlib.nullcontext()


def listen(host: str, port: int) -> socket.socket:
    """Return a socket that listens at `host`; port 0 takes any free one.

    Raises
    ------
    StartError
        If nothing can listen there.
    """
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    try:
        listener = socket.create_server((host, port), family=family)
        # Connections inherit it. With Nagle's algorithm each answer on a connection that is
        # kept open would wait 40 ms for the client's acknowledgement.
        listener.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BYTES)
        return listener
    except OSError as error:
        raise StartError(
            f"the API cannot listen at {host}:{port}: {error}. If another server runs there, "
            "give `port` in [api] of the configuration another number"
        ) from error


def run_api(config: Config, stop: StopSignal, ready: ReadySignal) -> None:
    """Serve the API until `stop` is set, then end cleanly, with the requests under way.

    Parameters
    ----------
    config : Config
        The whole configuration.
    stop : Event
        Looked at ten times a second.
    ready : Event
        Set as soon as connections are accepted.

    Raises
    ------
    StartError
        If nothing can listen at the configured address.
    """
    with listen(config.api.host, config.api.port) as listener:
        app = build_app(config)
        settings = uvicorn.Config(
            app,
            log_level="warning",
            access_log=False,
            server_header=False,
            http=PatientProtocol,
            h11_max_incomplete_event_size=HEAD_BYTES,
            limit_concurrency=config.api.max_connections,
            timeout_graceful_shutdown=GRACE_S,
            ws_max_size=MAX_BYTES,
            ws_per_message_deflate=False,  # samples hardly shrink, and it costs a core
        )
        _Server(settings, stop, ready, app.state.services.jobs.stop).run(sockets=[listener])

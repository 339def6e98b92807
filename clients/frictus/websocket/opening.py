"""Opening a connection: the handshake, hello and welcome."""

import asyncio
import contextlib
import json
import ssl
from collections.abc import AsyncIterator, Callable
from typing import TYPE_CHECKING, Any, Final

from frictus.errors import ArgumentError, FrictusError, LinkError, RefusedError
from frictus.websocket.connection import Connection, Heard, why_closed
from frictus.websocket.messages import MAX_TOKEN, Refused, Welcome

if TYPE_CHECKING:
    from websockets.asyncio.client import ClientConnection

PATH: Final = "/v1/live"
INSTALL: Final = "pip install 'frictus[websocket]'"
MINOR: Final = 1
"""The protocol must be 1.1 or a later 1.x."""
OPEN_S: Final = 5.0
CLOSE_S: Final = 2.0
MAX_TOLD_BYTES: Final = 64 << 20
"""Of one message of the service: a scene of 32 regions with maps has tens of megabytes."""


@contextlib.asynccontextmanager
async def opened(
    url: str,
    token: str | None,
    tls: ssl.SSLContext | None,
    hear: Callable[[Heard], None],
    on_end: Callable[[LinkError], None],
) -> AsyncIterator[Connection]:
    """Open a connection for a block of code.

    Parameters
    ----------
    url : str
        Of the service, ``ws://`` or ``wss://``, without a path.
    token : str or None
        Of the configuration; None where it has none.
    tls : ssl.SSLContext or None
        For ``wss://``; None: the certificates that this machine trusts.
    hear, on_end : callable
        See `Connection`.

    Raises
    ------
    ImportError
        If the package `websockets` is not installed.
    RefusedError
        If the token is not accepted.
    LinkError
        If no service of this protocol answers there.
    """
    try:
        from websockets.asyncio.client import connect
        from websockets.exceptions import WebSocketException
    except ImportError as error:
        raise ImportError(
            f"frictus.websocket needs the package websockets: {INSTALL}"
        ) from error
    options: dict[str, Any] = {} if tls is None else {"ssl": tls}
    try:
        socket = await connect(
            url.rstrip("/") + PATH,
            compression=None,
            max_size=MAX_TOLD_BYTES,
            ping_interval=None,
            open_timeout=OPEN_S,
            close_timeout=CLOSE_S,
            **options,
        )
    except (OSError, TimeoutError, WebSocketException) as error:
        told = str(error) or type(error).__name__
        raise LinkError(f"no connection to {url}: {told}; is the service there?") from error
    try:
        connection = Connection(socket, await _welcomed(socket, url, token), hear, on_end)
        try:
            yield connection
        finally:
            await connection.close()
    finally:
        await socket.close()


async def _welcomed(socket: "ClientConnection", url: str, token: str | None) -> Welcome:
    from websockets.exceptions import ConnectionClosed

    if token is not None and len(token) > MAX_TOKEN:
        raise ArgumentError(f"a token has at most {MAX_TOKEN} characters")
    try:
        async with asyncio.timeout(OPEN_S):
            await socket.send(json.dumps({"op": "hello", "version": 1, "token": token}))
            told = json.loads(await socket.recv())
        if told.get("op") == "refused":
            refused = Refused.model_validate(told)
            raise RefusedError(refused.code, refused.message)
        protocol = str(told.get("protocol", "1.0"))
        major, minor = (int(part) for part in protocol.split(".")[:2])
        if told.get("op") == "welcome" and (major != 1 or minor < MINOR):
            raise LinkError(f"{url} speaks {protocol} and this client 1.{MINOR}: update it")
        return Welcome.model_validate(told)
    except ConnectionClosed as error:
        raise LinkError(f"{url} closed the connection: {why_closed(error)}") from None
    except TimeoutError:
        raise LinkError(f"{url} did not answer within {OPEN_S:g} s") from None
    except FrictusError:
        raise
    except (ValueError, TypeError, AttributeError, RecursionError):
        raise LinkError(f"{url} does not welcome: is it frictus?") from None

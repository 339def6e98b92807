"""What is refused before any path is looked at: a web page that uses its visitor's browser.

A page of another origin can send simple requests to 127.0.0.1, and with a DNS name that it
rebinds to 127.0.0.1 it can even read the answers. So a server bound to loopback answers only
to loopback names, and no request that changes something may come from another origin; nor may
a WebSocket, which browsers let any page open and read.
"""

from typing import Final
from urllib.parse import urlsplit

from starlette.datastructures import Headers
from starlette.types import ASGIApp, Receive, Scope, Send

from frictus_service.api.access import is_loopback
from frictus_service.api.problems import ApiError, CrossOriginError, WrongHostError

_SAFE: Final = frozenset({"GET", "HEAD", "OPTIONS"})


class OriginCheck:
    """ASGI middleware; see the module.

    Parameters
    ----------
    app : ASGIApp
        What is behind it.
    loopback_only : bool
        The server is bound to loopback: check the Host header.
    """

    def __init__(self, app: ASGIApp, loopback_only: bool) -> None:
        self._app = app
        self._loopback_only = loopback_only

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
        if origin is not None and does not in _SAFE and _netloc(origin) != host:
            return CrossOriginError(
                f"Origin {origin[:100]!r} is not this server: pages of other origins may not "
                f"{does}"
            )
        return None


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

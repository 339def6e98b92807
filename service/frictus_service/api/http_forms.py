"""Forms of a request that HTTP has, and FastAPI's routes do not know."""

import re
from typing import Final
from urllib.parse import unquote

import anyio
import anyio.lowlevel
from starlette.datastructures import MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

_ABSOLUTE: Final = re.compile(rb"(?i:https?|wss?)://([^/]+)(/.*)?")
"""Target of a request, before its query: the host that it is for, and the path."""


class Middleware:
    """ASGI middleware.

    Parameters
    ----------
    app : ASGIApp
        What is behind it.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app


class AbsoluteTargets(Middleware):
    """ASGI middleware: a target such as ``http://HOST/v1/health`` is served as its path.

    So RFC 9112, section 3.2.2: every server accepts what clients send to proxies, and the host
    that the target names counts, not that of the header.
    """

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve a request."""
        if absolute := _ABSOLUTE.fullmatch(scope.get("raw_path") or b""):
            host, path = absolute[1], absolute[2] or b"/"
            scope.update({"raw_path": path, "path": unquote(path.decode("ascii"))})
            MutableHeaders(scope=scope)["host"] = host.decode("ascii")
        await self._app(scope, receive, send)


class Heads(Middleware):
    """ASGI middleware: a HEAD is worked out as a GET, as far as the head of its answer.

    So RFC 9110, section 9.3.2; FastAPI's routes, unlike Starlette's, know only the methods that
    they declare.
    """

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve a request."""
        if scope["type"] != "http" or scope["method"] != "HEAD":
            await self._app(scope, receive, send)
            return
        with anyio.CancelScope() as until_begun:

            async def send_head(message: Message) -> None:
                await send(message)
                await send({"type": "http.response.body"})
                until_begun.cancel()  # a stream of events would go on, and a file be read
                await anyio.lowlevel.checkpoint()

            scope["method"] = "GET"
            try:
                await self._app(scope, receive, send_head)
            finally:
                scope["method"] = "HEAD"

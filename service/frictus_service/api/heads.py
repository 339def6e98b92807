"""HEAD: what GET would answer, without its body (RFC 9110, section 9.3.2).

FastAPI's routes know only the methods that they declare, unlike Starlette's.
"""

import anyio.lowlevel
from starlette.types import ASGIApp, Message, Receive, Scope, Send


class Heads:
    """ASGI middleware: a HEAD is worked out as a GET, as far as the head of its answer.

    Parameters
    ----------
    app : ASGIApp
        What is behind it.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

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

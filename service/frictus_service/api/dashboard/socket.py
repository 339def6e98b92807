"""The WebSocket `/v1/live`: a conversation with one page. `docs/live.md` specifies it."""

import asyncio
import contextlib
import logging
from collections.abc import Collection
from typing import Final, get_args

from fastapi import APIRouter, WebSocket, WebSocketDisconnect

from frictus_service.api.access import LOCAL, find
from frictus_service.api.callers import ConnectedPages
from frictus_service.api.dashboard.arming import Arming
from frictus_service.api.dashboard.hub import Hub
from frictus_service.api.dashboard.messages import (
    Asked,
    Hello,
    PageArmRequest,
    PageDisarmRequest,
    Ping,
    Point,
    Pong,
    Refused,
    Watch,
    Welcome,
    read,
)
from frictus_service.api.dashboard.pointing import Pointing
from frictus_service.api.dashboard.refusal import BAD_DATA, NOT_ALLOWED, RefusedViewerError
from frictus_service.api.dashboard.viewer import PageFeed
from frictus_service.config import Scope, Token

HELLO_S: Final = 5.0
SEND_S: Final = 5.0
"""A message that cannot be handed to the network for so long ends the connection."""
_LOG: Final = logging.getLogger(__name__)
router = APIRouter()


@router.websocket("/v1/live")
async def live(socket: WebSocket) -> None:
    """Serve one page until either side ends it."""
    services = socket.app.state.services
    conversation = Conversation(
        socket, socket.app.state.hub, services.config.api.tokens, services.pages
    )
    await socket.accept()
    with contextlib.suppress(WebSocketDisconnect):  # the page has gone: nobody is to be told
        try:
            await conversation.serve()
        except TimeoutError:
            _LOG.warning("a page took nothing for %g s: its connection is ended", SEND_S)


class Conversation:
    """What is said to and by one page.

    Parameters
    ----------
    socket : WebSocket
        Its connection.
    hub : Hub
        What all viewers share.
    tokens : collection of Token
        Those of the configuration; without any, everybody may everything.
    pages : ConnectedPages
        Gives the page its name.
    """

    def __init__(
        self, socket: WebSocket, hub: Hub, tokens: Collection[Token], pages: ConnectedPages
    ) -> None:
        self._socket = socket
        self._hub = hub
        self._tokens = tokens
        self._pages = pages

    async def serve(self) -> None:
        """Serve the page until it says something malformed, or asks for what it may not.

        Raises
        ------
        WebSocketDisconnect
            When it ends the connection.
        TimeoutError
            If it does not take what it is sent.
        """
        try:
            await self._converse()
        except RefusedViewerError as refusal:
            await self._refuse(refusal)
            async with asyncio.timeout(SEND_S):
                await self._socket.close(refusal.close or NOT_ALLOWED, refusal.code)

    async def _converse(self) -> None:
        person, scopes = await self._greeted()
        hub = self._hub
        viewer = PageFeed(hub, scopes)
        with hub.joined(viewer), self._pages.joined(person) as page:
            welcome = Welcome(
                scopes=tuple(sorted(scopes)), site=hub.site, client=page.client, key=page.key
            )
            await self._send(welcome.model_dump_json())
            pointing = Pointing(hub, page.client)
            arming = Arming(hub, page.client, self._send)
            tasks = [
                asyncio.create_task(part)
                for part in (
                    self._listen(viewer, pointing, arming),
                    self._tell(viewer),
                    pointing.run(),
                    arming.run(),
                )
            ]
            try:
                # None of them ends but by an exception, and one ends all.
                ended, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
                for task in ended:
                    task.result()
            finally:
                for task in tasks:
                    task.cancel()
                await asyncio.gather(*tasks, return_exceptions=True)
                await arming.close()
                await pointing.lift()

    async def _refuse(self, refusal: RefusedViewerError) -> None:
        told = Refused(what=refusal.what, code=refusal.code, message=str(refusal))
        await self._send(told.model_dump_json())

    async def _greeted(self) -> tuple[str, Collection[Scope]]:
        """Wait for the page to say who it is; return whose it is, and what it may."""
        try:
            async with asyncio.timeout(HELLO_S):
                hello = await self._receive()
        except TimeoutError:
            message = f"hello is to come within {HELLO_S:g} s"
            raise RefusedViewerError("hello", "no_hello", message, NOT_ALLOWED) from None
        if not isinstance(hello, Hello):
            message = f"the first message is to be hello, not {hello.op}"
            raise RefusedViewerError("hello", "no_hello", message, BAD_DATA)
        if not self._tokens:
            return LOCAL, get_args(Scope)
        given = hello.token.get_secret_value() if hello.token is not None else ""
        token = find(given, self._tokens)
        if token is None:
            known = "the token is not known here" if given else "hello is to have a token"
            raise RefusedViewerError("hello", "unauthenticated", known, NOT_ALLOWED)
        return token.name, token.scopes

    async def _listen(self, viewer: PageFeed, pointing: Pointing, arming: Arming) -> None:
        while True:
            asked = await self._receive()
            arming.hear()
            try:
                await self._do(asked, viewer, pointing, arming)
            except RefusedViewerError as refusal:
                if refusal.close is not None:
                    raise
                await self._refuse(refusal)

    async def _do(
        self, asked: Asked, viewer: PageFeed, pointing: Pointing, arming: Arming
    ) -> None:
        match asked:
            case Watch():
                viewer.watch(asked)
            case Point():
                viewer.require("render", "point")
                pointing.point(viewer.watching.rig, asked)
            case PageArmRequest():
                viewer.require("render", "arm")
                await arming.arm(asked.rig, asked.share_with)
            case PageDisarmRequest():
                await arming.disarm(asked.rig)
            case Ping():
                await self._send(Pong(id=asked.id).model_dump_json())
            case Hello():
                message = "hello has been said already"
                raise RefusedViewerError("hello", "malformed", message, BAD_DATA)

    async def _tell(self, viewer: PageFeed) -> None:
        """Send what is new, at the viewer's rate: absolute deadlines, none made up for."""
        loop = asyncio.get_running_loop()
        due_s = loop.time()
        while True:
            for message in viewer.collect():
                await self._send(message)
            due_s = max(due_s + viewer.period_s, loop.time())
            await asyncio.sleep(due_s - loop.time())

    async def _receive(self) -> Asked:
        message = await self._socket.receive()
        if message["type"] == "websocket.disconnect":
            raise WebSocketDisconnect(message["code"])
        text = message.get("text")
        if text is None:
            told = "binary messages are sent by the server only"
            raise RefusedViewerError("message", "malformed", told, BAD_DATA)
        return read(text)

    async def _send(self, message: str | bytes) -> None:
        async with asyncio.timeout(SEND_S):
            if isinstance(message, bytes):
                await self._socket.send_bytes(message)
            else:
                await self._socket.send_text(message)

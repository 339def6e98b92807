"""The WebSocket `/v1/live`: the conversation with one page."""

import asyncio
import contextlib
import logging
import time
from collections.abc import Collection
from typing import Final, get_args

from fastapi import APIRouter, WebSocket, WebSocketDisconnect
from starlette.websockets import WebSocketState

from frictus.websocket.messages import (
    Asked,
    CloseStream,
    Hello,
    OpenStream,
    PageArmRequest,
    PageDisarmRequest,
    Ping,
    Point,
    Pong,
    Refused,
    SetScene,
    Watch,
    Welcome,
)
from frictus_service.api.access import find
from frictus_service.api.dashboard.control import Arming, Pointing
from frictus_service.api.dashboard.hub import Hub
from frictus_service.api.dashboard.messages import (
    BAD_DATA,
    NOT_ALLOWED,
    RefusedViewerError,
    read,
)
from frictus_service.api.dashboard.page_feed import PageFeed
from frictus_service.api.dashboard.rendering import Rendering
from frictus_service.api.limits import Pace
from frictus_service.api.services import ConnectedPages
from frictus_service.config import LOCAL, Scope, Token

HELLO_S: Final = 5.0
SEND_S: Final = 5.0
"""A message that cannot be handed to the network for so long ends the connection."""
MESSAGES_PER_S: Final = 2_000.0
"""A page that sends more waits, and no other: what it sends is not read until then."""
BURST: Final = 1_000
COST_BYTES: Final = 4_096
"""So many bytes count as one message more."""
GONE: Final = 1006
"""The connection broke without a word."""
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
        self._pace = Pace(MESSAGES_PER_S, BURST)

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
        person, scopes, kind = await self._greeted()
        hub = self._hub
        viewer = PageFeed(hub, scopes)
        with hub.joined(viewer, person), self._pages.joined(person, kind) as page:
            welcome = Welcome(
                scopes=tuple(sorted(scopes)),
                site=hub.site,
                client=page.client,
                key=page.key,
                utc_us=_utc_us(),
            )
            await self._send(welcome.model_dump_json())
            pointing = Pointing(hub, page.client)
            rendering = Rendering(hub, page.client, self._send)
            arming = Arming(hub, page.client, self._send, rendering.given_back)
            tasks = [
                asyncio.create_task(part)
                for part in (
                    self._listen(viewer, pointing, arming, rendering),
                    self._tell(viewer, rendering),
                    pointing.run(),
                    arming.run(),
                    rendering.run_calls(),
                    rendering.run_updates(),
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
                async with contextlib.AsyncExitStack() as ends:  # each, whatever others do
                    ends.push_async_callback(pointing.lift)
                    ends.push_async_callback(rendering.close)
                    ends.push_async_callback(arming.close)

    async def _refuse(self, refusal: RefusedViewerError) -> None:
        code, message = refusal.code, str(refusal)
        told = Refused(what=refusal.what, code=code, message=message, id=refusal.request)
        await self._send(told.model_dump_json())

    async def _greeted(self) -> tuple[str, Collection[Scope], str]:
        """Wait for the page to say who it is; return whose it is, what it may, and its kind."""
        try:
            async with asyncio.timeout(HELLO_S):
                hello = await self._receive()
        except TimeoutError:
            message = f"hello is to come within {HELLO_S:g} s"
            raise RefusedViewerError("hello", "no_hello", message, NOT_ALLOWED) from None
        if isinstance(hello, bytes):
            told = "the first message is to be hello, as text"
            raise RefusedViewerError("message", "malformed", told, BAD_DATA)
        if not isinstance(hello, Hello):
            message = f"the first message is to be hello, not {hello.op}"
            raise RefusedViewerError("hello", "no_hello", message, BAD_DATA)
        kind = hello.page or "page"
        if not self._tokens:
            return LOCAL, get_args(Scope), kind
        given = hello.token.get_secret_value() if hello.token is not None else ""
        token = find(given, self._tokens)
        if token is None:
            known = "the token is not known here" if given else "this service asks for a token"
            raise RefusedViewerError("hello", "unauthenticated", known, NOT_ALLOWED)
        return token.name, token.scopes, kind

    async def _listen(
        self, viewer: PageFeed, pointing: Pointing, arming: Arming, rendering: Rendering
    ) -> None:
        while True:
            asked = await self._receive()
            arming.hear()
            try:
                if isinstance(asked, bytes):
                    viewer.require("render", "update")
                    rendering.update(asked)
                else:
                    await self._do(asked, viewer, pointing, arming, rendering)
            except RefusedViewerError as refusal:
                refusal.request = getattr(asked, "id", None)
                if refusal.close is not None:
                    raise
                await self._refuse(refusal)

    async def _do(
        self,
        asked: Asked,
        viewer: PageFeed,
        pointing: Pointing,
        arming: Arming,
        rendering: Rendering,
    ) -> None:
        match asked:
            case Watch():
                viewer.watch(asked)
            case Point():
                viewer.require("render", "point")
                pointing.point(viewer.watching.rig, asked)
            case PageArmRequest():
                viewer.require("render", "arm")
                await arming.arm(asked)
            case PageDisarmRequest():
                await arming.disarm(asked)
            case SetScene() | OpenStream() | CloseStream():
                viewer.require("render", asked.op)
                rendering.call(asked)
            case Ping():
                await self._send(Pong(id=asked.id, utc_us=_utc_us()).model_dump_json())
            case Hello():
                message = "hello has been said already"
                raise RefusedViewerError("hello", "malformed", message, BAD_DATA)

    async def _tell(self, viewer: PageFeed, rendering: Rendering) -> None:
        """Send what is new, at the viewer's rate: absolute deadlines, none made up for."""
        loop = asyncio.get_running_loop()
        due_s = loop.time()
        while True:
            for message in viewer.collect():
                await self._send(message)
            if (progress := rendering.progress()) is not None:
                await self._send(progress.model_dump_json())
            due_s = max(due_s + viewer.period_s, loop.time())
            await asyncio.sleep(due_s - loop.time())

    async def _receive(self) -> Asked | bytes:
        """Return the next message, at the connection's pace: bytes are a texture update."""
        message = await self._socket.receive()
        if message["type"] == "websocket.disconnect":
            raise WebSocketDisconnect(message["code"])
        text: str | None = message.get("text")
        data: bytes = message.get("bytes") or b""
        size = len(data if text is None else text)
        await asyncio.sleep(self._pace.wait_s(1.0 + size / COST_BYTES))
        return data if text is None else read(text)

    async def _send(self, message: str | bytes) -> None:
        if self._socket.application_state is not WebSocketState.CONNECTED:
            raise WebSocketDisconnect(GONE)  # as another part of the conversation has found
        async with asyncio.timeout(SEND_S):
            if isinstance(message, bytes):
                await self._socket.send_bytes(message)
            else:
                await self._socket.send_text(message)


def _utc_us() -> int:
    return time.time_ns() // 1_000

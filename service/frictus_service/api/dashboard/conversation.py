"""The WebSocket `/v1/live`: one viewer, what it watches, and the conversation with its page."""

import asyncio
import contextlib
import logging
from collections.abc import Collection
from typing import Final, get_args

from fastapi import APIRouter, WebSocket, WebSocketDisconnect

from frictus_service.api.access import find
from frictus_service.api.dashboard.channels import VALUES, Channel, Stream, Value
from frictus_service.api.dashboard.control import Arming, Pointing
from frictus_service.api.dashboard.frames import LiveFrameError, Trace
from frictus_service.api.dashboard.hub import Hub
from frictus_service.api.dashboard.messages import (
    BAD_DATA,
    NOT_ALLOWED,
    Asked,
    Hello,
    PageArmRequest,
    PageDisarmRequest,
    Ping,
    Point,
    Pong,
    Refused,
    RefusedViewerError,
    RigLost,
    Rigs,
    Watch,
    Welcome,
    read,
)
from frictus_service.api.services import ConnectedPages
from frictus_service.config import LOCAL, Scope, Token

IDLE_RATE_HZ: Final = 10.0
_NOTHING: Final = Watch(op="watch", rig=None, rate_hz=IDLE_RATE_HZ)


class PageFeed:
    """Collects what is new since it collected last.

    Nothing is queued for a viewer: it has cursors into what all viewers share. One that
    collects late gets the newest of every value, and of every stream what is still held; what
    it lost is counted in its next frame.

    Parameters
    ----------
    hub : Hub
        What all viewers share.
    scopes : collection of str
        What its token allows.
    """

    def __init__(self, hub: Hub, scopes: Collection[Scope]) -> None:
        self._hub = hub
        self._scopes = scopes
        self._told_rigs: Rigs | None = None
        self._told_present: bool | None = None
        self._seen: dict[str, tuple[Channel, int]] = {}
        self._traces: dict[str, Trace] = {}
        self.watching = _NOTHING
        self.require("read", "hello")

    def require(self, scope: Scope, what: str) -> None:
        """Raise `RefusedViewerError` unless the viewer's token has a scope.

        Parameters
        ----------
        scope : str
            What is needed.
        what : str
            What for.
        """
        if scope not in self._scopes:
            had = ", ".join(sorted(self._scopes))
            message = f"this needs the scope {scope!r}; the token has {had}"
            raise RefusedViewerError(what, "missing_scope", message, NOT_ALLOWED)

    @property
    def wanted(self) -> frozenset[tuple[str, str]]:
        """The channels it watches."""
        if self.watching.rig is None:
            return frozenset()
        return frozenset(
            (self.watching.rig, name) for name in (*VALUES, *self.watching.streams)
        )

    @property
    def period_s(self) -> float:
        """Time from one collection to the next."""
        return 1.0 / self.watching.rate_hz

    def watch(self, watch: Watch) -> None:
        """Watch this, in place of what was watched; values are told anew.

        Parameters
        ----------
        watch : Watch
            As the page sent it.
        """
        self.watching = _NOTHING if watch.rig is None else watch
        self._told_present = None
        self._seen = {}
        self._traces = {name: Trace(watch) for name in watch.streams}
        self._hub.poke()

    def collect(self) -> list[str | bytes]:
        """Return what is new, as text and binary messages; never waits."""
        self._hub.pump()
        news: list[str | bytes] = []
        rigs = Rigs(rigs=self._hub.rigs, link=self._hub.linked)
        if rigs != self._told_rigs:
            self._told_rigs = rigs
            news.append(rigs.model_dump_json())
        rig = self.watching.rig
        if rig is None:
            return news
        present, before = rig in rigs.rigs, self._told_present
        self._told_present = present
        if not present:
            if before is not False:
                news.append(RigLost(rig=rig).model_dump_json())
            return news
        return news + self._values(rig) + self._frames(rig)

    def _values(self, rig: str) -> list[str | bytes]:
        news: list[str | bytes] = []
        for name in VALUES:
            value = self._hub.channel(rig, name)
            if isinstance(value, Value) and value.count > self._cursor(name, value, 0):
                self._seen[name] = (value, value.count)
                news.append(value.text)
        return news

    def _frames(self, rig: str) -> list[str | bytes]:
        news: list[str | bytes] = []
        for name, trace in list(self._traces.items()):
            stream = self._hub.channel(rig, name)
            if isinstance(stream, Stream):
                blocks = stream.since(self._cursor(name, stream, stream.count))
                self._seen[name] = (stream, stream.count)
                try:
                    news.extend([frame.pack() for frame in trace.push(blocks)])
                except (LiveFrameError, ArithmeticError) as error:
                    # Not of a rig: its numbers do not fit a frame. What follows is shown anew.
                    _LOG.warning("stream %s of rig %s is not shown: %s", name, rig, error)
                    self._traces[name] = Trace(self.watching)
        return news

    def _cursor(self, name: str, channel: Channel, start: int) -> int:
        """Return up to where the viewer has seen a channel; a new one from `start` on."""
        seen, count = self._seen.get(name, (None, 0))
        return count if seen is channel else start


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

"""What one page has a rig render: scenes, and the updates of a texture stream.

Calls and updates have threads of their own: neither waits for the other, and what disarms
waits for none of them. Nothing is queued: of updates the newest wins, and a call that comes
before the answer to the one before it is refused.
"""

import asyncio
import contextlib
import time
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from functools import partial
from typing import Final, TypeVar

import anyio

import frictus
from frictus.errors import FrameError, LeaseLostError, RefusedError
from frictus.messages import MAX_COUNT
from frictus.stream import StreamFrame, TextureStream, ticket_of
from frictus.websocket.messages import (
    CloseStream,
    OpenStream,
    Refused,
    SceneSet,
    SetScene,
    StreamClosed,
    StreamOpened,
    StreamProgress,
)
from frictus_service.api.dashboard.control import FAULTS, code_of
from frictus_service.api.dashboard.hub import Hub
from frictus_service.api.dashboard.messages import BAD_DATA, RefusedViewerError

MAX_UPDATE_HZ: Final = 250.0
"""A rig takes one update a block, and blocks last 5 ms: more would not be felt."""
AHEAD_MS: Final = 500.0
"""A stamp that is further in the future is of a clock that was not set by ours."""
Call = SetScene | OpenStream | CloseStream
Answer = SceneSet | StreamOpened | StreamClosed
T = TypeVar("T")
R = TypeVar("R")


@dataclass(slots=True)
class _Opened:
    """A texture stream that is open, and what became of its updates."""

    name: str
    ticket: int
    rig: frictus.Rig
    stream: TextureStream
    superseded: int = 0
    expired: int = 0
    newest: int | None = None

    def progress(self) -> StreamProgress:
        return StreamProgress(
            rig=self.name,
            ticket=self.ticket,
            sent=self.stream.sent,
            superseded=self.superseded,
            expired=self.expired,
            newest=self.newest,
        )

    def closed(self, reason: str, request: int | None) -> StreamClosed:
        told = self.progress().model_dump(exclude={"op"})
        return StreamClosed(**told, reason=reason, id=request)


class Rendering:
    """Sets scenes and plays the texture stream of one page.

    Parameters
    ----------
    hub : Hub
        Knows the rigs.
    client : str
        The page, as rigs know it.
    tell : callable
        Sends a message to the page.
    """

    def __init__(self, hub: Hub, client: str, tell: Callable[[str], Awaitable[None]]) -> None:
        self._hub = hub
        self._client = client
        self._tell = tell
        self._asked: Call | None = None
        self._called = asyncio.Event()
        self._calling: asyncio.Task[Answer] | None = None
        self._opened: _Opened | None = None
        self._tickets = 0
        self._newest: StreamFrame | None = None
        self._given = asyncio.Event()
        self._publishing: asyncio.Task[None] | None = None
        self._told: StreamProgress | None = None

    def call(self, asked: Call) -> None:
        """Take a call; its answer is told later.

        Raises
        ------
        RefusedViewerError
            If the one before it is not answered yet.
        """
        if self._asked is not None:
            message = f"{self._asked.op} is not answered yet: wait for its answer"
            raise RefusedViewerError(asked.op, "busy", message, None)
        self._asked = asked
        self._called.set()

    def update(self, data: bytes) -> None:
        """Take an update of the open stream; one that is not yet on its way is left out.

        Parameters
        ----------
        data : bytes
            A `frictus.stream.StreamFrame` with the ticket of `stream_opened`. One of a stream
            that has ended is left out: the page cannot have known.

        Raises
        ------
        RefusedViewerError
            If it is malformed, or there was no such stream.
        """
        try:
            ticket = ticket_of(data)
            opened = self._opened
            if opened is None or ticket != opened.ticket:
                if 1 <= ticket <= self._tickets:
                    return
                message = f"no texture stream has the ticket {ticket}: open one first"
                raise RefusedViewerError("update", "no_stream", message, None)
            frame = StreamFrame.unpack(data)
            if frame.sequence > MAX_COUNT:
                raise FrameError(f"sequence {frame.sequence}: 0 to {MAX_COUNT} accepted")
        except FrameError as error:
            raise RefusedViewerError("update", "malformed", str(error), BAD_DATA) from None
        opened.superseded += self._newest is not None
        self._newest = frame
        self._given.set()

    def given_back(self, rig: str, reason: str) -> None:
        """Take note that the page holds a rig no longer: nothing plays its stream there.

        The rig's status says so, too, but may come after the page's next call.

        Parameters
        ----------
        rig : str
            Its name.
        reason : str
            For the page; empty where it asked for it.
        """
        opened = self._opened
        if opened is not None and opened.name == rig and opened.stream.ended is None:
            why = reason or "the page gave the rig back"
            opened.stream.fail(LeaseLostError(f"the stream has ended: {why}"))

    def progress(self) -> StreamProgress | None:
        """Return what became of the updates; None where that has been told."""
        now = None if self._opened is None else self._opened.progress()
        told, self._told = self._told, now
        return None if now == told else now

    async def run_calls(self) -> None:
        """Carry out calls and tell their answers, for ever."""
        while True:
            await self._called.wait()
            self._called.clear()
            asked = self._asked
            assert asked is not None
            self._calling = asyncio.create_task(self._answer(asked))
            try:
                answer: Answer | Refused = await asyncio.shield(self._calling)
            except FAULTS as error:
                told = code_of(error), str(error)
                answer = Refused(what=asked.op, code=told[0], message=told[1], id=asked.id)
            finally:
                self._asked = None
            await self._tell(answer.model_dump_json())

    async def run_updates(self) -> None:
        """Pass updates on as they come, but not too often, for ever."""
        due_s = time.monotonic()
        while True:
            await self._given.wait()
            self._given.clear()
            frame, self._newest = self._newest, None
            if frame is not None and self._opened is not None:
                await self._publish(self._opened, frame)
                due_s = max(due_s + 1.0 / MAX_UPDATE_HZ, time.monotonic())
                await asyncio.sleep(due_s - time.monotonic())

    async def close(self) -> None:
        """End the stream that is open, or about to be."""
        for under_way in (self._calling, self._publishing):
            if under_way is not None:
                # Whatever it ends with: what is not looked at goes to the log as a fault.
                await asyncio.gather(asyncio.shield(under_way), return_exceptions=True)
        if self._opened is not None:
            await self._end("")

    async def _answer(self, asked: Call) -> Answer:
        match asked:
            case SetScene():
                return await self._in_thread(self._set_scene, asked)
            case OpenStream():
                await self._end_unplayed()
                if self._opened is not None:
                    raise RefusedError("conflict", "a stream is open: close it first")
                self._tickets += 1
                opened = await self._in_thread(self._open_stream, asked)
                self._opened, self._newest = opened, None
                return StreamOpened(
                    rig=asked.rig,
                    ticket=opened.ticket,
                    applied=opened.stream.applied,
                    id=asked.id,
                )
            case CloseStream():
                if self._opened is None:
                    raise RefusedError("no_stream", "no texture stream is open")
                return await self._end("", asked.id)

    async def _in_thread(self, work: Callable[[T], R], given: T) -> R:
        return await anyio.to_thread.run_sync(partial(work, given), limiter=self._hub.calls)

    def _set_scene(self, asked: SetScene) -> SceneSet:
        with contextlib.closing(self._hub.rig_of(asked.rig, self._client)) as rig:
            state = rig.set_scene(asked.scene, asked.if_match)
        return SceneSet(rig=asked.rig, etag=state.etag, applied=state.applied, id=asked.id)

    def _open_stream(self, asked: OpenStream) -> _Opened:
        rig = self._hub.rig_of(asked.rig, self._client)
        try:
            stream = rig.open_stream(asked.peak_n)
        except BaseException:
            rig.close()
            raise
        return _Opened(asked.rig, self._tickets, rig, stream)

    async def _end_unplayed(self) -> None:
        """End the open stream if nothing plays it: else its next update would find that."""
        if self._opened is not None and (ended := self._opened.stream.ended) is not None:
            await self._tell((await self._end(str(ended))).model_dump_json())

    async def _end(self, reason: str, request: int | None = None) -> StreamClosed:
        """End the open stream, whatever the rig says to it."""
        opened, self._opened = self._opened, None
        assert opened is not None

        def close(opened: _Opened) -> str:
            try:
                opened.stream.close()
            except FAULTS as error:
                return str(error)
            finally:
                opened.rig.close()
            return ""

        failed = await self._in_thread(close, opened)
        return opened.closed(reason or failed, request)

    async def _publish(self, opened: _Opened, frame: StreamFrame) -> None:
        age_ms = (time.time_ns() - frame.utc_ns) / 1e6
        left_ms = int(frame.ttl_ms - max(age_ms, 0.0))
        if left_ms < 1 or age_ms < -AHEAD_MS:
            opened.expired += 1
            return
        send = partial(
            opened.stream.send,
            frame.friction_n,
            period_mm=frame.period if frame.spatial else None,
            period_s=None if frame.spatial else frame.period,
            angle_deg=frame.angle_deg,
            ttl_ms=left_ms,
        )
        sending = anyio.to_thread.run_sync(send, limiter=self._hub.updates)
        self._publishing = asyncio.create_task(sending)
        try:
            await asyncio.shield(self._publishing)
            opened.newest = frame.sequence
        except LeaseLostError as error:
            if self._opened is opened:
                await self._tell((await self._end(str(error))).model_dump_json())
        except FAULTS as error:
            if self._opened is opened:  # else it was closed meanwhile
                refused = Refused(what="update", code=code_of(error), message=str(error))
                await self._tell(refused.model_dump_json())

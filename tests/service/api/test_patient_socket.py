"""What a page costs that floods its WebSocket with frames, or does not take what it gets."""

import asyncio
import logging
from collections.abc import Callable
from typing import Any

import pytest
import uvicorn
from starlette.responses import PlainTextResponse
from tests.campaigns.hostile_clients import frame
from uvicorn.server import ServerState

from frictus_service.api import limits, patient_socket
from frictus_service.api.patient_socket import PatientSocket

UPGRADE = (
    b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n"
    b"Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n"
)
PING = frame(9, b"x" * 125)


class Wire(asyncio.Transport):
    """What a socket writes, and whether it has ended."""

    def __init__(self) -> None:
        super().__init__()
        self.written = b""
        self.closing = False
        self.aborted = asyncio.Event()

    def write(self, data: Any) -> None:
        self.written += bytes(data)

    def is_closing(self) -> bool:
        return self.closing

    def close(self) -> None:
        self.closing = True  # the rest of what was written waits for ever

    def abort(self) -> None:
        self.closing = True
        self.aborted.set()

    def pause_reading(self) -> None:
        pass

    def resume_reading(self) -> None:
        pass


def with_socket(test: Callable[[PatientSocket, Wire], Any], *, leaves: bool = False) -> None:
    """Run a test of a socket that has been accepted; its app leaves at once, or listens."""

    async def run() -> None:
        accepted = asyncio.Event()

        async def app(_scope: Any, receive: Any, send: Any) -> None:
            await receive()
            await send({"type": "websocket.accept"})
            accepted.set()
            while not leaves and (await receive())["type"] != "websocket.disconnect":
                pass

        wire, state = Wire(), ServerState()
        socket = PatientSocket(uvicorn.Config(app, ws_max_size=65_536), state, {})
        socket.connection_made(wire)
        socket.data_received(UPGRADE)
        await accepted.wait()
        wire.written = b""
        await test(socket, wire)
        socket.connection_lost(None)
        await asyncio.gather(*state.tasks)

    asyncio.run(run())


@pytest.mark.parametrize(
    ("first", "again"),
    [
        (b"", PING),
        (b"", frame(10, b"")),
        (frame(1, b"{", flags=0), frame(0, b"", flags=0)),
    ],
    ids=["pings", "pongs", "fragments"],
)
def test_a_flood_of_frames_that_are_no_messages_ends_it(
    first: bytes,
    again: bytes,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    monkeypatch.setattr(patient_socket, "FRAMES_PER_S", 1e-3)
    monkeypatch.setattr(patient_socket, "BURST", 100)
    read: list[None] = []
    monkeypatch.setattr(PatientSocket, "_count_frame", noting(read, PatientSocket._count_frame))

    async def flood(socket: PatientSocket, wire: Wire) -> None:
        socket.data_received(first + 99 * again)
        assert not wire.closing
        socket.data_received(100_000 * again)
        assert wire.aborted.is_set()
        # What stands behind the slice that ended it was not looked at.
        assert len(read) <= 99 + patient_socket.SLICE_BYTES / len(again) + 1

    with caplog.at_level(logging.WARNING):
        with_socket(flood)
    assert sum("no messages" in one.message for one in caplog.records) == 1


def noting(into: list[None], call: Callable[..., None]) -> Callable[..., None]:
    def noted(*given: Any) -> None:
        into.append(None)
        call(*given)

    return noted


def test_no_answer_to_a_ping_waits_for_who_takes_none() -> None:
    async def ping(socket: PatientSocket, wire: Wire) -> None:
        socket.pause_writing()
        socket.data_received(100 * PING)
        assert wire.written == b""
        socket.resume_writing()
        socket.data_received(PING)
        assert wire.written == bytes([0x8A, 125]) + b"x" * 125

    with_socket(ping)


def test_what_is_not_taken_at_the_end_is_dropped(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(limits, "TAKE_S", 0.01)

    async def wait(_: PatientSocket, wire: Wire) -> None:
        await asyncio.wait_for(wire.aborted.wait(), 30.0)

    with_socket(wait, leaves=True)


def test_who_does_not_answer_is_cut_off(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(limits, "TAKE_S", 0.01)

    async def wait(socket: PatientSocket, wire: Wire) -> None:
        socket.keepalive_timeout()
        await asyncio.wait_for(wire.aborted.wait(), 30.0)

    with_socket(wait)


def test_what_comes_after_the_end_is_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(patient_socket, "BURST", 100)
    monkeypatch.setattr(patient_socket, "FRAMES_PER_S", 1e-3)

    async def talk(socket: PatientSocket, wire: Wire) -> None:
        socket.close_sent = True
        socket.data_received(1_000 * frame(1, b"{}"))
        assert wire.aborted.is_set()

    with_socket(talk)


def test_a_refused_page_is_answered_and_no_error_of_the_server(
    caplog: pytest.LogCaptureFixture,
) -> None:
    async def run() -> None:
        wire, state = Wire(), ServerState()

        async def refuse(scope: Any, receive: Any, send: Any) -> None:
            await PlainTextResponse("not from there", 403)(scope, receive, send)

        socket = PatientSocket(uvicorn.Config(refuse, log_config=None), state, {})
        socket.connection_made(wire)
        socket.data_received(UPGRADE)
        await asyncio.gather(*state.tasks)
        socket.connection_lost(None)
        assert wire.written.startswith(b"HTTP/1.1 403 ")
        assert wire.written.endswith(b"not from there")

    asyncio.run(run())
    assert not [one for one in caplog.records if one.levelno >= logging.ERROR]

"""Services that answer wrongly, not at all, or end; and what is not installed."""

import asyncio
import contextlib
import json
import socketserver
import subprocess
import sys
import threading
from collections.abc import AsyncIterator, Awaitable, Callable

import numpy as np
import pytest
from websockets.asyncio.server import ServerConnection, serve

import frictus
from frictus import websocket
from frictus.websocket import connection
from frictus.websocket.client import _Rest
from frictus.websocket.frames import FINGER_ROWS, FINGER_STREAM, Frame, Kind

WELCOME = json.dumps(
    {
        "op": "welcome",
        "version": 1,
        "protocol": "1.7",
        "scopes": ["render"],
        "site": "lab",
        "client": "x.page-1",
        "key": "k",
        "utc_us": 1,
        "later": True,
    }
)
RIGS = '{"op": "rigs", "rigs": ["rig1"], "link": true}'
Answers = Callable[[ServerConnection], Awaitable[None]]


@contextlib.asynccontextmanager
async def service(answers: Answers) -> AsyncIterator[str]:
    """A service that hears hello and then does as it is told."""

    async def handle(socket: ServerConnection) -> None:
        hello = json.loads(await socket.recv())
        assert hello == {"op": "hello", "version": 1, "token": "a token"}
        await answers(socket)

    async with serve(handle, "127.0.0.1", 0, close_timeout=0.1) as server:
        port = next(iter(server.sockets)).getsockname()[1]
        async with asyncio.timeout(30.0):
            yield f"ws://127.0.0.1:{port}"


def sends(*messages: str | bytes) -> Answers:
    """Send messages; leave when the client does."""

    async def answers(socket: ServerConnection) -> None:
        for message in messages:
            await socket.send(message)
        await socket.wait_closed()

    return answers


async def fault(answers: Answers) -> BaseException:
    """What a client ends with that waits for a finger."""
    async with service(answers) as url:
        try:
            async with websocket.connect(url, "a token") as client:
                async for _ in (await client.rig("rig1")).fingers():
                    pass
        except Exception as error:
            return error
    raise AssertionError("it went on")


@pytest.mark.parametrize(
    ("sent", "kind", "why"),
    [
        (["{"], frictus.LinkError, "does not welcome"),
        ([b"binary"], frictus.LinkError, "does not welcome"),
        (["[1]"], frictus.LinkError, "does not welcome"),
        (["[" * 100_000], frictus.LinkError, "does not welcome"),
        ([RIGS], frictus.LinkError, "does not welcome"),
        (['{"op": "welcome"}'], frictus.LinkError, "speaks 1.0"),
        (['{"op": "welcome", "protocol": "1.1"}'], frictus.LinkError, "does not welcome"),
        ([WELCOME.replace("1.7", "2.0")], frictus.LinkError, "speaks 2.0"),
        (
            ['{"op": "refused", "what": "hello", "code": "unauthenticated", "message": "no"}'],
            frictus.RefusedError,
            "no",
        ),
        ([WELCOME, RIGS, "{"], frictus.LinkError, "cannot be read"),
        ([WELCOME, RIGS, "[" * 100_000], frictus.LinkError, "cannot be read"),
        ([WELCOME, RIGS, "[1]"], frictus.LinkError, "cannot be read"),
        ([WELCOME, '{"op": "rigs", "rigs": 3}'], frictus.LinkError, "cannot be read"),
        ([WELCOME, RIGS, '{"op": "status", "rig": "rig1"}'], frictus.LinkError, "be read"),
        ([WELCOME, RIGS, b"short"], frictus.LinkError, "cannot be read: 5 bytes"),
        ([WELCOME, RIGS, b"\x02\0\x01" + bytes(53)], frictus.LinkError, "version 2"),
        ([WELCOME, RIGS, b"\x01\0\x01" + bytes(53)], frictus.LinkError, "0 channels"),
    ],
)
def test_a_service_that_sends_nonsense_is_left(
    sent: list[str | bytes], kind: type[Exception], why: str
) -> None:
    error = asyncio.run(fault(sends(*sent)))
    assert type(error) is kind
    assert why in str(error)


def test_a_state_without_a_time_is_nonsense_too() -> None:
    async def answers(socket: ServerConnection) -> None:
        for message in (WELCOME, RIGS):
            await socket.send(message)
        while json.loads(await socket.recv())["op"] != "watch":
            pass
        known = {"op": "recording", "rig": "rig1"}
        await socket.send(json.dumps(known | {"recording": {"utc_ns": 1, "recording": False}}))
        states = np.full((len(FINGER_ROWS), 1), np.inf, dtype=np.float32)
        frame = Frame(FINGER_STREAM, 0, 1, 0, 0, 20_000.0, 1, Kind.FINGER, 1, states)
        await socket.send(frame.pack())
        await socket.wait_closed()

    error = asyncio.run(fault(answers))
    assert isinstance(error, frictus.LinkError)
    assert "cannot be read" in str(error)


def test_what_is_no_answer_to_a_stop_is_a_lost_link() -> None:
    with socketserver.TCPServer(("127.0.0.1", 0), NoHttp) as server:
        thread = threading.Thread(target=server.handle_request)
        thread.start()
        rest = _Rest(f"ws://127.0.0.1:{server.server_address[1]}", None, "k", None)
        with pytest.raises(frictus.LinkError, match="was not stopped over http"):
            rest.stop("rig1")
        thread.join(10.0)


class NoHttp(socketserver.BaseRequestHandler):
    """Speaks something else."""

    def handle(self) -> None:
        self.request.recv(65_536)
        self.request.sendall(b"SSH-2.0-x\r\n")


def test_a_service_that_closes_says_why() -> None:
    async def answers(socket: ServerConnection) -> None:
        await socket.send(WELCOME)
        await socket.send(RIGS)
        await socket.send('{"op": "a later one"}')
        await socket.close(1012, "the service restarts")

    assert "the service restarts" in str(asyncio.run(fault(answers)))


def test_a_service_that_dies_is_noticed() -> None:
    async def answers(socket: ServerConnection) -> None:
        await socket.send(WELCOME)
        await socket.send(RIGS)
        socket.transport.abort()

    error = asyncio.run(fault(answers))
    assert type(error) is frictus.LinkError


def test_silence_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connection, "PING_S", 0.01)
    error = asyncio.run(fault(sends(WELCOME, RIGS)))
    assert type(error) is frictus.LinkError
    assert "silent" in str(error)


def test_a_request_without_an_answer_has_an_unknown_outcome() -> None:
    taken_back: list[dict[str, object]] = []

    async def answers(socket: ServerConnection) -> None:
        await socket.send(WELCOME)
        await socket.send(RIGS)
        async for message in socket:
            told = json.loads(message)
            if told["op"] == "disarm":
                taken_back.append(told)
                await socket.close()

    async def work() -> None:
        async with (
            service(answers) as url,
            websocket.connect(url, "a token", timeout_s=0.05) as client,
        ):
            rig = await client.rig("rig1")
            with pytest.raises(frictus.OutcomeUnknownError, match=r"0\.05 s"):
                async with rig.arm():
                    pass
            with pytest.raises(frictus.LinkError):  # it was taken back, and the service closed
                await anext(rig.fingers())

    asyncio.run(work())
    assert [told["rig"] for told in taken_back] == ["rig1"]


def test_an_answer_of_another_kind_ends_the_connection() -> None:
    async def answers(socket: ServerConnection) -> None:
        await socket.send(WELCOME)
        await socket.send(RIGS)
        async for message in socket:
            told = json.loads(message)
            if told["op"] == "arm":
                other = {"op": "disarmed", "rig": "rig1", "reason": "", "id": told["id"]}
                await socket.send(json.dumps(other))

    async def work() -> None:
        async with service(answers) as url, websocket.connect(url, "a token") as client:
            with pytest.raises(frictus.LinkError, match="Disarmed"):
                async with (await client.rig("rig1")).arm():
                    pass

    asyncio.run(work())


@pytest.mark.parametrize(
    ("options", "why"),
    [
        ({"url": "http://127.0.0.1"}, "ws://"),
        ({"rate_hz": 61.0}, "1 to 60"),
        ({"rate_hz": float("nan")}, "1 to 60"),
        ({"token": "x" * 1_001}, "1000"),
    ],
)
def test_arguments_are_checked(options: dict[str, object], why: str) -> None:
    async def work() -> None:
        async with service(sends(WELCOME)) as url:
            async with websocket.connect(**{"url": url, **options}):  # type: ignore[arg-type]
                pass

    with pytest.raises(frictus.ArgumentError, match=why):
        asyncio.run(work())


def test_nobody_there_is_said() -> None:
    async def work() -> None:
        async with websocket.connect("ws://127.0.0.1:1"):
            pass

    with pytest.raises(frictus.LinkError, match="is the service there"):
        asyncio.run(work())


def test_it_says_what_to_install() -> None:
    program = """
import asyncio, sys
sys.modules["websockets"] = None
from frictus import websocket

async def main():
    async with websocket.connect():
        pass

try:
    asyncio.run(main())
except ImportError as error:
    print(error)
"""
    command = [sys.executable, "-W", "error", "-c", program]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert "pip install 'frictus[websocket]'" in done.stdout, done.stderr

"""HEAD is answered as GET is, without a body; a whole address is served as its path."""

import asyncio
from collections.abc import Callable
from pathlib import Path
from socket import socket

import pytest
from fastapi.testclient import TestClient
from starlette.types import Message, Receive, Scope, Send
from tests.service.api.conftest import FakeRig
from tests.service.api.test_limits import all_of, connected, serving
from tests.service.api.test_server import configuration

from frictus_service.api.http_forms import Heads
from frictus_service.processes import free_port

CLOSE = "Connection: close\r\n"
UPGRADE = (
    "Connection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n"
    "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n"
)


@pytest.mark.parametrize(
    "path",
    ["/v1/health", "/v1/rigs", "/v1/rigs/rig1/scene", "/v1/textures/none", "/docs", "/metrics"],
)
def test_the_head_is_that_of_get(api: TestClient, rig: FakeRig, path: str) -> None:
    answer, head = api.get(path), api.head(path)
    assert head.status_code == answer.status_code
    assert head.content == b""
    for header in ("content-type", "etag"):
        assert head.headers.get(header) == answer.headers.get(header)


def test_a_stream_ends_with_its_head() -> None:
    sent: list[Message] = []
    ended = []

    async def stream(scope: Scope, receive: Receive, send: Send) -> None:
        assert scope["method"] == "GET"
        try:
            await send({"type": "http.response.start", "status": 200, "headers": []})
            await asyncio.Event().wait()
        finally:
            ended.append(True)

    async def receive() -> Message:
        raise AssertionError

    async def send(message: Message) -> None:
        sent.append(message)

    scope = {"type": "http", "method": "HEAD", "path": "/", "headers": []}
    asyncio.run(asyncio.wait_for(Heads(stream)(scope, receive, send), 5.0))
    assert [message["type"] for message in sent] == [
        "http.response.start",
        "http.response.body",
    ]
    assert ended
    assert scope["method"] == "HEAD"


def test_a_whole_address_is_served_as_its_path(router: str, tmp_path: Path) -> None:
    def asked(
        target: str, read: Callable[[socket], bytes] = all_of, more: str = CLOSE
    ) -> bytes:
        head = f"GET {target} HTTP/1.1\r\nHost: 127.0.0.1\r\n{more}\r\n"
        with connected(port, head.encode()) as opened:
            return read(opened)

    with serving(configuration(router, tmp_path, free_port())) as port:
        host = f"HTTP://127.0.0.1:{port}"
        assert b'{"alive":true}' in asked(f"{host}/v1/health")
        assert b'"rigs":[]' in asked(f"{host}/v1/rigs?x=http://a/b")
        assert b"/v1/n n" in asked(f"{host}/v1/n%20n")
        assert asked(host).startswith(asked("/").partition(b"\r\n")[0])
        assert b'"wrong_host"' in asked("http://elsewhere.example/v1/health")  # not the header
        assert asked(f"{host}/v1/live", lambda it: it.recv(12), UPGRADE) == b"HTTP/1.1 101"

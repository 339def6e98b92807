"""HEAD is answered as GET is, without a body."""

import asyncio

import pytest
from fastapi.testclient import TestClient
from starlette.types import Message, Receive, Scope, Send
from tests.service.api.conftest import FakeRig

from frictus_service.api.server import Heads


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

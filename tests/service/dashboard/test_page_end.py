"""The end of a page, and what may come between: no fault of one part keeps the others up."""

import asyncio
import gc
import threading
from types import SimpleNamespace
from typing import Any, Final

import numpy as np
import pytest
from fastapi import WebSocket, WebSocketDisconnect
from starlette.types import Message
from starlette.websockets import WebSocketState

from frictus.errors import LeaseLostError, LinkError, RefusedError
from frictus.messages import Applied
from frictus.stream import StreamFrame
from frictus.textures import Scene
from frictus.websocket.messages import OpenStream, PageArmRequest, PageDisarmRequest, SetScene
from frictus_service.api.dashboard import control
from frictus_service.api.dashboard.control import Arming, Pointing
from frictus_service.api.dashboard.conversation import Conversation
from frictus_service.api.dashboard.hub import Hub
from frictus_service.api.dashboard.messages import RefusedViewerError
from frictus_service.api.dashboard.rendering import Rendering
from frictus_service.api.services import ConnectedPages
from frictus_service.config import ApiConfig

HELD_MS: Final = ApiConfig().page_lease_ms


class Link:
    """A connection without a router; a rig is what a test makes it."""

    site = "lab"

    def __init__(self, rig: Any = None) -> None:
        self._rig = rig

    def client(self) -> Any:
        if self._rig is None:
            raise LinkError("no router")
        return SimpleNamespace(rig=lambda name, site: self)

    def on_behalf_of(self, client: str) -> Any:
        return self._rig


class Refusing:
    """A rig that nobody gets."""

    closed = False

    def arm(self, **how: Any) -> Any:
        raise RefusedError("conflict", "another holds it")

    def close(self) -> None:
        self.closed = True


class Stream:
    """A texture stream that closes."""

    applied = Applied(
        gain=1.0,
        feasible_gain=1.0,
        bias=0.5,
        bias_n=0.1,
        scaled=False,
        speed_range_mm_s=(10.0, 100.0),
    )
    sent = 0
    closed = False

    def close(self) -> None:
        self.closed = True


async def ignore(_: str) -> None:
    pass


def forget(rig: str, reason: str) -> None:
    pass


def test_a_refused_arming_ends_no_watch_over_the_lease(monkeypatch: Any) -> None:
    monkeypatch.setattr(control, "LOOK_S", 0.0)  # it looks in every turn of the loop

    async def scene() -> None:
        rig = Refusing()
        arming = Arming(Hub(Link(rig), HELD_MS), "page", ignore, forget)  # type: ignore[arg-type]
        watch = asyncio.create_task(arming.run())
        with pytest.raises(RefusedViewerError, match="another holds it"):
            await arming.arm(PageArmRequest(op="arm", rig="rig1"))
        assert not watch.done()
        assert rig.closed
        watch.cancel()
        await arming.close()

    asyncio.run(scene())


def test_a_rig_that_is_given_back_is_closed_whatever_it_says() -> None:
    done: list[str] = []

    def refuse() -> None:
        done.append("disarm")
        raise LinkError("no answer")

    lease = SimpleNamespace(loss=None, disarm=refuse)
    rig = SimpleNamespace(arm=lambda **how: lease, close=lambda: done.append("close"))

    async def scene() -> None:
        arming = Arming(Hub(Link(rig), HELD_MS), "page", ignore, forget)  # type: ignore[arg-type]
        await arming.arm(PageArmRequest(op="arm", rig="rig1"))
        await arming.close()

    asyncio.run(scene())
    assert done == ["disarm", "close"]


def test_who_disarms_what_is_just_being_given_back_is_answered(monkeypatch: Any) -> None:
    monkeypatch.setattr(control, "LOOK_S", 0.0)
    begun, ends = threading.Event(), threading.Event()

    def disarm() -> None:
        begun.set()
        assert ends.wait(10.0)

    lease = SimpleNamespace(loss=LeaseLostError("stopped"), disarm=disarm)
    rig = SimpleNamespace(arm=lambda **how: lease, close=lambda: None)

    async def scene() -> None:
        told: list[str] = []

        async def tell(message: str) -> None:
            told.append(message)

        arming = Arming(Hub(Link(rig), HELD_MS), "page", tell, forget)  # type: ignore[arg-type]
        await arming.arm(PageArmRequest(op="arm", rig="rig1"))
        watch = asyncio.create_task(arming.run())
        await asyncio.to_thread(begun.wait, 10.0)
        asked = asyncio.create_task(arming.disarm(PageDisarmRequest(op="disarm", rig="rig1")))
        await asyncio.sleep(0)  # it waits for its turn
        ends.set()
        with pytest.raises(RefusedViewerError, match="does not hold"):
            await asked
        assert "stopped" in told[-1]
        watch.cancel()

    asyncio.run(scene())


def test_a_rig_that_a_page_holds_waits_for_the_api_as_configured() -> None:
    asked: dict[str, Any] = {}
    lease = SimpleNamespace(loss=None, disarm=lambda: None)
    rig = SimpleNamespace(arm=lambda **how: asked.update(how) or lease, close=lambda: None)

    async def scene(hub: Hub) -> None:
        arming = Arming(hub, "page", ignore, forget)
        await arming.arm(PageArmRequest(op="arm", rig="rig1"))
        await arming.close()

    asyncio.run(scene(Hub(Link(rig), HELD_MS)))  # type: ignore[arg-type]
    assert asked["lease_ms"] == 500
    asyncio.run(scene(Hub(Link(rig), 10_000)))  # type: ignore[arg-type]
    assert asked["lease_ms"] == 10_000


def test_a_page_that_is_not_heard_is_not_there_though_the_loop_stands_still(
    monkeypatch: Any,
) -> None:
    now_s = 100.0
    monkeypatch.setattr(control, "time", SimpleNamespace(monotonic=lambda: now_s))
    asked: dict[str, Any] = {}
    lease = SimpleNamespace(loss=None, disarm=lambda: None)
    rig = SimpleNamespace(arm=lambda **how: asked.update(how) or lease, close=lambda: None)

    async def scene() -> None:
        nonlocal now_s
        arming = Arming(Hub(Link(rig), HELD_MS), "page", ignore, forget)  # type: ignore[arg-type]
        await arming.arm(PageArmRequest(op="arm", rig="rig1", lease_ms=500))
        there = asked["still_there"]
        now_s += 0.4
        assert there()
        now_s += 0.2  # nothing else has had its turn
        assert not there()
        arming.hear()
        assert there()
        await arming.close()

    asyncio.run(scene())


def test_a_fault_at_the_end_keeps_no_other_part_open(monkeypatch: Any) -> None:
    ended: list[str] = []

    async def fail(_: Arming) -> None:
        ended.append("arming")
        raise RuntimeError("unforeseen")

    async def note_stream(_: Rendering) -> None:
        ended.append("rendering")

    async def note_finger(_: Pointing) -> None:
        ended.append("pointing")

    monkeypatch.setattr(Arming, "close", fail)
    monkeypatch.setattr(Rendering, "close", note_stream)
    monkeypatch.setattr(Pointing, "lift", note_finger)
    said = [{"type": "websocket.receive", "text": '{"op":"hello","version":1}'}]

    async def receive() -> dict[str, Any]:
        return said.pop() if said else {"type": "websocket.disconnect", "code": 1001}

    async def scene() -> None:
        hub = Hub(Link(), HELD_MS)  # type: ignore[arg-type]
        socket: Any = SimpleNamespace(
            receive=receive, send_text=ignore, application_state=WebSocketState.CONNECTED
        )
        with pytest.raises(RuntimeError, match="unforeseen"):
            await Conversation(socket, hub, (), ConnectedPages()).serve()
        await hub.close()

    asyncio.run(scene())
    assert ended == ["arming", "rendering", "pointing"]


def test_a_stream_ends_whatever_a_call_ended_with() -> None:
    stream = Stream()

    def fail(*_: Any) -> Any:
        raise RuntimeError("unforeseen")

    rig = SimpleNamespace(open_stream=lambda peak_n: stream, set_scene=fail, close=lambda: None)

    async def scene() -> None:
        rendering = Rendering(Hub(Link(rig), HELD_MS), "page", ignore)  # type: ignore[arg-type]
        calls = asyncio.create_task(rendering.run_calls())
        rendering.call(OpenStream(op="open_stream", rig="rig1", peak_n=0.1))
        while rendering.progress() is None:
            await asyncio.sleep(0.01)
        frame = StreamFrame(1, 2**63, 0, 500, 2.0, True, 0.0, np.zeros(2, np.float32))
        with pytest.raises(RefusedViewerError, match="sequence 9223372036854775808"):
            rendering.update(frame.pack())  # `progress` could not tell it
        rendering.call(SetScene(op="set_scene", rig="rig1", scene=Scene()))
        with pytest.raises(RuntimeError, match="unforeseen"):
            await calls
        await rendering.close()

    asyncio.run(scene())
    assert stream.closed


def test_a_refusal_that_nobody_waits_for_is_no_fault_in_the_log() -> None:
    begun, ends = threading.Event(), threading.Event()
    faults: list[dict[str, Any]] = []

    def refuse(peak_n: float) -> Any:
        begun.set()
        assert ends.wait(10.0)
        raise RefusedError("not_armed", "arm first")

    rig = SimpleNamespace(open_stream=refuse, close=lambda: None)

    async def scene() -> None:
        asyncio.get_running_loop().set_exception_handler(lambda _, fault: faults.append(fault))
        rendering = Rendering(Hub(Link(rig), HELD_MS), "page", ignore)  # type: ignore[arg-type]
        calls = asyncio.create_task(rendering.run_calls())
        rendering.call(OpenStream(op="open_stream", rig="rig1", peak_n=0.1))
        await asyncio.to_thread(begun.wait, 10.0)
        calls.cancel()  # the page has gone
        closing = asyncio.create_task(rendering.close())
        await asyncio.sleep(0)
        ends.set()
        await closing

    asyncio.run(scene())
    gc.collect()  # of what nobody has looked at
    assert faults == []


def test_each_part_that_sends_finds_a_page_gone_that_broke_off() -> None:
    async def receive() -> Message:
        return {"type": "websocket.connect"}

    async def send(message: Message) -> None:
        if message["type"] == "websocket.send":
            raise ConnectionResetError

    async def scene() -> None:
        socket = WebSocket({"type": "websocket", "headers": []}, receive, send)
        await socket.accept()
        hub = Hub(Link(), HELD_MS)  # type: ignore[arg-type]
        conversation = Conversation(socket, hub, (), ConnectedPages())
        for message in ("first", b"second"):
            with pytest.raises(WebSocketDisconnect):
                await conversation._send(message)

    asyncio.run(scene())

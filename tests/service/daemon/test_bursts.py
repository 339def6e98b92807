"""What callbacks decide: whatever somebody else sends before, and however much of it."""

import json
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import pytest
import zenoh

from frictus.keys import RigKeys, Topics
from frictus.stream import MAX_FRAME_BYTES
from frictus.textures import Region
from frictus_hardware.physics.screen import Screen
from frictus_service.command_validation import SHORT_BYTES
from frictus_service.daemon.commands import UNNAMED_BYTES, _name_in
from frictus_service.daemon.inboxes import IncomingCommand
from frictus_service.synthesis.layers import Layer, layers_of

from .desk import SCENE, TEXTURE, Desk

KEYS = RigKeys("here", "rig1")
BURST = 1_000


@dataclass
class Query:
    """A query as callbacks see it; nothing is sent."""

    payload: Any
    attachment: zenoh.ZBytes | None = None


@dataclass
class Sample:
    key_expr: str
    payload: zenoh.ZBytes = field(default_factory=lambda: zenoh.ZBytes(b""))
    attachment: zenoh.ZBytes | None = None
    kind: Any = field(default_factory=lambda: zenoh.SampleKind.PUT)


class Session:
    """Keeps the callbacks that are declared."""

    def __init__(self) -> None:
        self.callbacks: dict[str, Callable[[Any], Any]] = {}

    def liveliness(self) -> "Session":
        return self

    def declare_queryable(self, key: str, post: Any, **_options: Any) -> None:
        self.callbacks[key] = post

    def declare_subscriber(self, key: str, post: Any, **_options: Any) -> None:
        self.callbacks[key] = post


class Wired(Desk):
    """A desk whose messages come by callbacks; no thread works through its boxes."""

    def __post_init__(self) -> None:
        super().__post_init__()
        session = Session()
        self.commands.declare(session, KEYS)  # type: ignore[arg-type]
        self.callbacks = session.callbacks

    def post(self, name: str, client: str, payload: bytes | None = None, **fields: Any) -> None:
        if payload is None:
            payload = json.dumps({"client": client, "utc_ns": self.utc_ns, **fields}).encode()
        query = Query(zenoh.ZBytes(payload), zenoh.ZBytes(client))
        self.callbacks[KEYS.call(name)](query)

    def put(self, topic: Any, payload: bytes) -> None:
        self.callbacks[KEYS.of(topic)](Sample(KEYS.of(topic), zenoh.ZBytes(payload)))

    def token(self, client: str, kind: zenoh.SampleKind) -> None:
        sample = Sample(KEYS.client_alive(client), kind=kind)
        self.callbacks[KEYS.any_client_alive](sample)


@pytest.fixture
def desk() -> Wired:
    desk = Wired()
    desk.post("arm", "ann", lease_ms=10_000)
    assert desk.interlock.state.owner == "ann"
    return desk


def renewal(desk: Wired, client: str) -> bytes:
    return json.dumps({"client": client, "utc_ns": desk.utc_ns}).encode()


def test_an_owner_that_vanishes_in_a_crowd_is_noticed(desk: Wired) -> None:
    desk.token("ann", zenoh.SampleKind.DELETE)
    for number in range(BURST):
        desk.token(f"client{number}", zenoh.SampleKind.DELETE)
    assert desk.interlock.state.state == "stopping"


@pytest.mark.parametrize("name", ["stop", "disarm"])
def test_a_burst_of_calls_pushes_out_no_stop_and_no_disarm(desk: Wired, name: str) -> None:
    desk.post(name, "ann")
    for number in range(BURST):
        desk.post("arm", f"ben{number % 7}", b"{}")
        desk.post("disarm", "ben")
    assert desk.interlock.state.state == "stopping"


def test_a_burst_of_renewals_pushes_out_no_renewal(desk: Wired) -> None:
    desk.now_s += 5.0
    desk.put(Topics.LEASE, renewal(desk, "ann"))
    for _ in range(BURST):
        desk.put(Topics.LEASE, renewal(desk, "ben"))
    assert desk.interlock.state.lease_until_s == desk.now_s + 10.0


def test_a_strangers_updates_push_out_no_update(desk: Wired) -> None:
    ticket = desk.call("open_stream", peak_n=0.06).ticket
    assert ticket is not None
    desk.put(Topics.TEXTURE, desk.frame(ticket))
    for _ in range(BURST):
        desk.put(Topics.TEXTURE, desk.frame(ticket + 1))
        desk.put(Topics.TEXTURE, b"x" * 100_000)
    assert desk.commands.updates_lost == 0
    assert desk.commands.refused == 2 * BURST


@dataclass
class Unread:
    """A payload that must be refused for its length or its sender."""

    size_bytes: int

    def __len__(self) -> int:
        return self.size_bytes

    def to_bytes(self) -> bytes:
        raise AssertionError("it was read")


def test_a_strangers_scene_is_refused_before_it_is_copied(desk: Wired) -> None:
    query = Query(Unread(2_000_000), zenoh.ZBytes("ben"))
    desk.callbacks[KEYS.call("scene")](query)
    assert desk.commands.refused == 1


@pytest.mark.parametrize(
    ("name", "most"),
    [
        ("texture", MAX_FRAME_BYTES),
        ("pointer", SHORT_BYTES),
        ("guidance", UNNAMED_BYTES),
    ],
)
def test_a_long_message_is_refused_before_it_is_copied(name: str, most: int) -> None:
    desk = Wired()
    post = getattr(desk.commands, f"_post_{name}")
    post(Sample(name, Unread(most + 1)))  # type: ignore[arg-type]
    assert desk.commands.refused == 1
    with pytest.raises(AssertionError, match="it was read"):
        post(Sample(name, Unread(most)))  # type: ignore[arg-type]


@pytest.mark.parametrize("name", ["scene", "model", "excite"])
@pytest.mark.parametrize("attachment", [None, zenoh.ZBytes(b"x" * 1_000)])
def test_a_large_call_that_names_no_sender_is_refused_unread(
    name: str, attachment: zenoh.ZBytes | None
) -> None:
    desk = Wired()  # disarmed: anybody may
    desk.callbacks[KEYS.call(name)](Query(Unread(UNNAMED_BYTES + 1), attachment))
    assert desk.commands.refused == 1
    with pytest.raises(AssertionError, match="it was read"):
        desk.callbacks[KEYS.call(name)](Query(Unread(UNNAMED_BYTES), attachment))


def test_a_newer_scene_of_the_same_sender_ends_the_older_ones_compilation(
    desk: Wired, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun = []

    def layers(region: Region, screen: Screen) -> list[Layer]:
        begun.append(region.name)
        if len(begun) == 1:
            desk.post("scene", "ann", scene={"regions": [{"texture": TEXTURE, "name": "new"}]})
        return layers_of(region, screen)

    monkeypatch.setattr("frictus_service.synthesis.scene.layers_of", layers)
    old = {"texture": TEXTURE, "name": "old"}
    desk.post("scene", "ann", scene={"regions": [old]})
    desk.post("scene", "ann", scene={"regions": [old, old]})
    replies = []
    for _ in range(3):
        taken = desk.commands._rendering.take()
        assert taken is not None
        replies.append(desk.commands.render(taken[1]))
    assert begun == ["old", "new"]
    assert [reply.code for reply in replies] == ["unavailable", "unavailable", None]
    assert "newer" in replies[0].message
    assert desk.stage.scene.etag == replies[2].etag


def test_a_scene_ends_nobody_elses_compilation() -> None:
    desk = Wired()
    desk.post("scene", "ann", scene=SCENE)
    desk.post("scene", "ben", scene=SCENE)
    desk.post("open_stream", "ann", peak_n=0.1)
    taken = desk.commands._rendering.take()
    assert taken is not None
    assert desk.commands.render(taken[1]).ok


def test_a_name_that_is_not_the_attachments_is_refused(desk: Wired) -> None:
    request = {"client": "ann", "utc_ns": desk.utc_ns, "scene": SCENE}
    message = IncomingCommand("scene", json.dumps(request).encode(), "ben")
    reply = desk.commands.render(message)
    assert reply.code == "bad_request"
    assert "'ben'" in reply.message


def test_who_stops_is_named_only_by_a_name() -> None:
    assert _name_in(zenoh.ZBytes(b"ann.rest")) == "ann.rest"
    assert _name_in(zenoh.ZBytes(b"\x1b[31mann\nrig1 tripped")) == ""

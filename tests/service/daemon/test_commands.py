"""Commands: who may do what, and how old it may be."""

from typing import Any, cast

import pytest

from frictus.messages import Reply
from frictus_service.config import Limits
from frictus_service.daemon.commands import ANSWERING
from frictus_service.daemon.inboxes import IncomingCommand
from frictus_service.daemon.safety import FaultRaised

from .desk import SCENE, Desk


def test_a_session_from_arm_to_disarm(desk: Desk) -> None:
    assert desk.call("arm", lease_ms=1_000).state == "armed"
    scene = desk.call("scene", scene=SCENE)
    assert scene.ok
    assert scene.applied is not None
    assert scene.etag == desk.stage.scene.etag
    ticket = desk.call("open_stream", peak_n=0.06).ticket
    assert ticket is not None
    assert desk.send("texture", desk.frame(ticket)).ok
    assert desk.stage.scene.source == "stream"
    assert desk.orders.scene[-1].until_s == pytest.approx(desk.now_s + 0.2)
    assert desk.call("close_stream").ok
    assert desk.stage.scene.etag == scene.etag
    assert desk.call("disarm").state == "stopping"
    assert desk.commands.refused == 0


@pytest.mark.parametrize("name", ["disarm", "scene", "close_stream", "lease", "arm"])
def test_others_are_refused_while_armed(desk: Desk, name: str) -> None:
    desk.call("arm")
    reply = desk.call(name, "ben", scene=SCENE)
    assert (reply.ok, reply.code, reply.state) == (False, "not_owner", "armed")
    assert "ann" in reply.message


@pytest.mark.parametrize("guest", ["ben", "cy", "cy.rest", "cy.page-7c2e41"])
def test_whom_the_owner_names_may_change_what_is_rendered_and_nothing_else(
    desk: Desk, guest: str
) -> None:
    desk.call("arm", share_with=["ben", "cy"])
    assert desk.call("scene", guest, scene=SCENE).ok
    ticket = desk.call("open_stream", guest, peak_n=0.06).ticket
    assert ticket is not None
    assert desk.send("texture", desk.frame(ticket)).ok
    assert desk.call("close_stream", guest).ok
    assert desk.call("excite", guest, excitation={"bias": 0.4}).ok
    for name in ("arm", "disarm", "lease"):
        assert desk.call(name, guest).code == "not_owner"
    desk.call("disarm")
    assert not desk.interlock.state.share_with


@pytest.mark.parametrize("name", ["scene", "open_stream", "close_stream", "excite", "model"])
@pytest.mark.parametrize("stranger", ["ben.smith.rest", "benny", "dan", "be"])
def test_whom_the_owner_does_not_name_is_told_who_holds_the_rig_and_what_to_do(
    desk: Desk, name: str, stranger: str
) -> None:
    desk.call("arm", share_with=["ben", "cy"])
    model = desk.models.model.model.model_dump(mode="json", by_alias=True)
    fields = {"scene": SCENE, "peak_n": 0.06, "excitation": {"bias": 0.4}, "model": model}
    reply = desk.call(name, stranger, **fields)
    assert reply.code == "not_owner"
    assert "'ann' holds the rig" in reply.message
    assert "share_with" in reply.message


def test_arming_anew_shares_with_others(desk: Desk) -> None:
    desk.call("arm", share_with=["ben"])
    desk.call("arm", share_with=["cy"])
    assert desk.call("scene", "ben", scene=SCENE).code == "not_owner"
    assert desk.call("scene", "cy", scene=SCENE).ok


def test_anybody_may_set_a_scene_while_disarmed(desk: Desk) -> None:
    assert desk.call("scene", "ben", scene=SCENE).ok


def test_who_changed_what_last_is_known_and_who_was_refused_is_not(desk: Desk) -> None:
    assert not desk.commands.last_calls
    desk.call("arm", share_with=["ben"])
    for client in ("ann", "ben", "cy"):  # the last one may not
        desk.call("scene", client, scene=SCENE)
        desk.call("compensation", client, compensation={"mode": "none"})
    desk.interlock.feed(FaultRaised("safety", "too much force"), desk.now_s)
    desk.call("reset", "cy")
    told = {name: made.client for name, made in desk.commands.last_calls.items()}
    assert told == {"scene": "ben", "compensation": "ben", "reset": "cy"}
    # Nothing is driven: it is known all the same.
    assert desk.commands.keep_safe(IncomingCommand("stop", b"", sender="dan")).ok
    assert desk.commands.last_calls["stop"].client == "dan"


def test_a_change_is_never_seen_without_whose_it_is(
    desk: Desk, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen = []
    replace = desk.stage.compensate

    def watched(request: Any) -> Any:
        reply = replace(request)
        seen.append(desk.commands.last_calls["compensation"].client)
        return reply

    monkeypatch.setattr(desk.stage, "compensate", watched)
    desk.call("arm", share_with=["ben"])
    reply = desk.call("compensation", "ben", compensation={"mode": "none"})
    assert reply.ok, reply.message
    assert seen == ["ben"]


def test_answers_that_a_full_box_loses_are_counted(desk: Desk) -> None:
    asked = IncomingCommand("arm", sender="ann", query=cast(Any, object()))
    for _ in range(ANSWERING["answer"] + 36):
        desk.commands._to_answer(asked, Reply(ok=True))
    assert desk.commands.refused == 36


@pytest.mark.parametrize("payload", [b"", b"\xff\xfe", b'{"client": "ben", "utc_ns": 0}'])
def test_stop_always_stops(desk: Desk, payload: bytes) -> None:
    desk.call("arm")
    assert desk.send("stop", payload).state == "stopping"


def test_tripped_rig_says_what_to_do(desk: Desk) -> None:
    desk.interlock.feed(FaultRaised("safety", "monitor off"), desk.now_s)
    reply = desk.call("arm")
    assert (reply.code, reply.state) == ("tripped", "tripped")
    assert "monitor off" in reply.message
    assert "reset" in reply.message
    assert desk.call("reset").state == "disarmed"


@pytest.mark.parametrize(
    ("age_s", "ttl_ms"), [(1.1, 1_000), (0.3, 200), (6.0, 60_000), (-0.6, 1_000)]
)
def test_command_out_of_its_time_is_stale(desk: Desk, age_s: float, ttl_ms: int) -> None:
    made = desk.utc_ns - round(1e9 * age_s)
    reply = desk.call("arm", utc_ns=made, ttl_ms=ttl_ms)
    assert (reply.code, reply.state) == ("stale", "disarmed")
    assert "NTP" in reply.message


def test_longer_leases_than_granted_are_refused() -> None:
    desk = Desk(Limits(max_lease_ms=1_000))
    assert desk.call("arm", lease_ms=2_000).code == "bad_request"

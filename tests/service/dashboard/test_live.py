"""Pages at a real simulated rig: what they see moves, and none is in another's way."""

import contextlib
import http.client
import json
import re
import subprocess
import sys
import time
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from tests.service.dashboard.page import SECRETS, Page, configuration, page_at, serving
from websockets.exceptions import ConnectionClosed, InvalidStatus

import frictus
from frictus.keys import STREAMS, Topics
from frictus.messages import EstimateState
from frictus.session import declare_latest_publisher
from frictus.websocket.frames import Frame, Kind

DOCS = Path(__file__).parents[3] / "docs" / "websocket.md"
NAMES = {topic.suffix.removeprefix("stream/"): number for number, topic in STREAMS.items()}


def test_a_page_sees_the_rig(port: int) -> None:
    with page_at(port, who="read") as page:
        welcome = page.told[0]
        assert (welcome["version"], welcome["scopes"], welcome["site"]) == (1, ["read"], "lab")
        assert page.wait("rigs", lambda told: told["rigs"] == ["rig1"])["link"] is True
        page.say("watch", rig="rig1", streams=["force"])
        assert page.wait("status")["status"]["simulated"] is True
        seen = {"status"}
        while seen < {"status", "scene", "model", "finger"}:
            message = page.read()
            if isinstance(message, dict):
                assert message["rig"] == "rig1"
                assert message["op"] in message
                seen.add(message["op"])
        page.say("ping", id=12)
        page.wait("pong", lambda pong: pong["id"] == 12)


@pytest.mark.parametrize("kind", ["page", "participant"])
def test_others_read_in_front_of_whom_a_page_is(port: int, kind: str) -> None:
    with page_at(port, hello=False) as page:
        asked = {} if kind == "page" else {"page": kind}
        page.say("hello", version=1, token=SECRETS["read"], **asked)
        assert re.fullmatch(rf"read\.{kind}-[0-9a-f]{{6}}", page.wait("welcome")["client"])


def test_an_estimate_is_passed_on_also_to_who_comes_late(port: int, router: str) -> None:
    with page_at(port, who="read") as page:
        page.say("watch", rig="rig1")
        page.wait("finger")
        page.wait("finger")
        assert not [told for told in page.told if told["op"] == "estimate"]  # nothing tracks
        with frictus.connect(router, name="tracker") as client:
            key = client.rig("rig1").keys.of(Topics.ESTIMATE)
            publisher = declare_latest_publisher(client.session, key, Topics.ESTIMATE)
            state = EstimateState(utc_ns=1, run=3, windows=0, refused={"nothing plays": 4})
            publisher.put(state.to_json())
            assert page.wait("estimate")["estimate"] == json.loads(state.to_json())
            with page_at(port, who="read") as late:
                late.say("watch", rig="rig1")
                told = late.wait("estimate")
                assert (told["rig"], told["estimate"]["run"]) == ("rig1", 3)
            publisher.undeclare()  # type: ignore[no-untyped-call]


@pytest.mark.parametrize("raw", [True, False])
def test_frames_follow_one_another(port: int, raw: bool) -> None:
    streams = ["force", "accel", "voltage", "truth"]
    with page_at(port, who="read") as page:
        page.say("watch", rig="rig1", streams=streams, raw=raw, window_s=1.0, columns=500)
        while len(page.frames) < 80:
            page.read()
        for name in streams:
            frames = [frame for frame in page.frames if frame.stream == NAMES[name]]
            assert len(frames) > 10
            assert frames[0].lost_samples == 0
            for before, after in pairwise(frames):
                assert after.run == before.run
                assert after.first_sample == before.next_sample + after.lost_samples
            kind = Kind.RAW if raw else Kind.EXTREMES
            assert {frame.kind for frame in frames} == {kind}
            # 20 kHz over 500 columns of one second
            assert {frame.samples_per_column for frame in frames} == {1 if raw else 40}
            if not raw:
                assert all((frame.data[:, 0] <= frame.data[:, 1]).all() for frame in frames)


def test_a_new_watch_takes_the_place_of_the_old(port: int) -> None:
    with page_at(port, who="read") as page:
        page.say("watch", rig="rig1", streams=["force"])
        page.frame()
        page.say("watch", rig="rig1", streams=["voltage"], columns=16, window_s=0.01)
        frame = page.frame(lambda frame: frame.stream == NAMES["voltage"])
        assert frame.samples_per_column == 13
        for _ in range(20):
            assert page.frame().stream == NAMES["voltage"]
        page.say("watch", rig=None)
        page.say("ping", id=1)
        page.wait("pong")
        page.say("ping", id=2)
        pong = page.read()
        assert isinstance(pong, dict)
        assert (pong["op"], pong["id"]) == ("pong", 2)


def test_a_stream_that_is_watched_still_goes_on_without_a_gap(port: int) -> None:
    asked = {"rig": "rig1", "raw": True, "fingers": True}
    with page_at(port, who="read") as page:
        page.say("watch", streams=["force"], **asked)
        page.frame(lambda frame: frame.stream == NAMES["force"])
        page.frame(lambda frame: frame.kind == Kind.FINGER)
        page.say("watch", streams=["force", "accel"], **asked)
        page.frame(lambda frame: frame.stream == NAMES["accel"])
        page.frame(lambda frame: frame.kind == Kind.FINGER)
        page.say("watch", streams=["force"], **asked)
        page.wait("status")  # told anew with each watch
        for _ in range(10):
            page.frame(lambda frame: frame.stream == NAMES["force"])
        force = [frame for frame in page.frames if frame.stream == NAMES["force"]]
        for before, after in pairwise(force):
            assert after.first_sample == before.next_sample + after.lost_samples
        states = [frame for frame in page.frames if frame.kind == Kind.FINGER]
        of_each = [frame.first_sample + frame.data[0] for frame in states]
        for samples, following, frame in zip(of_each, of_each[1:], states[1:], strict=False):
            assert following[0] - samples[-1] == 100 * (1 + frame.lost_samples)  # a block apart


def test_the_rate_is_the_page_s(port: int) -> None:
    with page_at(port, who="read") as page:
        page.say("watch", rig="rig1", streams=["force"], rate_hz=5.0, raw=True)
        frames = [page.frame() for _ in range(5)]
        # By the rig's own clock, five a second: each holds a fifth of a second.
        samples = [
            after.first_sample - before.first_sample for before, after in pairwise(frames)
        ]
        # A busy machine is late once, and catches up.
        assert sorted(samples)[1] >= 3_000
        assert sum(samples) >= 4 * 3_000


def test_a_page_that_reads_nothing_is_in_nobody_s_way(port: int) -> None:
    streams = ["force", "accel", "voltage", "truth"]
    with page_at(port, who="read", max_queue=1) as stuck, page_at(port, who="read") as page:
        stuck.say("watch", rig="rig1", streams=streams, raw=True)
        page.say("watch", rig="rig1", streams=["force"])
        first = page.frame()
        last = page.frame(lambda frame: frame.first_sample > first.first_sample + 30_000)
        assert sum(frame.lost_samples for frame in page.frames) == 0
        assert last.run == first.run
        stuck.connection.close_socket()  # what it was sent and did not read goes nowhere


def test_the_pointer_moves_the_finger(port: int) -> None:
    with page_at(port, who="render") as page:
        page.say("watch", rig="rig1", streams=["truth"])
        page.wait("status")
        place = {"x_mm": 20.0, "y_mm": 30.0, "normal_force_n": 1.0}

        def arrived(frame: Frame) -> bool:
            page.say("point", **place)
            x_mm, y_mm = frame.data[:2, 1, -1]
            return bool(abs(x_mm - place["x_mm"]) < 0.5 and abs(y_mm - place["y_mm"]) < 0.5)

        page.frame(arrived)
        page.wait("finger", lambda told: told["finger"]["in_contact"])
        assert not [told for told in page.told if told["op"] == "refused"]
    with page_at(port, who="read") as page:  # the finger is lifted when its page is gone
        page.say("watch", rig="rig1")
        page.wait("finger", lambda told: not told["finger"]["in_contact"])


def refused(port: int, *says: str | bytes, who: str | None = "read") -> tuple[str, int]:
    """Return with which code a page is refused, and with which its connection is closed."""
    with page_at(port, hello=who is not None, who=who) as page:
        for said in says:
            page.connection.send(said)
        told = page.wait("refused")
        assert told["message"]
        with pytest.raises(ConnectionClosed) as closed:
            page.read()
        assert closed.value.rcvd is not None
        assert closed.value.rcvd.reason
        return told["code"], closed.value.rcvd.code


HELLO = '{"op":"hello","version":1%s}'


@pytest.mark.parametrize(
    ("said", "code"),
    [
        (HELLO % "", ("unauthenticated", 1008)),
        (HELLO % ',"token":null', ("unauthenticated", 1008)),
        (HELLO % ',"token":"not-a-token-of-anybody"', ("unauthenticated", 1008)),
        (HELLO % f',"token":"{SECRETS["admin"]}"', ("missing_scope", 1008)),
        ('{"op":"watch","rig":"rig1"}', ("no_hello", 1003)),
        ("{", ("malformed", 1003)),
        (b"\0" * 100, ("malformed", 1003)),
    ],
)
def test_who_does_not_say_who_it_is_sees_nothing(
    port: int, said: str | bytes, code: tuple[str, int]
) -> None:
    assert refused(port, said, who=None) == code


@pytest.mark.parametrize(
    ("said", "code"),
    [
        ('{"op":"point","x_mm":1,"y_mm":1}', ("missing_scope", 1008)),
        (HELLO % "", ("malformed", 1003)),
        ('{"op":"arm","rig":"rig1"}', ("missing_scope", 1008)),
        ('{"op":"arm me"}', ("malformed", 1003)),
        (b"{}", ("missing_scope", 1008)),  # only who may render sends updates
        ("[" * 60_000, ("malformed", 1003)),
    ],
)
def test_malformed_and_forbidden_end_the_connection_and_no_other(
    port: int, said: str | bytes, code: tuple[str, int]
) -> None:
    with page_at(port, who="read") as page:
        page.say("watch", rig="rig1", streams=["force"])
        page.frame()
        assert refused(port, said) == code
        for _ in range(10):
            assert page.frame().lost_samples == 0


def test_oversized_messages_end_the_connection(port: int) -> None:
    with page_at(port, who="read") as page:
        page.connection.send(" " * 70_000)
        with pytest.raises(ConnectionClosed) as closed:
            page.wait("never")
        assert closed.value.rcvd is not None
        assert closed.value.rcvd.code == 1009


def test_no_rig_to_point_at_is_said(port: int) -> None:
    with page_at(port, who="render") as page:
        page.say("point", x_mm=1.0, y_mm=1.0)
        assert page.wait("refused")["code"] == "no_rig"
        page.say("watch", rig="nowhere")
        assert page.wait("lost")["rig"] == "nowhere"
        page.say("point", x_mm=1.0, y_mm=1.0)
        assert page.wait("refused")["code"] == "no_rig"


@pytest.mark.parametrize("origin", ["http://evil.example", "null", "http://127.0.0.1:1"])
def test_other_origins_are_refused_before_anything_is_said(port: int, origin: str) -> None:
    with pytest.raises(InvalidStatus) as refused:
        with page_at(port, hello=False, origin=origin):
            pass
    assert refused.value.response.status_code == 403


def test_other_hosts_are_refused(port: int) -> None:
    headers = {"Origin": "http://rebound.example"}
    with pytest.raises(InvalidStatus) as refused:
        with page_at(
            port, hello=False, additional_headers=headers | {"Host": "rebound.example"}
        ):
            pass
    assert refused.value.response.status_code in (400, 403, 421)


def test_its_own_page_is_let_in(port: int) -> None:
    with page_at(port, who="read", origin=f"http://127.0.0.1:{port}") as page:
        page.wait("rigs")


def armed(told: Any) -> bool:
    return bool(told["status"]["state"] == "armed")


def disarmed(told: Any) -> bool:
    return bool(told["status"]["state"] == "disarmed" and told["status"]["owner"] is None)


def test_a_page_arms_and_gives_back(port: int) -> None:
    with page_at(port, who="read") as other, page_at(port, who="render") as page:
        other.say("watch", rig="rig1")
        page.say("arm", rig="rig1")
        page.wait("armed", lambda told: told["rig"] == "rig1")
        owner = other.wait("status", armed)["status"]["owner"]
        with page_at(port, who="render") as third:
            assert page.told[0]["client"] == owner != third.told[0]["client"]
            third.say("arm", rig="rig1")
            told = third.wait("refused")
            assert told["code"] == "not_owner"
            assert told["message"].startswith("render's page holds the rig")
            third.say("disarm", rig="rig1")
            assert third.wait("refused")["code"] == "not_owner"
        page.say("arm", rig="rig1")
        assert page.wait("refused")["code"] == "conflict"
        page.say("disarm", rig="rig1")
        told = page.wait("disarmed")
        assert (told["rig"], told["reason"]) == ("rig1", "")
        other.wait("status", disarmed)


@pytest.mark.parametrize("goes", ["closes", "breaks", "malformed"])
def test_a_rig_is_given_back_with_its_page(port: int, goes: str) -> None:
    with page_at(port, who="read") as other:
        other.say("watch", rig="rig1")
        with page_at(port, who="render") as page:
            page.say("arm", rig="rig1")
            page.wait("armed")
            other.wait("status", armed)
            if goes == "breaks":
                page.connection.socket.close()
            elif goes == "malformed":
                page.connection.send("?")
                page.wait("refused")
        other.wait("status", disarmed)


def test_a_silent_page_keeps_no_rig(port: int) -> None:
    with page_at(port, who="render") as page:
        page.say("arm", rig="rig1")
        page.wait("armed")
        assert "nothing" in page.wait("disarmed")["reason"]
        page.say("ping", id=1)
        page.wait("pong")


def test_a_stop_by_anybody_ends_the_lease(port: int, router: str) -> None:
    with page_at(port, who="render") as page:
        page.say("arm", rig="rig1")
        page.say("watch", rig="rig1")
        page.wait("status", armed)
        with frictus.connect(router, name="bystander") as client:
            client.rig("rig1").stop()
        page.say("ping", id=1)  # else its silence may end the lease first
        assert "stopped by 'bystander'" in page.wait("disarmed")["reason"]


def ask(
    port: int, method: str, path: str, who: str, page: Page | None = None, body: object = None
) -> tuple[int, Any]:
    """Return status and body of what REST answers, asked as a page where one is given."""
    headers = {"Authorization": f"Bearer {SECRETS[who]}", "If-Match": "*"}
    if page is not None:
        headers["Frictus-Page"] = page.told[0]["key"]
    if body is not None:
        headers["Content-Type"] = "application/json"
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=60.0)
    with contextlib.closing(connection):
        text = None if body is None else json.dumps(body)
        connection.request(method, f"/v1/rigs/rig1/{path}", text, headers)
        answer = connection.getresponse()
        return answer.status, json.loads(answer.read())


def put_scene(
    port: int, name: str, who: str = "render", page: Page | None = None
) -> tuple[int, Any]:
    """Put a scene; while the API's link to the router is being made anew, wait for the rig."""
    until_s = time.monotonic() + 30.0
    while True:
        status, answer = ask(port, "PUT", "scene", who, page, {"name": name})
        if status != 404 or time.monotonic() > until_s:
            return status, answer


def test_only_the_page_that_holds_the_rig_changes_what_is_felt(port: int) -> None:
    with (
        page_at(port, who="render") as page,
        page_at(port, who="render") as other,
        page_at(port, who="guest") as guest,
    ):
        assert put_scene(port, "before", "guest")[0] == 200  # nobody holds it
        page.say("watch", rig="rig1")
        page.say("arm", rig="rig1")
        page.wait("armed")
        for who, asking in (
            ("guest", None),
            ("guest", guest),
            ("guest", page),  # its key is of no use to another person
            ("render", None),
            ("render", other),
        ):
            status, problem = put_scene(port, "theirs", who, asking)
            assert (status, problem["code"]) == (409, "not_owner")
            assert problem["detail"].startswith("render's page holds the rig")
            assert "share_with" in problem["detail"]
            page.say("ping", id=1)  # else its silence may end the lease
        assert put_scene(port, "mine", page=page)[0] == 200
        scene = page.wait("scene", lambda told: told["scene"]["scene"]["name"] != "before")
        assert scene["scene"]["scene"]["name"] == "mine"


def test_the_page_that_holds_the_rig_shares_it_by_name(port: int) -> None:
    with page_at(port, who="render") as page, page_at(port, who="guest") as guest:
        page.say("watch", rig="rig1")
        page.say("arm", rig="rig1", share_with=["guest"])
        page.wait("armed")
        told = page.wait("status", armed)["status"]
        assert (told["owner"], told["share_with"]) == (page.told[0]["client"], ["guest"])
        assert put_scene(port, "a script's", "guest")[0] == 200
        page.say("ping", id=1)
        assert put_scene(port, "a page's", "guest", guest)[0] == 200
        page.say("ping", id=2)
        assert put_scene(port, "another of mine")[1]["code"] == "not_owner"
        page.say("disarm", rig="rig1")
        assert page.wait("status", disarmed)["status"]["share_with"] == []


def test_a_stream_of_whom_the_rig_is_shared_with_ends_with_the_page_s_lease(
    port: int, router: str
) -> None:
    with page_at(port, who="render") as page, frictus.connect(router, name="ben") as client:
        rig = client.rig("rig1")
        with pytest.raises(frictus.RefusedError, match="arm the rig"):
            rig.open_stream(0.05)
        page.say("arm", rig="rig1", share_with=["ben"])
        page.wait("armed")
        stream = rig.open_stream(0.05)
        stream.send([0.02, -0.02], period_mm=2.0)
        rig.scene()  # the rig has said that it plays it
        stream.send([0.02, -0.02], period_mm=2.0)
        page.say("disarm", rig="rig1")
        page.wait("disarmed")

        def play_on() -> None:
            while True:
                stream.send([0.02, -0.02], period_mm=2.0)

        with pytest.raises(frictus.LeaseLostError, match="disarmed by render's page"):
            play_on()


def test_who_stops_a_page_s_rig_by_rest_is_named(port: int) -> None:
    with page_at(port, who="render") as page:
        page.say("watch", rig="rig1")
        page.say("arm", rig="rig1")
        page.wait("armed")
        assert ask(port, "POST", "stop", "read")[0] == 200
        page.say("ping", id=1)
        assert "stopped by read's REST client" in page.wait("disarmed")["reason"]
        ended = page.wait("status", disarmed)["status"]["last_end"]
        assert (ended["owner"], ended["by"]) == (page.told[0]["client"], "read.rest")


def test_no_rig_to_arm_is_said(port: int) -> None:
    with page_at(port, who="render") as page:
        page.say("arm", rig="nowhere")
        assert page.wait("refused")["code"] == "no_rig"


def test_the_server_ends_with_pages_connected(router: str, tmp_path: Path) -> None:
    with serving(configuration(router, tmp_path, False)) as port:
        with page_at(port) as page, page_at(port) as idle, page_at(port, hello=False):
            page.say("watch", rig="rig1", streams=["force"])
            page.frame()
            assert idle.told
            ended_s = time.monotonic()
    assert time.monotonic() - ended_s < 15.0


def test_the_example_in_the_docs_runs(port: int) -> None:
    example = DOCS.read_text(encoding="utf-8").split("```python\n")[1].split("```")[0]
    example = example.replace("8420", str(port)).replace("None})", f'"{SECRETS["read"]}"}})')
    command = [sys.executable, "-u", "-c", example]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline() == "welcome\n"
            while not process.stdout.readline().startswith("1 ["):
                assert process.poll() is None
        finally:
            process.kill()

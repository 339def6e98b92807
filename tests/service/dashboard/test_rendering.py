"""Programs at `/v1/live`: they set scenes, stream textures and read the finger's states."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from tests.service.dashboard.page import Page, page_at
from websockets.exceptions import ConnectionClosed, InvalidStatus

import frictus
from frictus.stream import StreamFrame
from frictus.websocket.frames import FINGER_STREAM, FingerFlag, Frame, Kind

SCENE = {
    "name": "ridges",
    "regions": [
        {
            "texture": {
                "kind": "profile",
                "period_mm": 2.0,
                "friction_n": [0.0, 0.02, 0.0, -0.02],
            }
        }
    ],
}
PEAK_N = 0.05


def update(ticket: int, sequence: int = 0, *, age_ms: float = 0.0, **fields: Any) -> bytes:
    values: dict[str, Any] = {
        "ttl_ms": 500,
        "period": 2.0,
        "spatial": True,
        "angle_deg": 0.0,
        "friction_n": np.array([0.0, 0.02, 0.0, -0.02], np.float32),
    }
    utc_ns = time.time_ns() - int(1e6 * age_ms)
    return StreamFrame(ticket, sequence, utc_ns, **(values | fields)).pack()


@contextmanager
def holding(port: int, who: str = "render", **arming: Any) -> Iterator[Page]:
    """Open a page that has armed the rig and watches it."""
    with page_at(port, who=who) as page:
        page.say("arm", rig="rig1", lease_ms=10_000, **arming)
        page.wait("armed")
        page.say("watch", rig="rig1")
        yield page


def stream_of(page: Page, peak_n: float = PEAK_N) -> int:
    page.say("open_stream", rig="rig1", peak_n=peak_n, id=11)
    opened = page.wait("stream_opened")
    assert (opened["rig"], opened["id"]) == ("rig1", 11)
    assert 0.0 < opened["applied"]["gain"] <= 1.0
    return int(opened["ticket"])


def test_the_minor_version_and_the_clock_are_told(port: int) -> None:
    with page_at(port, who="read") as page:
        assert page.told[0]["protocol"] == "1.2"
        before_us = page.told[0]["utc_us"]
        page.say("ping", id=1)
        assert 0 <= page.wait("pong")["utc_us"] - before_us < 60e6
        assert abs(page.told[-1]["utc_us"] * 1e-6 - time.time()) < 60.0


def test_every_state_of_the_finger_comes_in_batches(port: int) -> None:
    with page_at(port, who="read") as page:
        page.say("watch", rig="rig1", fingers=True, rate_hz=20.0)
        frames = [page.frame() for _ in range(10)]
        assert {(frame.stream, frame.kind) for frame in frames} == {
            (FINGER_STREAM, Kind.FINGER)
        }
        assert all(frame.data.shape[0] == 8 for frame in frames)
        newest = page.wait("finger")["finger"]
        samples = np.concatenate([frame.first_sample + frame.data[0] for frame in frames])
        # A state a block of 100 samples; none twice, and what is missing is counted.
        lost = sum(frame.lost_samples for frame in frames[1:])
        assert np.all(np.diff(samples) > 0)
        assert np.sum(np.diff(samples) / 100 - 1) == lost
        assert np.median([frame.columns for frame in frames]) > 5
        last = frames[-1]
        assert last.data[1:3, -1] == pytest.approx([newest["x_mm"], newest["y_mm"]], abs=1e-3)
        assert not int(last.data[7, -1]) & FingerFlag.IN_CONTACT
        assert [after.utc_ns - before.utc_ns > 0 for before, after in pairwise(frames)]


def test_the_decimation_is_chosen(port: int) -> None:
    with page_at(port, who="read") as page:
        page.say("watch", rig="rig1", streams=["force"], samples_per_column=7)
        frames = [page.frame() for _ in range(5)]
        assert {frame.samples_per_column for frame in frames} == {7}
        for before, after in pairwise(frames):
            assert after.first_sample == before.next_sample + after.lost_samples


def test_a_scene_is_set_by_its_etag(port: int) -> None:
    with holding(port) as page:
        page.say("set_scene", rig="rig1", scene=SCENE, id=7)
        told = page.wait("scene_set")
        assert (told["rig"], told["id"]) == ("rig1", 7)
        assert told["applied"]["gain"] == 1.0
        page.wait("scene", lambda said: said["scene"]["etag"] == told["etag"])
        page.say("set_scene", rig="rig1", scene={}, if_match="another", id=8)
        refused = page.wait("refused")
        assert (refused["what"], refused["code"], refused["id"]) == ("set_scene", "conflict", 8)
        page.say("set_scene", rig="rig1", scene={}, if_match=told["etag"], id=9)
        assert page.wait("scene_set")["id"] == 9


def test_only_the_holder_sets_scenes_and_streams(port: int) -> None:
    with holding(port) as page, page_at(port, who="render") as other:
        other.say("set_scene", rig="rig1", scene=SCENE, id=1)
        assert other.wait("refused")["code"] == "not_owner"
        other.say("open_stream", rig="rig1", peak_n=PEAK_N, id=2)
        told = other.wait("refused")
        assert (told["code"], told["id"]) == ("not_owner", 2)
        page.say("disarm", rig="rig1", id=3)
        assert page.wait("disarmed")["id"] == 3
        other.say("open_stream", rig="rig1", peak_n=PEAK_N)
        assert other.wait("refused")["code"] == "not_armed"
        other.say("close_stream")
        assert other.wait("refused")["code"] == "no_stream"


def test_a_second_call_waits_for_the_first(port: int) -> None:
    with holding(port) as page:
        page.say("set_scene", rig="rig1", scene=SCENE, id=1)
        page.say("set_scene", rig="rig1", scene=SCENE, id=2)
        refused = page.wait("refused")
        assert (refused["code"], refused["id"]) == ("busy", 2)
        page.say("ping", id=5)  # what is not a call waits for none
        assert page.wait("scene_set")["id"] == 1


def test_a_stream_is_felt_and_its_updates_are_counted(port: int) -> None:
    with holding(port) as page:
        ticket = stream_of(page)
        page.wait("status", lambda told: told["status"]["stream_open"])
        before = page.wait("status")["status"]["counters"]["stream_updates"]
        for sequence in range(20):
            page.connection.send(update(ticket, sequence))
            page.wait("stream", lambda told, n=sequence: told["newest"] == n)  # type: ignore[misc]
        page.connection.send(update(ticket, 20, age_ms=5_000.0))
        page.connection.send(update(ticket, 21, age_ms=-60_000.0))
        page.say("close_stream", id=4)
        closed = page.wait("stream_closed")
        assert (closed["sent"], closed["newest"], closed["reason"]) == (20, 19, "")
        assert closed["expired"] + closed["superseded"] == 2
        assert closed["id"] == 4
        told = page.wait("status", lambda told: not told["status"]["stream_open"])
        # Of two that reach a busy rig at once the newer wins there, too.
        assert before < told["status"]["counters"]["stream_updates"] <= before + 20
        page.connection.send(update(ticket, 22))  # of a stream that has ended: no fault
        page.say("ping", id=1)
        page.wait("pong")
        assert stream_of(page) == ticket + 1


def test_a_burst_keeps_the_newest_and_costs_nobody_a_sample(port: int) -> None:
    with holding(port) as page, page_at(port, who="read") as other:
        other.say("watch", rig="rig1", streams=["force"])
        first = other.frame()
        ticket = stream_of(page)
        friction = np.full(4_096, 0.01, np.float32)
        for sequence in range(600):
            page.connection.send(update(ticket, sequence, friction_n=friction, ttl_ms=60_000))
        told = page.wait("stream", lambda told: told["newest"] == 599)
        assert told["sent"] + told["superseded"] == 600
        assert told["sent"] < 600
        last = other.frame(lambda frame: frame.first_sample > first.first_sample + 20_000)
        assert last.run == first.run
        assert sum(frame.lost_samples for frame in other.frames) == 0


def test_friction_above_the_declared_peak_is_refused(port: int) -> None:
    with holding(port) as page:
        ticket = stream_of(page)
        page.connection.send(update(ticket, friction_n=np.full(4, 0.06, np.float32)))
        told = page.wait("refused")
        assert (told["what"], told["code"]) == ("update", "bad_request")
        assert "0.05" in told["message"]


@pytest.mark.parametrize(
    "spoil",
    [
        lambda good: good[:-4],
        lambda good: good + b"\0",
        lambda good: good[:12],
        lambda good: b"XXXX" + good[4:],
        lambda good: good[:64] + b"\xff\xff\xff\x7f" + good[68:],  # NaN
        lambda good: b"",
        lambda good: b"\0" * 20_000,
    ],
)
def test_a_malformed_update_ends_the_connection_and_the_lease(port: int, spoil: Any) -> None:
    with page_at(port, who="read") as other:
        other.say("watch", rig="rig1")
        with holding(port) as page:
            ticket = stream_of(page)
            other.wait("status", lambda told: told["status"]["state"] == "armed")
            page.connection.send(spoil(update(ticket)))
            assert page.wait("refused")["code"] == "malformed"
            with pytest.raises(ConnectionClosed) as closed:
                page.wait("never")
            assert closed.value.rcvd is not None
            assert closed.value.rcvd.code == 1003
        other.wait("status", lambda told: told["status"]["state"] == "disarmed")


def test_an_update_without_a_stream_is_refused(port: int) -> None:
    with page_at(port, who="render") as page:
        page.connection.send(update(1))
        told = page.wait("refused")
        assert (told["what"], told["code"]) == ("update", "no_stream")


def test_a_stream_ends_with_the_lease_and_says_why(port: int, router: str) -> None:
    with holding(port) as page:
        ticket = stream_of(page)
        with frictus.connect(router, name="bystander") as client:
            client.rig("rig1").stop()
        page.wait("disarmed")
        page.connection.send(update(ticket))
        assert "stopped by 'bystander'" in page.wait("stream_closed")["reason"]


def test_a_stream_that_ended_with_its_lease_is_in_no_other_s_way(port: int) -> None:
    with holding(port) as page:
        first = stream_of(page)
        page.say("disarm", rig="rig1")
        page.wait("disarmed")
        page.say("arm", rig="rig1", lease_ms=10_000)
        page.wait("armed")
        page.say("open_stream", rig="rig1", peak_n=PEAK_N)
        closed = page.wait("stream_closed")
        assert (closed["ticket"], closed["id"]) == (first, None)
        assert closed["reason"]
        assert page.wait("stream_opened")["ticket"] == first + 1


def test_a_stream_on_a_shared_rig_ends_with_its_page(port: int) -> None:
    with holding(port, share_with=["guest"]) as page:
        with page_at(port, who="guest") as guest:
            ticket = stream_of(guest)
            guest.connection.send(update(ticket))
            page.wait("status", lambda told: told["status"]["stream_open"])
        status = page.wait("status", lambda told: not told["status"]["stream_open"])
        assert status["status"]["state"] == "armed"  # its holder is there


def test_a_lost_socket_disarms_in_the_middle_of_a_stream(port: int) -> None:
    with page_at(port, who="read") as other:
        other.say("watch", rig="rig1")
        with holding(port) as page:
            ticket = stream_of(page)
            page.connection.send(update(ticket))
            other.wait("status", lambda told: told["status"]["stream_open"])
            page.connection.socket.close()
        status = other.wait("status", lambda told: told["status"]["state"] == "disarmed")
        assert not status["status"]["stream_open"]


def test_the_lease_is_as_long_as_the_page_asks(port: int) -> None:
    with page_at(port, who="render") as page:
        page.say("arm", rig="rig1", lease_ms=500)
        page.wait("armed")
        assert "0.5 s" in page.wait("disarmed")["reason"]


def test_one_that_only_reads_sets_nothing(port: int) -> None:
    for op, fields in (
        ("set_scene", {"scene": {}}),
        ("open_stream", {"peak_n": 0.1}),
        ("arm", {}),
    ):
        with page_at(port, who="read") as page:
            page.say(op, rig="rig1", id=7, **fields)
            refused = page.wait("refused")
            assert (refused["code"], refused["id"]) == ("missing_scope", 7)


def test_origins_of_the_configuration_are_let_in(serve: Any, router: str) -> None:
    with serve(router, origins=("https://lab.example.org", "http://localhost:5173")) as port:
        for origin in ("https://lab.example.org", "http://localhost:5173"):
            with page_at(port, origin=origin) as page:
                page.wait("rigs")
        for origin in (
            "http://lab.example.org",
            "https://lab.example.org:444",
            "https://evil.example",
            "https://lab.example.org.evil.example",
            "null",
        ):
            with pytest.raises(InvalidStatus), page_at(port, hello=False, origin=origin):
                pass


def test_frames_of_the_finger_are_read_again(port: int) -> None:
    with page_at(port, who="read") as page:
        page.say("watch", rig="rig1", fingers=True)
        frame = page.frame()
        assert Frame.unpack(frame.pack()).pack() == frame.pack()

"""What is played and by which finger: streams, excitations, pointing, guidance."""

import json
from typing import Any

import pytest

from frictus_service.daemon.safety import OutputQuiet

from .desk import SCENE, WAVE, Desk, Finger, Info


def test_stream_needs_an_armed_rig_and_its_ticket(desk: Desk) -> None:
    assert desk.call("open_stream", peak_n=0.05).code == "not_armed"
    ticket = desk.streaming()
    assert desk.send("texture", desk.frame(ticket + 1)).code == "not_armed"
    assert desk.send("texture", desk.frame(ticket)).ok


def test_stream_ends_with_its_arming(desk: Desk) -> None:
    ticket = desk.streaming()
    desk.call("disarm")
    assert not desk.stage.stream_open
    desk.interlock.feed(OutputQuiet(), desk.now_s)
    desk.call("arm")
    assert desk.send("texture", desk.frame(ticket)).code == "not_armed"


def test_whose_share_has_ended_streams_no_more(desk: Desk) -> None:
    assert desk.call("arm", share_with=["ben"]).ok
    ticket = desk.call("open_stream", "ben", peak_n=0.06).ticket
    assert ticket is not None
    assert desk.send("texture", desk.frame(ticket, 1)).ok
    assert desk.call("arm").ok
    reply = desk.send("texture", desk.frame(ticket, 2))
    assert (reply.code, desk.stage.updates) == ("not_owner", 1)
    assert desk.call("arm", share_with=["ben"]).ok
    assert desk.send("texture", desk.frame(ticket, 3)).ok


def test_expired_and_overtaken_updates_are_counted(desk: Desk) -> None:
    ticket = desk.streaming()
    assert desk.send("texture", desk.frame(ticket, 5)).ok
    assert desk.send("texture", desk.frame(ticket, 5)).code == "stale"
    old = desk.frame(ticket, 6, utc_ns=desk.utc_ns - 300_000_000)
    assert desk.send("texture", old).code == "stale"
    assert (desk.stage.updates, desk.commands.updates_expired) == (1, 1)


def test_update_beyond_the_declared_peak_is_refused(desk: Desk) -> None:
    ticket = desk.streaming()
    reply = desk.send("texture", desk.frame(ticket, friction_n=2.0 * WAVE))
    assert reply.code == "not_feasible"
    assert "0.06" in reply.message


def test_real_finger_cannot_be_pointed(desk: Desk) -> None:
    assert desk.call("pointer", x_mm=1.0, y_mm=1.0, in_contact=True).code == "not_feasible"


def test_virtual_finger_follows_its_clients() -> None:
    desk = Desk(backend=Finger())
    assert desk.call("pointer", x_mm=1.0, y_mm=2.0, in_contact=True).ok
    desk.call("arm")
    assert desk.call("pointer", "ben", x_mm=9.0, y_mm=9.0, in_contact=True).code == "not_owner"
    assert desk.backend.moves == [(1.0, 2.0, True, 0.4)]


def test_a_finger_is_taken_over_by_those_with_whom_the_rig_is_shared() -> None:
    desk = Desk(backend=Finger(Info("simulated", finger_takeover=True)))
    assert desk.call("arm", share_with=["ben"]).ok
    assert desk.call("pointer", "ben", x_mm=1.0, y_mm=2.0, in_contact=True).ok
    assert desk.call("pointer", "eve", x_mm=9.0, y_mm=9.0, in_contact=True).code == "not_owner"
    assert desk.backend.moves == [(1.0, 2.0, True, 0.4)]


TONE = {"hz": 100.0, "amplitude": 0.5}


def test_only_the_owner_of_an_armed_rig_may_excite(desk: Desk) -> None:
    assert desk.call("excite", excitation={"tones": [TONE]}).code == "not_armed"
    desk.call("arm")
    assert desk.call("excite", "ben", excitation={"tones": [TONE]}).code == "not_owner"
    reply = desk.call("excite", excitation={"tones": [TONE]})
    assert reply.ok
    assert reply.applied is not None
    assert (reply.applied.gain, reply.applied.bias) == (1.0, 0.5)
    assert desk.stage.scene.source == "excitation"
    assert desk.stage.scene.etag == reply.etag
    assert desk.orders.scene[-1].arming == desk.interlock.state.armings


def test_an_excitation_beyond_the_drive_is_refused(desk: Desk) -> None:
    desk.call("arm")
    reply = desk.call("excite", excitation={"tones": [TONE, {**TONE, "hz": 130.0}]})
    assert reply.code == "not_feasible"
    assert "from -0.5 to 1.5" in reply.message
    assert desk.stage.scene.source == "scene"


@pytest.mark.parametrize("end", ["scene", "open_stream", "disarm"])
def test_an_excitation_ends_with_what_follows(desk: Desk, end: str) -> None:
    desk.call("arm")
    desk.call("excite", excitation={"tones": [TONE]})
    with_it: dict[str, dict[str, Any]] = {
        "scene": {"scene": SCENE},
        "open_stream": {"peak_n": 0.05},
    }
    fields = with_it.get(end, {})
    assert desk.call(end, **fields).ok
    assert desk.stage.scene.source == ("stream" if end == "open_stream" else "scene")


def test_an_excitation_ends_a_stream(desk: Desk) -> None:
    ticket = desk.streaming()
    assert desk.call("excite", excitation={"tones": [TONE]}).ok
    assert not desk.stage.stream_open
    assert desk.send("texture", desk.frame(ticket)).code == "not_armed"
    assert desk.call("close_stream").ok
    assert desk.stage.scene.source == "excitation"


def test_a_stream_that_has_ended_takes_no_other_with_it(desk: Desk) -> None:
    first = desk.streaming()
    second = desk.call("open_stream", peak_n=0.05).ticket
    assert desk.call("close_stream", ticket=first).ok
    assert desk.stage.scene.etag == f"stream-{second}"
    assert desk.call("close_stream", ticket=second).ok
    assert not desk.stage.stream_open


class Participant:
    """A backend whose virtual finger follows guidance."""

    info = Info("simulated")
    follows_guidance = True

    def __init__(self) -> None:
        self.told: list[tuple[float, float, tuple[float, float]]] = []

    def guide_finger(
        self, speed_mm_s: float, force_n: float, span_mm: tuple[float, float]
    ) -> None:
        self.told.append((speed_mm_s, force_n, span_mm))


def guidance(desk: Desk, **fields: Any) -> bytes:
    said = {
        "utc_ns": desk.utc_ns,
        "participant": "P01",
        "phase": "record",
        "trial": 1,
        "seconds_left": 3.0,
        "target_speed_mm_s": 40.0,
        "target_force_n": 0.3,
        "reference_x_mm": 10.0,
        "span_mm": [5.0, 65.0],
    }
    return json.dumps({**said, **fields}).encode()


def test_virtual_participant_follows_guidance_and_rests_in_between() -> None:
    desk = Desk(backend=Participant())
    for phase in ("approach", "record", "break", "analyse", "done"):
        assert desk.send("guidance", guidance(desk, phase=phase)).ok
    speeds = [speed for speed, _, _ in desk.backend.told]
    assert speeds == [40.0, 40.0, 0.0, 0.0, 0.0]
    assert desk.backend.told[0][1:] == (0.3, (5.0, 65.0))


def test_guidance_that_is_old_or_garbage_guides_nobody() -> None:
    desk = Desk(backend=Participant())
    old = guidance(desk, utc_ns=desk.utc_ns - 2_000_000_000)
    assert desk.send("guidance", old).code == "stale"
    assert desk.send("guidance", b"{}").code == "bad_request"
    assert not desk.backend.told


def test_real_finger_follows_no_guidance(desk: Desk) -> None:
    assert desk.send("guidance", guidance(desk)).code == "not_feasible"

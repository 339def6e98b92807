"""Commands: who may do what, how old it may be, and that garbage only makes a refusal."""

import json
import time
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from frictus.keys import CALLS
from frictus.messages import SceneRequest
from frictus.textures import MAX_PROFILE_SAMPLES, Profile, Region, Scene
from frictus_service import command_validation
from frictus_service.command_validation import MAX_DIGITS, MAX_MEMBERS, MAX_VALUES, SHORT_BYTES
from frictus_service.config import Limits
from frictus_service.daemon.inboxes import IncomingCommand, ModelSlot
from frictus_service.daemon.safety import FaultRaised, OutputQuiet, Safety
from frictus_service.synthesis.compensability import placeholder_model

from .desk import SCENE, TEXTURE, WAVE, Desk, Finger, Info, TakenAtTheLastMoment


@pytest.fixture
def desk() -> Desk:
    return Desk()


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


def test_large_payloads_are_refused_unread(desk: Desk) -> None:
    for name, most in (("arm", SHORT_BYTES), ("model", desk.limits.max_payload_bytes)):
        reply = desk.send(name, b"{" * (most + 1))
        assert reply.code == "too_large"
        assert str(most) in reply.message


HOSTILE = {
    "lists": b"[" + b"[]," * 9_000 + b"[]]",
    "deep": b"[" * 9_900,
    "regions": b'{"regions":[' + b"{}," * 9_000 + b"{}]}",
    "friction": b'{"regions":[{"texture":{"kind":"profile","friction_n":['
    + b'"x",' * 65_000
    + b"1]}}]}",
    "components": b'{"regions":[{"texture":{"kind":"spectrum","components":['
    + b"{}," * 4_000
    + b"{}]}}]}",
    "unknown": b'{"x":[' + b"1," * 900_000 + b"1]}",
}


@pytest.mark.parametrize("content", HOSTILE.values(), ids=HOSTILE)
def test_no_scene_takes_long_to_refuse(desk: Desk, content: bytes) -> None:
    payload = b'{"client":"a","utc_ns":%d,"scene":%b}' % (desk.utc_ns, content)
    assert len(payload) <= desk.limits.max_scene_bytes
    times = []
    for _ in range(3):
        began_s = time.thread_time()
        desk.send("scene", payload)
        times.append(time.thread_time() - began_s)
    # The largest that is worth anything, as the measure of this machine.
    friction = [0.012345678901234567] * MAX_PROFILE_SAMPLES
    texture = Profile(friction_n=friction, period_mm=60.0)
    whole = Scene(regions=[Region(texture=texture)]).model_dump_json().encode()
    began_s = time.thread_time()
    for _ in range(10):
        Scene.model_validate_json(whole)
    assert min(times) < time.thread_time() - began_s


def test_what_holds_too_many_numbers_is_refused_unread(
    desk: Desk, monkeypatch: pytest.MonkeyPatch
) -> None:
    def never(payload: bytes) -> None:
        raise AssertionError("it was read")

    monkeypatch.setattr(command_validation, "read_sliced", never)
    content = b"1," * (MAX_VALUES - 3)
    payload = b'{"client":"a","utc_ns":%d,"x":[%b1]}' % (desk.utc_ns, content)
    assert "it was read" in desk.send("scene", payload).message
    reply = desk.send("scene", payload.replace(b"[", b"[1,"))
    assert reply.code == "too_large"
    assert str(MAX_VALUES + 1) in reply.message


@pytest.mark.parametrize(
    "content",
    [
        b"{" + b",".join(b'"%d":1' % k for k in range(MAX_MEMBERS)) + b"}",
        b'"' + rb"\n" * MAX_MEMBERS + b'"',
        b"1" * 2 * MAX_DIGITS,
    ],
    ids=["members", "escapes", "digits"],
)
def test_what_one_call_reads_for_long_is_refused_unread(desk: Desk, content: bytes) -> None:
    reply = desk.send("scene", b'{"client":"a","utc_ns":%d,"x":%b}' % (desk.utc_ns, content))
    assert reply.code == "too_large"


def test_a_long_scene_is_read_as_a_short_one_is(desk: Desk) -> None:
    friction = [0.1 * (n % 7) - 0.3 + 1e-9 * n for n in range(MAX_PROFILE_SAMPLES)]
    scene = Scene(regions=[Region(texture=Profile(friction_n=friction, period_mm=60.0))])
    request = SceneRequest(client="a", utc_ns=desk.utc_ns, scene=scene)
    limits = Limits()
    payload = request.to_json()
    assert len(payload) > command_validation.SLICED_BYTES
    read = command_validation.CommandValidator(limits).read(
        SceneRequest, payload, desk.utc_ns, limits.max_scene_bytes
    )
    assert read == request
    reply = desk.send("scene", payload.replace(b"0.1,", b"NaN,").replace(b"-0.3,", b'"x",', 1))
    assert reply.code == "bad_request"
    assert "friction_n" in reply.message
    reply = desk.send("scene", payload[:-1])
    assert reply.code == "bad_request"
    assert "not JSON" in reply.message


@pytest.mark.parametrize("name", ["scene", "model"])
def test_what_holds_too_many_lists_is_refused_unread(desk: Desk, name: str) -> None:
    payload = b'{"client":"a","utc_ns":%d,"%b":[%b[]]}' % (
        desk.utc_ns,
        name.encode(),
        b"[]," * 80_000,
    )
    reply = desk.send(name, payload)
    assert reply.code == "too_large"
    assert "80003" in reply.message


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"lease_ms": 5}, "lease_ms"),
        ({"lease_ms": "long"}, "lease_ms"),
        ({"utc_ns": "now"}, "utc_ns"),
        ({"ttl_ms": -1}, "ttl_ms"),
        ({"client": ""}, "client"),
    ],
)
def test_bad_request_names_the_field(desk: Desk, fields: dict[str, Any], words: str) -> None:
    reply = desk.call("arm", **{"client": "ann", **fields})
    assert reply.code == "bad_request"
    assert words in reply.message


def test_longer_leases_than_granted_are_refused() -> None:
    desk = Desk(Limits(max_lease_ms=1_000))
    assert desk.call("arm", lease_ms=2_000).code == "bad_request"


@pytest.mark.parametrize("number", ["NaN", "Infinity", "1e999", "-1"])
def test_absurd_numbers_in_a_scene_are_refused(desk: Desk, number: str) -> None:
    request = json.dumps({"client": "a", "utc_ns": desk.utc_ns, "scene": SCENE})
    reply = desk.send(
        "scene", request.replace('"amplitude_n": 0.05', f'"amplitude_n": {number}').encode()
    )
    assert reply.code == "bad_request"
    assert "amplitude_n" in reply.message


def test_scene_is_replaced_only_where_it_matches(desk: Desk) -> None:
    seen = desk.stage.scene.etag
    assert desk.call("scene", scene=SCENE, if_match=seen).ok
    reply = desk.call("scene", scene={}, if_match=seen)
    assert reply.code == "conflict"
    assert desk.stage.scene.etag in reply.message


def test_a_scene_that_stands_is_not_compiled_again(desk: Desk) -> None:
    reply = desk.call("scene", scene=SCENE)
    compiled = desk.orders.scene[-1].scene
    ticket = desk.streaming()
    assert desk.send("texture", desk.frame(ticket)).ok
    assert desk.call("scene", scene=SCENE).etag == reply.etag
    assert desk.orders.scene[-1].scene is compiled
    assert not desk.stage.stream_open
    assert desk.call("scene", scene={"regions": []}).etag != reply.etag


def test_scenes_that_alternate_are_compiled_once(desk: Desk) -> None:
    compiled: dict[str | None, Any] = {}
    for name in ("a", "b", "a", "b"):
        reply = desk.call("scene", scene={**SCENE, "name": name})
        assert desk.stage.scene.scene.name == name
        rendered = desk.orders.scene[-1].scene
        assert compiled.setdefault(reply.etag, rendered) is rendered
    assert len(compiled) == 2
    model = placeholder_model().model_dump(mode="json", by_alias=True)
    model["base"]["gain_n"] = 0.1  # less than the scene needs
    assert desk.call("model", model=model).ok
    reply = desk.call("scene", scene={**SCENE, "name": "a"})
    assert desk.orders.scene[-1].scene is not compiled[reply.etag]
    assert reply.applied is not None
    assert reply.applied.scaled


def test_model_changes_only_while_disarmed_and_matching(desk: Desk) -> None:
    model = placeholder_model().model_dump(mode="json", by_alias=True)
    model["base"]["gain_n"] = 0.5
    desk.call("arm")
    assert desk.call("model", model=model).code == "conflict"
    desk.call("disarm")
    desk.interlock.feed(OutputQuiet(), desk.now_s)
    assert desk.call("model", model=model, if_match="else").code == "conflict"
    reply = desk.call("model", model=model, if_match=desk.models.model.etag)
    assert reply.ok
    assert reply.etag == desk.models.model.etag
    assert desk.orders.model.in_force.inverse.law.gain_n == 0.5


@pytest.mark.parametrize(("slot", "ok"), [(TakenAtTheLastMoment, True), (ModelSlot, False)])
def test_a_model_is_in_force_if_and_only_if_the_reply_says_so(
    slot: type[ModelSlot], ok: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("frictus_service.daemon.model_controller.MODEL_CHANGE_S", 0.0)
    desk = Desk(slot=slot)
    before = desk.models.model.etag
    model = placeholder_model().model_dump(mode="json", by_alias=True)
    model["base"]["gain_n"] = 0.5
    reply = desk.call("model", model=model)
    assert reply.ok == ok
    assert desk.orders.model.take(Safety(), energised=False) is None, (
        "nothing is left that could be taken later"
    )
    in_force = desk.orders.model.in_force
    assert in_force.state.etag == desk.models.model.etag
    assert (in_force.inverse.law.gain_n == 0.5) == ok
    if ok:
        assert reply.etag == desk.models.model.etag
    else:
        assert reply.code == "conflict"
        assert desk.models.model.etag == before


def test_mobility_model_cannot_be_rendered(desk: Desk) -> None:
    model = {
        "response": "mobility",
        "base": {
            "law": "mass_spring_damper",
            "mass_kg": 0.0015,
            "damping_n_s_m": 1.3,
            "stiffness_n_m": 444.0,
        },
    }
    reply = desk.call("model", model=model)
    assert reply.code == "not_feasible"
    assert "friction" in reply.message


def test_effects_that_are_not_rendered_are_named_with_the_reason(desk: Desk) -> None:
    model = placeholder_model().model_dump(mode="json", by_alias=True)
    model["effects"] = [
        {"id": "channel_delay", "parameters": {"delay_s": 1e-4}},
        {"id": "from_a_newer_version", "parameters": {"size": 1.0}},
        {"id": "charge_leakage", "parameters": {"corner_hz": 2.0}},
        {"id": "direction_asymmetry", "parameters": {"share": 0.1}},
    ]
    said = desk.call("model", model=model).message
    not_rendered, limited = said.split("rendered within limits")
    assert "channel_delay, because" in not_rendered
    assert "from_a_newer_version, because this version does not know it" in not_rendered
    assert "charge_leakage: " in limited
    assert "direction_asymmetry" not in said
    told = desk.models.model.not_rendered
    assert set(told) == {"channel_delay", "from_a_newer_version"}


def test_a_model_with_an_effect_out_of_its_range_is_refused(desk: Desk) -> None:
    model = placeholder_model().model_dump(mode="json", by_alias=True)
    model["effects"] = [{"id": "direction_asymmetry", "parameters": {"share": 3.0}}]
    reply = desk.call("model", model=model)
    assert reply.code == "not_feasible"
    assert "share" in reply.message
    assert desk.models.model.model.effects == []


def test_scenes_are_compiled_for_where_the_gain_is_least(desk: Desk) -> None:
    model = placeholder_model().model_dump(mode="json", by_alias=True)
    strong = {"regions": [{"texture": TEXTURE, "gain": 100.0}]}
    before = desk.call("scene", scene=strong).applied
    model["effects"] = [{"id": "direction_asymmetry", "parameters": {"share": 0.25}}]
    after = desk.call("model", model=model).applied
    assert before is not None
    assert after is not None
    assert after.gain == pytest.approx(0.75 * before.gain)


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


json_values = st.recursive(
    st.none() | st.booleans() | st.floats() | st.integers() | st.text(max_size=8),
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3)
    ),
    max_leaves=8,
)
NAMES = [name for name in CALLS if name != "stop"] + ["lease", "pointer", "texture", "guidance"]
SHARED = Desk()
assert SHARED.call("arm", "owner", lease_ms=10_000).ok


@settings(max_examples=300, deadline=None)
@given(
    st.sampled_from(NAMES),
    st.binary(max_size=300) | json_values.map(lambda v: json.dumps(v).encode()),
)
def test_garbage_is_refused_and_changes_nothing(name: str, payload: bytes) -> None:
    before = SHARED.interlock.state
    reply = SHARED.send(name, payload)
    assert not reply.ok
    assert reply.code == "bad_request"
    assert reply.message
    assert SHARED.interlock.state == before


@settings(max_examples=300, deadline=None)
@given(
    st.sampled_from([name for name in NAMES if name not in ("texture", "reset")]),
    st.dictionaries(
        st.sampled_from(
            ["scene", "lease_ms", "peak_n", "model", "if_match", "x_mm", "y_mm", "extra"]
        ),
        json_values,
    ),
)
def test_half_right_requests_never_arm_or_break(name: str, fields: dict[str, Any]) -> None:
    before = SHARED.interlock.state
    reply = SHARED.call(name, "stranger", **fields)
    assert not reply.ok
    assert reply.code in ("bad_request", "not_owner", "not_feasible")
    assert SHARED.interlock.state == before


@settings(max_examples=200, deadline=None)
@given(st.data())
def test_mutilated_frames_are_refused_or_whole(data: st.DataObject) -> None:
    desk = SHARED
    frame = bytearray(desk.frame(7))
    for _ in range(data.draw(st.integers(1, 4))):
        frame[data.draw(st.integers(0, len(frame) - 1))] = data.draw(st.integers(0, 255))
    reply = desk.send("texture", bytes(frame[: data.draw(st.integers(0, len(frame)))]))
    assert not reply.ok, "no stream is open"
    assert reply.code in ("bad_request", "stale", "not_armed")

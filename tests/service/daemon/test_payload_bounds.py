"""Payloads: bounded before they are read, and garbage only makes a refusal."""

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
from frictus_service.synthesis.compensability import placeholder_model

from .desk import SCENE, Desk


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


@pytest.mark.parametrize("length", [1, 9_000])
@pytest.mark.parametrize("place", ["note", "provenance"])
def test_a_model_with_text_that_cannot_be_published_is_refused(
    desk: Desk, place: str, length: int
) -> None:
    """However long the payload is: long ones are read by another parser."""
    model = json.loads(placeholder_model().to_json())
    model[place] = {"x": "@@"}
    request = {"client": "ann", "utc_ns": desk.utc_ns, "model": model, "x": ["a,]"] * length}
    reply = desk.send("model", json.dumps(request).replace("@@", r"\ud800").encode())
    assert reply.code == "bad_request"
    assert desk.send("model", json.dumps(request).encode()).ok


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


@pytest.mark.parametrize("number", ["NaN", "Infinity", "1e999", "-1"])
def test_absurd_numbers_in_a_scene_are_refused(desk: Desk, number: str) -> None:
    request = json.dumps({"client": "a", "utc_ns": desk.utc_ns, "scene": SCENE})
    reply = desk.send(
        "scene", request.replace('"amplitude_n": 0.05', f'"amplitude_n": {number}').encode()
    )
    assert reply.code == "bad_request"
    assert "amplitude_n" in reply.message


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

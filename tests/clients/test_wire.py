"""Frames and messages: round trips, and nothing but FrameError for what is not one."""

import json
import math
import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from pydantic import ValidationError

from frictus.block import HEADER_BYTES, Block, Flag
from frictus.errors import FrameError, FrictusError
from frictus.lenient import Lenient
from frictus.messages import MESSAGES, Reply, SceneRequest, TimeState
from frictus.model import MAX_DEPTH, Compensation, Model
from frictus.stream import StreamFrame
from frictus.textures import Component, Scene

U16, U32, U64 = (st.integers(0, 2**bits - 1) for bits in (16, 32, 64))
I64 = st.integers(-(2**63), 2**63 - 1)
ANY_F32 = st.floats(width=32, allow_nan=True, allow_infinity=True)
quick = settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])

blocks = st.builds(
    Block,
    stream=U16,
    run=U32,
    sequence=U64,
    first_sample=U64,
    utc_ns=I64,
    uncertainty_ns=U64,
    sample_rate_hz=st.floats(1e-3, 1e8),
    flags=U32.map(Flag),
    data=hnp.arrays(
        np.float32, st.tuples(st.integers(1, 8), st.integers(0, 50)), elements=ANY_F32
    ),
)
frames = st.builds(
    StreamFrame,
    ticket=U32,
    sequence=U64,
    utc_ns=I64,
    ttl_ms=st.integers(1, 60_000),
    period=st.floats(1e-3, 10.0),
    spatial=st.booleans(),
    angle_deg=st.floats(-360.0, 360.0),
    friction_n=hnp.arrays(
        np.float32, st.integers(2, 60), elements=st.floats(-10.0, 10.0, width=32)
    ),
)


@quick
@given(blocks)
def test_a_block_survives_the_wire(block: Block) -> None:
    back = Block.unpack(block.pack())
    for name in Block.__dataclass_fields__:
        np.testing.assert_array_equal(getattr(back, name), getattr(block, name))


@quick
@given(frames)
def test_a_stream_frame_survives_the_wire(frame: StreamFrame) -> None:
    back = StreamFrame.unpack(frame.pack())
    for name in StreamFrame.__dataclass_fields__:
        np.testing.assert_array_equal(getattr(back, name), getattr(frame, name))


@quick
@given(st.binary(max_size=200), st.sampled_from([b"", b"FRIC\x01\x00", b"FRTX\x01\x00"]))
def test_garbage_is_a_frame_error_or_a_frame(tail: bytes, head: bytes) -> None:
    for kind in (Block, StreamFrame):
        try:
            kind.unpack(head + tail)
        except FrameError:
            pass


@quick
@given(blocks, frames, st.data())
def test_every_torn_or_longer_frame_is_refused(
    block: Block, frame: StreamFrame, data: st.DataObject
) -> None:
    for one in (block, frame):
        packed = one.pack()
        cut = data.draw(st.integers(0, len(packed) - 1))
        with pytest.raises(FrameError, match="bytes"):
            type(one).unpack(packed[:cut])
        with pytest.raises(FrameError, match="bytes"):
            type(one).unpack(packed + b"\0")


@quick
@given(blocks, frames, st.data())
def test_a_flipped_header_byte_is_refused_or_read(
    block: Block, frame: StreamFrame, data: st.DataObject
) -> None:
    for one in (block, frame):
        packed = bytearray(one.pack())
        packed[data.draw(st.integers(0, HEADER_BYTES - 1))] ^= data.draw(st.integers(1, 255))
        try:
            type(one).unpack(bytes(packed))
        except FrameError:
            pass


@pytest.mark.parametrize("version", [0, 2, 65_535])
def test_other_versions_are_refused(version: int) -> None:
    header = version.to_bytes(2, "little")
    with pytest.raises(FrameError, match=f"version {version}"):
        Block.unpack(b"FRIC" + header + bytes(100))
    with pytest.raises(FrameError, match=f"version {version}"):
        StreamFrame.unpack(b"FRTX" + header + bytes(100))


@pytest.mark.parametrize(
    "changes",
    [
        {"stream": 70_000},
        {"sequence": -1},
        {"uncertainty_ns": -1},
        {"utc_ns": 2**63},
        {"sample_rate_hz": math.nan},
        {"sample_rate_hz": 0.0},
        {"data": np.zeros(5, np.float32)},
        {"data": np.zeros((65, 1), np.float32)},
        {"data": np.zeros((1, 70_000), np.float32)},
    ],
)
def test_what_does_not_fit_a_block_is_not_packed(changes: dict[str, Any]) -> None:
    fields: dict[str, Any] = {
        "stream": 1,
        "run": 1,
        "sequence": 0,
        "first_sample": 0,
        "utc_ns": 0,
        "uncertainty_ns": 0,
        "sample_rate_hz": 1.0,
        "flags": Flag(0),
        "data": np.zeros((1, 1), np.float32),
    }
    with pytest.raises(FrameError):
        Block(**(fields | changes)).pack()


@pytest.mark.parametrize(
    "changes",
    [
        {"friction_n": np.array([0.0, math.nan], np.float32)},
        {"friction_n": np.array([0.0, math.inf], np.float32)},
        {"friction_n": np.array([0.0, 11.0], np.float32)},
        {"friction_n": np.zeros(1, np.float32)},
        {"friction_n": np.zeros(4097, np.float32)},
        {"friction_n": np.zeros((2, 2), np.float32)},
        {"period": 0.0},
        {"period": -1.0},
        {"period": math.nan},
        {"period": 1_001.0},
        {"angle_deg": math.inf},
        {"ttl_ms": 0},
        {"ttl_ms": 60_001},
        {"ticket": -1},
    ],
)
def test_what_is_out_of_range_is_not_streamed(changes: dict[str, Any]) -> None:
    fields: dict[str, Any] = {
        "ticket": 1,
        "sequence": 0,
        "utc_ns": 0,
        "ttl_ms": 200,
        "period": 1.0,
        "spatial": True,
        "angle_deg": 0.0,
        "friction_n": np.zeros(2, np.float32),
    }
    with pytest.raises(FrameError):
        StreamFrame(**(fields | changes)).pack()


@quick
@given(st.sampled_from(sorted(MESSAGES)), st.binary(max_size=200))
def test_garbage_json_is_a_frame_error(name: str, payload: bytes) -> None:
    try:
        MESSAGES[name].from_json(payload)
    except FrameError:
        pass


json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=10),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner),
    max_leaves=10,
)


@quick
@given(st.data())
def test_any_json_in_any_field_is_read_or_a_frame_error(data: st.DataObject) -> None:
    kind = MESSAGES[data.draw(st.sampled_from(sorted(MESSAGES)))]
    document = {
        name: data.draw(json_values) for name in kind.model_fields if data.draw(st.booleans())
    }
    try:
        kind.from_json(json.dumps(document).encode())
    except FrameError:
        pass


def scene_request(texture: str) -> bytes:
    head = '{"client": "me", "utc_ns": 1, "scene": {"regions": [{"texture": '
    return (head + texture + "}]}}").encode()


GOOD = '{"kind": "spectrum", "components": [{"amplitude_n": 0.1, "hz": 100.0}]}'


def test_unknown_fields_are_tolerated() -> None:
    newer = GOOD.replace('"kind"', '"shininess": [1, {"a": null}], "kind"')
    request = SceneRequest.from_json(scene_request(newer))
    assert request.scene.regions[0].texture.kind == "spectrum"
    assert request == SceneRequest.from_json(scene_request(GOOD))
    assert Reply.from_json(b'{"ok": true, "mood": "fine"}').ok


@pytest.mark.parametrize(
    ("kind", "given", "meant"),
    [
        (Component, {"amplitude_n": 0.1, "hz": 3.0, "phase": 0.3}, "you mean 'phase_rad'?"),
        (Scene, {"region": []}, "you mean 'regions'?"),
        (Compensation, {"mode": "fixed", "speed": 60.0}, "you mean 'speed_mm_s'?"),
        (
            SceneRequest,
            {"colour": "red"},
            "has no 'colour': it takes client, utc_ns",
        ),
    ],
)
def test_misspelt_arguments_are_not(
    kind: type[Lenient], given: dict[str, object], meant: str
) -> None:
    with pytest.raises(TypeError, match=re.escape(meant)):
        kind(**given)


CONVERTED: dict[str, list[object]] = {
    "integer": [True, "1", 1.0],
    "number": [True, "1"],
    "boolean": [1, "yes"],
}


@pytest.mark.parametrize("name", sorted(MESSAGES))
@pytest.mark.parametrize("parse", [None, json.loads])
def test_nothing_is_converted(name: str, parse: Callable[[bytes], object] | None) -> None:
    properties = MESSAGES[name].model_json_schema()["properties"]
    for field, schema in properties.items():
        types = {one.get("type") for one in schema.get("anyOf", [schema])}
        for value in (value for kind in types for value in CONVERTED.get(kind, [])):
            with pytest.raises(FrameError) as refusal:
                MESSAGES[name].from_json(json.dumps({field: value}).encode(), parse)
            # Fields that are missing come first, and only three complaints are told.
            fault = refusal.value.__cause__
            assert isinstance(fault, ValidationError)
            told = {one["loc"][0]: one["msg"] for one in fault.errors()}
            assert "should be a valid" in told[field], (field, value)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("100.0", "true"),
        ("100.0", '"100"'),
        ("100.0", "NaN"),
        ("100.0", "Infinity"),
        ("100.0", "1e999"),
        ("100.0", "-5"),
        ("100.0", "0"),
        ("100.0", "1e9"),
        ("100.0", '"high"'),
        ("100.0", "null"),
        ("0.1", "-0.1"),
        ("0.1", "1e999"),
        ('"hz": 100.0', '"hz": 1, "cycles_per_mm": 1'),
        ('"hz": 100.0', '"hertz": 100.0'),
        ("spectrum", "smell"),
        ('[{"amplitude_n": 0.1, "hz": 100.0}]', "[]"),
    ],
)
def test_bad_textures_are_refused_where_they_stand(old: str, new: str) -> None:
    with pytest.raises(FrameError, match=r"scene\.regions\.0\.texture"):
        SceneRequest.from_json(scene_request(GOOD.replace(old, new)))


def test_a_hundred_thousand_components_are_refused() -> None:
    many = ",".join(['{"amplitude_n": 0, "hz": 100}'] * 100_000)
    texture = f'{{"kind": "spectrum", "components": [{many}]}}'
    with pytest.raises(FrameError, match="at most 4096"):
        SceneRequest.from_json(scene_request(texture))


def test_deep_nesting_is_refused() -> None:
    with pytest.raises(FrameError):
        SceneRequest.from_json(scene_request("[" * 100_000))


MODEL = (
    '{"schema": "model/1", "base": {"law": "first_order_speed", "gain_n": 0.4,'
    ' "cutoff_0_hz": 400, "slope_hz_per_mm_s": 14}, "provenance": {"note": 1.0}}'
)


def model_request(model: str) -> bytes:
    return ('{"client": "me", "utc_ns": 1, "model": ' + model + "}").encode()


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("model/1", "model/2"),
        ("400", "NaN"),
        ('"note": 1.0', '"note": NaN'),
        ('"note": 1.0', '"note": [{"deep": 1e999}]'),
        ('"gain_n": 0.4', '"gain_n": 0.4, "extra": Infinity'),
        ("first_order_speed", "second_order"),
        ("14", "-14"),
    ],
)
def test_bad_models_are_refused(old: str, new: str) -> None:
    kind = MESSAGES["ModelRequest"]
    kind.from_json(model_request(MODEL))
    with pytest.raises(FrameError, match="model"):
        kind.from_json(model_request(MODEL.replace(old, new)))


@pytest.mark.parametrize(
    "carried", ["\ud800", ["\udfff"], {"\ud800": 1}, {"a": [{"b": "x\ud800"}]}, 2**63]
)
def test_a_model_carries_nothing_that_cannot_be_written_again(carried: object) -> None:
    document = json.loads(MODEL)
    Model.model_validate(document | {"note": "\U0001f600"})
    for place in ("note", "provenance"):
        told = {"note": carried} if place == "provenance" else carried
        with pytest.raises(ValidationError, match="not accepted"):
            Model.model_validate(document | {place: told})


def test_a_model_is_nested_as_deeply_as_it_can_be_read_again() -> None:
    def nested(levels: int) -> str:
        return MODEL.replace('"note": 1.0', '"note": ' + "[" * levels + "]" * levels)

    most = MAX_DEPTH - 2
    whole = Model.model_validate_json(nested(most))
    assert Model.model_validate_json(whole.to_json()) == whole
    with pytest.raises(ValidationError, match=f"more than {MAX_DEPTH} levels"):
        Model.model_validate_json(nested(most + 1))


def test_a_model_keeps_what_it_does_not_know() -> None:
    newer = MODEL.replace('"gain_n"', '"colour": "red", "gain_n"')
    again = Model.model_validate_json(Model.model_validate_json(newer).to_json())
    assert json.loads(again.to_json())["base"]["colour"] == "red"


@quick
@given(st.integers(0, 10**9), st.integers(0, 10**9))
def test_time_is_linear_and_exact_to_a_nanosecond(sample: int, later: int) -> None:
    time = TimeState(
        run=1,
        sample=sample,
        utc_ns=1_767_225_600_000_000_000,
        ns_per_sample=50_000.0,
        uncertainty_ns=1,
        skew_ppm=0.0,
        utc_steps=0,
    )
    assert time.utc_of(sample) == time.utc_ns
    assert time.utc_of(later) - time.utc_ns == 50_000 * (later - sample)


def test_every_error_is_also_the_natural_builtin() -> None:
    from frictus import errors

    builtins = (ValueError, RuntimeError, LookupError, ConnectionError, TimeoutError)
    natural = {"UnreadableFileError": OSError, "NotLoggedError": OSError}
    for name, kind in vars(errors).items():
        if isinstance(kind, type) and issubclass(kind, FrictusError) and kind != FrictusError:
            assert issubclass(kind, natural.get(name, builtins)), name

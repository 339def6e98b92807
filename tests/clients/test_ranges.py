"""Every number of a message has a range that it can have, and every integer 64 bits."""

import struct
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from pydantic import TypeAdapter

from frictus.errors import FrameError
from frictus.messages import (
    MESSAGES,
    GuidanceState,
    LeaseRenewal,
    PointerState,
    Request,
)
from frictus.stream import StreamFrame
from frictus.textures import Texture

LOWEST = ("minimum", "exclusiveMinimum")
HIGHEST = ("maximum", "exclusiveMaximum")


def numbers(schema: Any, path: str = "") -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield every number of a JSON schema, those of its definitions included, with its path."""
    if isinstance(schema, list):
        for n, item in enumerate(schema):
            yield from numbers(item, f"{path}.{n}")
    elif isinstance(schema, dict):
        if schema.get("type") in ("number", "integer"):
            yield path, schema
        for key, item in schema.items():
            yield from numbers(item, f"{path}.{key}")


def bounded(schema: dict[str, Any]) -> bool:
    return any(k in schema for k in LOWEST) and any(k in schema for k in HIGHEST)


@pytest.mark.parametrize("name", MESSAGES)
def test_every_number_has_a_range(name: str) -> None:
    schema = MESSAGES[name].model_json_schema()
    found = list(numbers(schema))
    assert found
    assert [path for path, one in found if not bounded(one)] == []


@pytest.mark.parametrize("name", MESSAGES)
def test_every_integer_fits_64_bits(name: str) -> None:
    wide = [
        path
        for path, one in numbers(MESSAGES[name].model_json_schema())
        if one["type"] == "integer"
        and not (
            bounded(one)
            and min(one[k] for k in LOWEST if k in one) >= -(2**63)
            and max(one[k] for k in HIGHEST if k in one) <= 2**63
        )
    ]
    assert wide == []


@pytest.mark.parametrize("digits", [20, 400, 5_000])
@pytest.mark.parametrize("kind", [Request, LeaseRenewal, PointerState, GuidanceState])
def test_an_endless_integer_is_a_frame_error(kind: type[Any], digits: int) -> None:
    payload = b'{"client":"a","utc_ns":1' + b"0" * digits + b"}"
    with pytest.raises(FrameError, match=r"utc_ns|number"):
        kind.from_json(payload)


def test_what_is_wrong_is_told_shortly() -> None:
    payload = b'{"client":' + b"[" * 50 + b'"' + b"x" * 1_000_000 + b'"' + b"]" * 50 + b"}"
    with pytest.raises(FrameError) as raised:
        Request.from_json(payload)
    assert len(str(raised.value)) < 500


@pytest.mark.parametrize(
    ("texture", "field"),
    [
        (
            {"kind": "spectrum", "components": [{"amplitude_n": 1, "cycles_per_mm": 5e-324}]},
            "cyc",
        ),
        ({"kind": "spectrum", "components": [{"amplitude_n": 1, "hz": 5e-324}]}, "hz"),
        ({"kind": "profile", "friction_n": [0, 1], "period_mm": 5e-324}, "period_mm"),
        ({"kind": "profile", "friction_n": [0, 1], "period_s": 5e-324}, "period_s"),
        ({"kind": "beta", "alpha": 5e-324, "beta": 1, "rms_n": 1}, "alpha"),
        ({"kind": "beta", "alpha": 1, "beta": 1, "rms_n": 1, "scale": 1e300}, "scale"),
        (
            {"kind": "slope", "peak_hz": 50, "low_order": 1, "high_order": 1, "rms_n": 0},
            "rms_n",
        ),
    ],
)
def test_what_is_finite_but_not_physical_is_refused(
    texture: dict[str, Any], field: str
) -> None:
    with pytest.raises(ValueError, match=field):
        TypeAdapter(Texture).validate_python(texture)


def test_a_streamed_period_has_a_range() -> None:
    frame = StreamFrame(1, 0, 0, 100, 1.0, True, 0.0, np.zeros(2, dtype=np.float32)).pack()
    assert StreamFrame.unpack(frame).period == 1.0
    tiny = frame.replace(struct.pack("<d", 1.0), struct.pack("<d", 5e-324))
    with pytest.raises(FrameError, match="period"):
        StreamFrame.unpack(tiny)

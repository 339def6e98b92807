"""What a page sends is read strictly, and never repeated where a token may be in it."""

import json
from typing import Any

import pytest

from frictus.websocket.messages import MAX_BYTES, Hello, Point, Watch
from frictus_service.api.dashboard.messages import BAD_DATA, RefusedViewerError, read


def asked(**fields: Any) -> Any:
    return read(json.dumps(fields))


def test_what_is_left_out_is_usual() -> None:
    watch = asked(op="watch", rig="rig1", streams=["force", "truth"])
    assert watch == Watch(op="watch", rig="rig1", streams=("force", "truth"))
    assert (watch.rate_hz, watch.columns, watch.window_s, watch.raw) == (
        60.0,
        1_200,
        2.0,
        False,
    )
    assert asked(op="point", x_mm=3, y_mm=4) == Point(op="point", x_mm=3.0, y_mm=4.0)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{",
        "null",
        "[]",
        '"watch"',
        "{}",
        "[" * 20_000,
        '{"op":"arm"}',
        '{"op":["watch"]}',
        '{"op":"hello"}',
        '{"op":"hello","version":2}',
        '{"op":"hello","version":true}',
        '{"op":"hello","version":1,"token":7}',
        '{"op":"watch"}',
        '{"op":"watch","rig":"../rig1"}',
        '{"op":"watch","rig":"rig1","streams":["smell"]}',
        '{"op":"watch","rig":"rig1","streams":"force"}',
        '{"op":"watch","rig":"rig1","rate_hz":1000}',
        '{"op":"watch","rig":"rig1","rate_hz":"60"}',
        '{"op":"watch","rig":"rig1","columns":1e9}',
        '{"op":"watch","rig":"rig1","window_s":NaN}',
        '{"op":"watch","rig":"rig1","also":1}',
        '{"op":"point","x_mm":1}',
        '{"op":"point","x_mm":NaN,"y_mm":1}',
        '{"op":"point","x_mm":1,"y_mm":-10001}',
        '{"op":"point","x_mm":1,"y_mm":1,"normal_force_n":6}',
        '{"op":"ping","id":-1}',
        '{"op":"ping","id":1.5}',
    ],
)
def test_anything_else_is_refused(text: str) -> None:
    with pytest.raises(RefusedViewerError) as caught:
        read(text)
    assert (caught.value.code, caught.value.close) == ("malformed", BAD_DATA)
    assert str(caught.value)


def test_too_large_is_refused_unread() -> None:
    with pytest.raises(RefusedViewerError, match=str(MAX_BYTES)):
        read(" " * (MAX_BYTES + 1))


def test_no_message_shows_the_token() -> None:
    secret = "a-secret-that-nobody-should-see"
    hello = asked(op="hello", version=1, token=secret)
    assert isinstance(hello, Hello)
    assert secret not in repr(hello)
    with pytest.raises(RefusedViewerError) as caught:
        asked(op="hello", version=3, token=secret)
    assert secret not in str(caught.value)

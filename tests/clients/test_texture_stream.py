"""A texture stream that several threads send over, or close while another sends."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import zenoh

from frictus.errors import ArgumentError, LeaseLostError, LinkError, NoRigError, RefusedError
from frictus.keys import RigKeys, Topics
from frictus.messages import Reply
from frictus.stream import StreamFrame, TextureStream


class Closing:
    """Friction during whose reading another thread closes the stream."""

    def __init__(self, stream: TextureStream) -> None:
        self._stream = stream

    def __array__(self, *_: Any, **options: Any) -> Any:
        self._stream.close()
        return np.zeros(2, np.float32)


class Together:
    """Friction that is read once another update is read at the same time, if it ever is."""

    def __init__(self, both: threading.Barrier) -> None:
        self._both = both

    def __array__(self, *_: Any, **options: Any) -> Any:
        with suppress(threading.BrokenBarrierError):
            self._both.wait(0.5)
        return np.zeros(2, np.float32)


@contextmanager
def opened() -> Iterator[tuple[TextureStream, zenoh.Session]]:
    config = zenoh.Config()
    config.insert_json5("scouting/multicast/enabled", "false")
    config.insert_json5("listen/endpoints", "[]")
    with zenoh.open(config) as session:
        caller: Any = SimpleNamespace(
            session=session,
            keys=RigKeys("lab", "rig1"),
            call=lambda name, **_: Reply(ok=True, ticket=1),
        )
        status: Any = SimpleNamespace(newest=lambda: None)
        yield TextureStream(caller, status, 0.1), session


def test_updates_of_two_threads_have_numbers_of_their_own() -> None:
    with opened() as (stream, session):
        key = RigKeys("lab", "rig1").of(Topics.TEXTURE)
        updates = session.declare_subscriber(key, zenoh.handlers.FifoChannel(8))
        friction = Together(threading.Barrier(2))
        threads = [
            threading.Thread(target=stream.send, args=(friction,), kwargs={"period_mm": 2.0})
            for _ in range(2)
        ]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        came = [StreamFrame.unpack(updates.recv().payload.to_bytes()) for _ in range(2)]
        assert [frame.sequence for frame in came] == [0, 1]
        assert stream.sent == 2


def test_a_stream_that_is_closed_while_it_sends_says_so() -> None:
    with opened() as (stream, _):
        with pytest.raises(LinkError, match="not sent"):
            stream.send(Closing(stream), period_mm=2.0)
        assert (stream.closed, stream.sent) == (True, 0)


@pytest.mark.parametrize(
    "refusal", [RefusedError("stale", "3600 s old"), NoRigError("gone"), LinkError("no router")]
)
def test_a_stream_that_is_known_to_have_ended_closes_without_an_error(
    refusal: Exception,
) -> None:
    def refuse(name: str, **_: Any) -> Reply:
        raise refusal

    for ended in (False, True):
        with opened() as (stream, _):
            stream._caller.call = refuse  # type: ignore[method-assign,assignment]
            if ended:
                stream.fail(LeaseLostError("stopped"))
                stream.close()
            else:
                with pytest.raises(type(refusal)):
                    stream.close()


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"ttl_ms": 200.0}, r"ttl_ms 200\.0: 1 to 60000 accepted, whole"),
        ({"period_mm": "2"}, "period '2' mm: 0.001 to 1000 accepted"),
        ({"angle_deg": None}, "angle None deg: -360 to 360 accepted"),
    ],
)
def test_what_is_no_number_is_named(changes: dict[str, Any], told: str) -> None:
    with opened() as (stream, _), pytest.raises(ArgumentError, match=told):
        stream.send(np.zeros(2), **({"period_mm": 2.0} | changes))
    assert stream.sent == 0

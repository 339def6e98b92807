"""Whatever arrives, and however reading it fails, its reader goes on."""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest
import zenoh

from frictus.errors import FrameError
from frictus.mailbox import Arrival
from frictus.messages import FingerState
from frictus.reception import Declare, Feed, Latest

FAILURES = (FrameError("x"), OverflowError("x"), RecursionError("x"), KeyError("x"))


class Network:
    """Stands for a subscription; hands over what the test sends."""

    def __init__(self) -> None:
        self._put: Callable[[Any], None] = lambda _: None

    @property
    def declare(self) -> Declare:
        def declared(callback: Any) -> Any:
            self._put, _drop = callback.callback, callback.drop
            return SimpleNamespace(undeclare=lambda: None)

        return declared

    def send(self, payload: bytes) -> None:
        sample = SimpleNamespace(
            key_expr="k", payload=zenoh.ZBytes(payload), kind=zenoh.SampleKind.PUT
        )
        self._put(sample)


@pytest.mark.parametrize("failure", FAILURES, ids=lambda failure: type(failure).__name__)
def test_a_failure_of_reading_is_counted(failure: Exception) -> None:
    def decode(arrival: Arrival) -> list[bytes]:
        if arrival.payload == b"bad":
            raise failure
        return [arrival.payload]

    network = Network()
    with Feed(network.declare, decode, 8) as feed:
        for payload in (b"1", b"bad", b"2"):
            network.send(payload)
        assert feed.drain() == [b"1", b"2"]
        assert feed.unreadable == 1


@pytest.mark.parametrize("failure", FAILURES, ids=lambda failure: type(failure).__name__)
def test_a_latest_value_that_cannot_be_read_is_told_as_such(failure: Exception) -> None:
    def decode(arrival: Arrival) -> bytes:
        if arrival.payload == b"bad":
            raise failure
        return arrival.payload

    network = Network()
    latest = Latest(network.declare, decode)
    network.send(b"bad")
    with pytest.raises(FrameError, match="x"):
        latest.value(0.0)
    network.send(b"good")
    assert latest.value(0.0) == b"good"


@pytest.mark.parametrize(
    "payload", [b"", b"\xff", b"[" * 100_000, b"1" * 5_000, b'{"a":1e999}']
)
def test_no_payload_is_more_than_a_frame_error(payload: bytes) -> None:
    with pytest.raises(FrameError):
        FingerState.from_json(payload)

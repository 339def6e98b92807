"""The client's side of recording, against a recorder that says what a recorder says."""

import queue
import time
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import pytest
import zenoh

import frictus
from frictus import Block, Client, Gap, Topics
from frictus.errors import ArgumentError, LinkError, OutdatedStateError, RefusedError
from frictus.keys import RECORDER_CALLS
from frictus.messages import MESSAGES, RecordingState, Reply

WAIT_S = 10.0


class FakeRecorder:
    """Answers on the session of a fake rig, and notes what it was asked."""

    def __init__(self, fake: Any) -> None:
        self._fake = fake
        self.calls: queue.Queue[Any] = queue.Queue()
        self.refusal: Reply | None = None
        self.publishes = True
        self._name: str | None = None
        self._declared = [
            fake.session.declare_queryable(
                fake.keys.call(call),
                lambda query, call=call: self._answer(call, query),
            )
            for call in RECORDER_CALLS
        ]
        self._tell(recording=False)

    def _tell(self, recording: bool) -> None:
        state = RecordingState(utc_ns=time.time_ns(), recording=recording, name=self._name)
        self._fake.say(Topics.RECORDING, state)

    def _answer(self, call: str, query: zenoh.Query) -> None:
        assert query.payload is not None
        request: Any = MESSAGES[RECORDER_CALLS[call]].from_json(query.payload.to_bytes())
        self.calls.put(request)
        if self.refusal is None:
            self._name = getattr(request, "name", self._name)
            if self.publishes:
                self._tell(recording=call == "record")
        with query:
            query.reply(query.key_expr, (self.refusal or Reply(ok=True)).to_json())

    def close(self) -> None:
        for declared in self._declared:
            declared.undeclare()


@pytest.fixture
def recorder(fake: Any) -> Iterator[FakeRecorder]:
    recorder = FakeRecorder(fake)
    yield recorder
    recorder.close()


def test_record_returns_once_it_is_recorded(client: Client, recorder: FakeRecorder) -> None:
    rig = client.rig("sim")
    assert not rig.recording().recording
    begun = rig.record("one", participant="p1", notes="by hand")
    assert (begun.name, begun.recording) == ("one", True)
    request = recorder.calls.get(timeout=WAIT_S)
    assert (request.client, request.name) == ("tester", "one")
    assert (request.participant, request.notes) == ("p1", "by hand")
    ended = rig.end_recording()
    assert (ended.name, ended.recording) == ("one", False)
    again = rig.record("one")  # its file was deleted
    assert again.recording
    assert again.utc_ns > ended.utc_ns


def test_what_the_recorder_confirms_and_does_not_publish_is_outdated(
    router: str, fake: Any, recorder: FakeRecorder
) -> None:
    recorder.publishes = False
    with frictus.connect(router, timeout_s=0.3) as client:
        rig = client.rig("sim")
        with pytest.raises(OutdatedStateError, match="recorder of rig sim has done it"):
            rig.record("one")


def test_a_refusal_is_an_error(client: Client, recorder: FakeRecorder) -> None:
    recorder.refusal = Reply(ok=False, code="conflict", message="the name is taken")
    with pytest.raises(RefusedError, match="taken") as refused:
        client.rig("sim").record("one")
    assert refused.value.code == "conflict"


@pytest.mark.parametrize("name", ["", "a/b", "x" * 101, "ä"])
def test_bad_names_are_not_sent(client: Client, recorder: FakeRecorder, name: str) -> None:
    with pytest.raises(ArgumentError, match="name"):
        client.rig("sim").record(name)
    assert recorder.calls.empty()


def test_without_a_recorder_the_error_says_how_to_start_one(router: str, fake: Any) -> None:
    with frictus.connect(router, timeout_s=1.0) as client:
        rig = client.rig("sim")
        asks: list[Callable[[], object]] = [
            partial(rig.record, "one"),
            rig.end_recording,
            rig.recording,
        ]
        for ask in asks:
            with pytest.raises(LinkError, match="frictus recorder"):
                ask()


def test_drain_returns_what_is_there_and_does_not_wait(client: Client, fake: Any) -> None:
    feed = client.rig("sim").blocks("force")
    assert feed.drain() == []
    found: list[Block | Gap] = []
    deadline = time.monotonic() + WAIT_S
    while not found:  # until the rig knows of this reader; what comes again is left out
        assert time.monotonic() < deadline
        fake.say(Topics.FORCE, fake.block(0))
        found += feed.drain()
    for sequence in (1, 4):
        fake.say(Topics.FORCE, fake.block(sequence))
    while len(found) < 4:  # they come when they come; drain itself never waits
        assert time.monotonic() < deadline
        found += feed.drain()
    assert [type(item) for item in found] == [Block, Block, Gap, Block]
    feed.close()
    with pytest.raises(RuntimeError, match="closed"):
        feed.drain()

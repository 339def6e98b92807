"""What the recorder takes from the network: everything, or a note of what is missing."""

import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import zenoh

from frictus.keys import RigKeys, Topics
from frictus.messages import MarkerState
from frictus.session import open_router, open_session
from frictus_service.processes import free_endpoint
from frictus_service.recording import recording as intake_module
from frictus_service.recording.reader import RecordingReader, State
from frictus_service.recording.recording import Intake
from frictus_service.recording.records import GapNote
from frictus_service.recording.samples import Samples
from frictus_service.recording.writer import RecordingWriter

KEYS = RigKeys("lab", "rig1")
WAIT_S = 20.0


@pytest.fixture
def sessions() -> Iterator[tuple[zenoh.Session, zenoh.Session]]:
    """A publisher's session and a recorder's."""
    endpoint = free_endpoint()
    with open_router(endpoint), open_session(endpoint) as one, open_session(endpoint) as other:
        yield one, other


def put(session: zenoh.Session, topic: Any, payload: bytes) -> None:
    session.put(KEYS.of(topic), payload, congestion_control=zenoh.CongestionControl.BLOCK)


def settle(publisher: zenoh.Session, session: zenoh.Session) -> None:
    """Wait until the router knows of everything that `session` has declared so far."""
    arrived = threading.Event()
    last = session.declare_subscriber(KEYS.of(Topics.POINTER), lambda _sample: arrived.set())
    deadline_s = time.monotonic() + WAIT_S
    while not arrived.wait(0.01):
        assert time.monotonic() < deadline_s
        put(publisher, Topics.POINTER, b"")
    last.undeclare()  # type: ignore[no-untyped-call]


def test_gaps_garbage_and_states_are_written_down(
    tmp_path: Path, known: Any, sessions: tuple[zenoh.Session, zenoh.Session]
) -> None:
    publisher, session = sessions
    path = tmp_path / "a.mcap"
    marker = MarkerState(utc_ns=known.UTC_NS, source="lsl: psychopy", text="trial 1")
    with (
        Intake(session, KEYS) as intake,
        RecordingWriter(path, known.info("a"), {}, lambda: 0.0) as writer,
    ):
        settle(publisher, session)
        put(publisher, Topics.FORCE, b"not a block")
        for sequence in (0, 1, 5):
            put(publisher, Topics.FORCE, known.block(known.FORCE, sequence).pack())
        put(publisher, Topics.TOUCH, b"not a report")
        put(publisher, Topics.MARKER, marker.to_json())
        put(publisher, Topics.TOUCH, known.touch(3).to_json())
        deadline_s = time.monotonic() + WAIT_S
        while intake.received_blocks < 3 or len(states_in(writer)) < 2:
            assert time.monotonic() < deadline_s
            intake.drain_into(writer, known.UTC_NS)
        assert intake.lost_blocks == 3
        writer.end("asked for", known.UTC_NS)
    with RecordingReader(path) as reader:
        items = list(reader.items())
    gaps = [item for item in items if isinstance(item, GapNote)]
    told = {(gap.stream, gap.reason, gap.missing_blocks) for gap in gaps}
    assert told == {
        ("force", "unreadable", 0),
        ("force", "lost", 3),
        ("state/touch", "overflow", 1),
    }
    force = [item for item in items if isinstance(item, Samples)]
    assert [(item.first_sequence, item.blocks) for item in force] == [(0, 2), (5, 1)]
    states = [item.message for item in items if isinstance(item, State)]
    assert sorted(states, key=repr) == [marker, known.touch(3)]


def test_a_block_that_counts_beyond_64_bits_is_not_recorded(
    tmp_path: Path, known: Any, sessions: tuple[zenoh.Session, zenoh.Session]
) -> None:
    publisher, session = sessions
    path = tmp_path / "a.mcap"
    beyond = replace(known.block(known.FORCE, 0), first_sample=2**64 - 1)
    with (
        Intake(session, KEYS) as intake,
        RecordingWriter(path, known.info("a"), {}, lambda: 0.0) as writer,
    ):
        settle(publisher, session)
        for block in (beyond, known.block(known.FORCE, 0)):
            put(publisher, Topics.FORCE, block.pack())
        deadline_s = time.monotonic() + WAIT_S
        while intake.received_blocks < 1:
            assert time.monotonic() < deadline_s
            intake.drain_into(writer, known.UTC_NS)
        writer.end("asked for", known.UTC_NS)
    with RecordingReader(path) as reader:
        items = list(reader.items())
        assert reader.ending.complete
    assert [item.reason for item in items if isinstance(item, GapNote)] == ["unreadable"]
    assert [item.first_sample for item in items if isinstance(item, Samples)] == [0]


def states_in(writer: RecordingWriter) -> list[State]:
    """States that were written; a chunk that is not closed yet shows nothing."""
    writer.sync()
    with RecordingReader(writer.path) as reader:
        return [item for item in reader.items() if isinstance(item, State)]


def test_a_recorder_that_is_too_slow_writes_down_how_much_it_missed(
    tmp_path: Path,
    known: Any,
    sessions: tuple[zenoh.Session, zenoh.Session],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    publisher, session = sessions
    monkeypatch.setattr(intake_module, "STATE_QUEUE", 8)
    monkeypatch.setattr(intake_module, "BLOCK_QUEUE", 8)
    path = tmp_path / "a.mcap"
    with (
        Intake(session, KEYS) as intake,
        RecordingWriter(path, known.info("a"), {}, lambda: 0.0) as writer,
    ):
        arrived: list[bytes] = []
        counting = session.declare_subscriber(
            KEYS.of(Topics.TOUCH), lambda sample: arrived.append(sample.payload.to_bytes())
        )
        settle(publisher, session)
        for sequence in range(50):
            put(publisher, Topics.FORCE, known.block(known.FORCE, sequence).pack())
            put(publisher, Topics.TOUCH, known.touch(sequence).to_json())
        deadline_s = time.monotonic() + WAIT_S
        while len(arrived) < 50 or intake.received_blocks + intake.lost_blocks < 50:
            assert time.monotonic() < deadline_s
            if len(arrived) == 50:
                intake.drain_into(writer, known.UTC_NS)
        intake.drain_into(writer, known.UTC_NS)
        counting.undeclare()  # type: ignore[no-untyped-call]
        writer.end("asked for", known.UTC_NS)
    with RecordingReader(path) as reader:
        items = list(reader.items())
    states = sum(isinstance(item, State) for item in items)
    blocks = sum(item.blocks for item in items if isinstance(item, Samples))
    gaps = [item for item in items if isinstance(item, GapNote)]
    for stream, found in (("state/touch", states), ("force", blocks)):
        missed = sum(gap.missing_blocks for gap in gaps if gap.stream == stream)
        assert missed > 0
        assert found + missed == 50
    assert {gap.reason for gap in gaps} == {"overflow"}

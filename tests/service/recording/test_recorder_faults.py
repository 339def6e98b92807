"""What befalls a recorder: payloads of strangers, kills, clocks, files that are taken away."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, get_args

import pytest
from tests.service.recording.recorder_service import (
    Service,
    samples_of,
    summary_of,
    until,
)

import frictus
from frictus.keys import RECORDER_CALLS, Topic, Topics
from frictus.messages import RecordingState, RecordRequest, RefusalCode, Reply
from frictus.protocol import EXAMPLE_BLOCK
from frictus_service.recording.reader import RecordingReader
from frictus_service.recording.recording import RecordingSession
from frictus_service.recording.records import PresenceNote
from frictus_service.recording.summary import length_s, shelf_entry

posix_signals = pytest.mark.skipif(
    sys.platform == "win32", reason="Windows has no SIGKILL for others"
)
SLEPT_S = 3.0
HUGE = 10**400
HOSTILE_FIELDS: list[dict[str, Any]] = [
    {"utc_ns": HUGE},
    {"utc_ns": -HUGE},
    {"utc_ns": 2**63},
    {"utc_ns": 10**4_299},
    {"utc_ns": 1e308},
    {"utc_ns": None},
    {"ttl_ms": HUGE},
    {"ttl_ms": -1},
    {"client": ""},
]
HOSTILE_NAMES = ("..", ".", "nul", "x/y", "x\0", "", "a" * 101, "a.")
HOSTILE_BYTES = (
    b"",
    b"null",
    b"[]",
    b"\xff\xfe",
    b"[" * 100_000,
    b'{"a":' * 100_000,
    b"1" * 5_000,
    b'{"utc_ns":1e999}',
    b"x" * 300_000,
)


def hostile_calls() -> Iterator[tuple[str, bytes]]:
    """Give calls of the recorder that it must refuse, one and all."""
    for call in RECORDER_CALLS:
        asked = {"client": "stranger", "utc_ns": time.time_ns(), "name": "hostile"}
        for fields in HOSTILE_FIELDS:
            yield call, json.dumps(asked | fields).encode()
        for content in HOSTILE_BYTES:
            yield call, content
    for name in HOSTILE_NAMES:
        yield "record", json.dumps(asked | {"name": name}).encode()


def hostile_publications() -> Iterator[tuple[Topic, bytes]]:
    """Give what a stranger may put where a rig publishes."""
    finger = {
        "sequence": 1,
        "sample": 1,
        "utc_ns": 1,
        "uncertainty_ns": 1,
        "in_contact": True,
        "source": "touch",
        "stale": False,
        "extrapolated": False,
    } | dict.fromkeys(("x_mm", "y_mm", "vx_mm_s", "vy_mm_s", "normal_force_n", "age_ms"), 0.0)
    for utc_ns in (HUGE, -HUGE, -1, 2**63, 2**64):
        yield Topics.FINGER, json.dumps(finger | {"utc_ns": utc_ns}).encode()
    for content in HOSTILE_BYTES:
        yield Topics.FINGER, content
        yield Topics.FORCE, content
    extremes: dict[str, list[Any]] = {
        "sample_rate_hz": [1e-300, 9.9e8],
        "first_sample": [2**64 - 1],
        "utc_ns": [-(2**63), 2**63 - 1],
        "sequence": [2**64 - 1],
        "flags": [frictus.Flag(2**32 - 1)],
    }
    for field, values in extremes.items():
        for value in values:
            yield Topics.FORCE, replace(EXAMPLE_BLOCK, **{field: value}).pack()


def test_no_payload_ends_the_recorder(
    service: Service, client: frictus.Client, rig: frictus.Rig
) -> None:
    session = client.session
    before = until(rig, lambda state: not state.recording).refused_calls
    asked = list(hostile_calls())
    for call, payload in asked:
        (answer,) = session.get(rig.keys.call(call), payload=payload, timeout=60.0)
        assert answer.ok is not None, (call, payload[:80])
        reply = Reply.from_json(answer.ok.payload.to_bytes())
        assert not reply.ok, (call, payload[:80])
        assert reply.code in get_args(RefusalCode)
        assert reply.message
    begun = rig.record("under-attack")
    assert begun.refused_calls == before + len(asked)
    until(rig, lambda state: state.blocks > 10)
    for topic, payload in hostile_publications():
        session.put(rig.keys.of(topic), payload)
    rig.end_recording()
    rig.record("after-attack")
    until(rig, lambda state: state.blocks > 100)
    ended = rig.end_recording()
    assert ended.problem is None
    recordings = service.config.recordings
    assert summary_of(recordings / "after-attack.mcap").sound
    attacked = summary_of(recordings / "under-attack.mcap")
    assert attacked.ending.complete
    assert attacked.states["state/finger"] > 0


@posix_signals
def test_killed_recorder_is_started_again_and_says_what_it_left(
    service: Service, rig: frictus.Rig
) -> None:
    begun = rig.record("killed")
    until(rig, lambda state: state.seconds > 1.0)
    os.kill(service.supervisor.pid_of("recorder"), signal.SIGKILL)
    assert "killed.mcap" in service.wait_for("frictus recover")
    service.wait_for("recorder is ready")
    state = until(rig, lambda state: not state.recording)
    assert state.name == "killed"
    assert state.problem is not None
    assert begun.path is not None
    summary = summary_of(Path(begun.path))
    assert not summary.ending.complete
    assert summary.ending.clean_s > 0.5
    assert summary.faults == ()
    rig.record("after-the-kill")
    assert rig.end_recording().problem is None


@posix_signals
def test_what_was_missed_just_before_the_end_is_told(
    service: Service, rig: frictus.Rig, tmp_path: Path
) -> None:
    """A machine that slept until the end told of no gap: no block had followed it yet."""
    path = tmp_path / "slept.mcap"
    at = ["--router", service.config.router.endpoint, "--rig", rig.name, "--out", str(path)]
    command = [sys.executable, "-c", "from frictus_service.cli import main; main()", "record"]
    with subprocess.Popen(
        [*command, *at, "--seconds", "2"], stderr=subprocess.PIPE, stdout=subprocess.DEVNULL
    ) as recorder:
        assert recorder.stderr is not None
        assert b"records" in recorder.stderr.readline()
        time.sleep(1.0)
        recorder.send_signal(signal.SIGSTOP)
        time.sleep(SLEPT_S)
        recorder.send_signal(signal.SIGCONT)
        assert recorder.wait() == 0
    summary = summary_of(path)
    assert summary.sound
    assert summary.end is not None
    assert summary.end.seconds is not None
    force = summary.streams["force"]
    told_s = force.seconds * (1.0 + force.lost_samples / force.samples)
    assert told_s == pytest.approx(summary.end.seconds, abs=0.5)


def test_a_clock_that_is_set_makes_no_recording_longer(
    service: Service, client: frictus.Client, rig: frictus.Rig, tmp_path: Path
) -> None:
    request = RecordRequest(client="me", utc_ns=0, name="set")
    path = tmp_path / "set.mcap"
    hours = iter(range(1_000))
    with RecordingSession(
        client,
        rig,
        request,
        path,
        service.config,
        utc_ns=lambda: time.time_ns() + next(hours) * 3_600 * 10**9,
    ) as recording:
        recording.beat()
    assert length_s(shelf_entry(path)) == pytest.approx(recording.state().seconds, abs=0.1)


@pytest.mark.skipif(sys.platform == "win32", reason="a file that is open stays there")
@pytest.mark.parametrize(
    "take_away",
    [
        Path.unlink,
        lambda path: path.rename(path.with_name("other.mcap")),
        lambda path: shutil.copy(path, f"{path}.new") and Path(f"{path}.new").replace(path),
        lambda path: os.truncate(path, 1_000),
    ],
)
def test_a_file_that_is_taken_away_ends_its_recording(
    service: Service,
    client: frictus.Client,
    rig: frictus.Rig,
    tmp_path: Path,
    take_away: Callable[[Path], Any],
) -> None:
    request = RecordRequest(client="me", utc_ns=0, name="taken")
    for beats in (0, 2):  # what ends at once says so, too
        path = tmp_path / f"{beats}.mcap"
        with RecordingSession(client, rig, request, path, service.config) as recording:
            recording.beat()
            assert recording.state().problem is None
            take_away(path)
            for _ in range(beats):
                recording.beat()
            assert recording.ended == (beats > 0)
        told = recording.state().problem
        assert told is not None
        assert f"{beats}.mcap is no longer the file that was written" in told


@posix_signals
def test_a_rig_that_vanishes(
    service: Service, client: frictus.Client, rig: frictus.Rig, tmp_path: Path
) -> None:
    """The recorder waits for it to come back; one that does not wait ends by itself."""
    rig.record("vanishing")
    run = rig.status().run
    request = RecordRequest(client="me", utc_ns=0, name="away")
    away = tmp_path / "away.mcap"
    recording = RecordingSession(client, rig, request, away, service.config, gone_s=0.0)
    with recording, client.presence(timeout_s=60.0) as changes:
        os.kill(service.supervisor.pid_of("rig"), signal.SIGKILL)
        assert not next(change for change in changes if not change.present).present
        while not recording.ended:
            recording.beat()
        check_away(recording.state(), away)
        assert next(change for change in changes if change.present).present
    until(rig, lambda state: state.recording and _came_again(rig, run, state))
    ended = rig.end_recording()
    assert ended.problem is None
    assert ended.path is not None
    summary = summary_of(Path(ended.path))
    assert summary.sound
    assert [note.present for note in summary.presence] == [True, False, True]
    assert {gap.reason for gap in summary.gaps} <= {"restart"}
    with RecordingReader(Path(ended.path)) as reader:
        assert len({item.run for item in samples_of(reader)}) == 2


def _came_again(rig: frictus.Rig, run: int, _state: RecordingState) -> bool:
    """Whether samples of another run have been published for a while."""
    time_fit = rig.time()
    return time_fit.run != run and time_fit.sample > 10_000


def check_away(state: RecordingState, path: Path) -> None:
    assert not state.recording
    assert state.problem is not None
    assert "vanished" in state.problem
    with RecordingReader(path) as reader:
        notes = [item for item in reader.items() if isinstance(item, PresenceNote)]
        assert [note.present for note in notes] == [True, False]
        assert reader.ending.complete


def test_a_folder_that_cannot_be_written(service: Service, rig: frictus.Rig) -> None:
    folder = service.config.recordings
    aside = folder.with_name("aside")
    folder.rename(aside)
    folder.write_bytes(b"a file where the folder was")
    try:
        with pytest.raises(frictus.RefusedError, match="cannot be made") as refused:
            rig.record("nowhere")
        assert refused.value.code == "unavailable"
    finally:
        folder.unlink()
        aside.rename(folder)

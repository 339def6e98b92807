"""A real recorder beside a real simulated rig: driven by client, REST and command line."""

import json
import os
import queue
import shutil
import signal
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest
from fastapi.testclient import TestClient
from typer.testing import CliRunner

import frictus
from frictus.keys import RECORDER_CALLS, STREAMS, Topic, Topics
from frictus.messages import RecordingState, RecordRequest, RefusalCode, Reply
from frictus.model import FirstOrderSpeedLaw
from frictus.protocol import EXAMPLE_BLOCK
from frictus_hardware import ReplayConfig, SimulatedConfig
from frictus_hardware.replay.rig import ReplayRig
from frictus_hardware.replay.tape import read_tape
from frictus_hardware.simulated.strokes import SteadyStrokes
from frictus_service.api.server import build_app
from frictus_service.cli.app import app
from frictus_service.cli.streams.record import interruption, lines_of
from frictus_service.config import ApiConfig, Config, Limits, RegistryConfig, RouterConfig
from frictus_service.daemon.processes.supervisor import Supervisor
from frictus_service.processes import free_endpoint
from frictus_service.recording.reader import RecordingReader
from frictus_service.recording.recording import RecordingSession
from frictus_service.recording.records import PresenceNote
from frictus_service.recording.samples import INT16, Samples
from frictus_service.recording.summary import RecordingSummary, length_s, shelf_entry, summarise
from frictus_service.recording.tape import export_tape

posix_signals = pytest.mark.skipif(
    sys.platform == "win32", reason="Windows has no SIGKILL for others"
)
SECRET = "a-token-that-must-not-leak"


def until(
    rig: frictus.Rig, holds: Callable[[RecordingState], bool], timeout_s: float = 60.0
) -> RecordingState:
    """Return the first state of the recorder for which something holds."""
    with rig.watch(Topics.RECORDING, timeout_s=timeout_s) as states:
        for state in states:
            assert isinstance(state, RecordingState)
            if holds(state):
                return state
    raise AssertionError("the feed has ended")


def summary_of(path: Path) -> RecordingSummary:
    with RecordingReader(path) as reader:
        return summarise(reader)


@dataclass(frozen=True)
class Service:
    config: Config
    supervisor: Supervisor
    said: "queue.Queue[str]"

    def wait_for(self, words: str) -> str:
        while words not in (line := self.said.get(timeout=60.0)):
            pass
        return line


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    folder = tmp_path_factory.mktemp("service")
    token: Any = {"name": "one", "scopes": ("read",), "value": SECRET}
    config = Config(
        backend=SimulatedConfig(finger=SteadyStrokes()),
        router=RouterConfig(endpoint=free_endpoint()),
        api=ApiConfig(port=0, tokens=(token,)),
        registry=RegistryConfig(url=f"sqlite:///{folder}/frictus.db"),
        recordings=folder / "recordings",
        limits=Limits(freeze_ms=1_000, missed_deadlines=1_000),
    )
    said: queue.Queue[str] = queue.Queue()
    with Supervisor(config, ("rig", "recorder"), say=said.put) as supervisor:
        supervisor.wait_ready(100.0)
        yield Service(config, supervisor, said)


@pytest.fixture
def client(service: Service) -> Iterator[frictus.Client]:
    with frictus.connect(service.config.router.endpoint, timeout_s=10.0) as client:
        yield client


@pytest.fixture
def rig(client: frictus.Client) -> frictus.Rig:
    return client.rig("rig1", wait_s=60.0)


def test_client_starts_and_ends_and_nothing_is_lost(service: Service, rig: frictus.Rig) -> None:
    seen: dict[int, np.ndarray] = {}
    begun = rig.record("by-client", participant="p7", notes="a note")
    assert begun.recording
    with rig.blocks("force", timeout_s=10.0) as feed:
        for block in feed:
            assert isinstance(block, frictus.Block), "this observer lost blocks"
            seen[block.first_sample] = block.data
            if len(seen) == 200:
                break
    until(rig, lambda state: state.bytes_written > begun.bytes_written)
    ended = rig.end_recording()
    assert not ended.recording
    assert ended.problem is None
    assert ended.lost_blocks == 0
    assert ended.name == "by-client"
    assert ended.path is not None
    path = Path(ended.path)
    assert path.parent == service.config.recordings
    assert path.stat().st_size == ended.bytes_written
    check_against_observer(path, seen)
    check_contents(path)
    check_played_as_a_rig(path, seen)


def check_against_observer(path: Path, seen: dict[int, np.ndarray]) -> None:
    """Hold the samples of force to those that somebody else received."""
    with RecordingReader(path) as reader:
        force = [item for item in reader.items() if isinstance(item, Samples)]
    force = [item for item in force if item.stream == 1]
    first = force[0].first_sample
    recorded = np.hstack([item.data for item in force])
    for at, data in seen.items():
        place = at - first
        if 0 <= place <= recorded.shape[1] - data.shape[1]:
            assert np.array_equal(recorded[:, place : place + data.shape[1]], data)
    assert sum(at >= first for at in seen) >= 190


def check_played_as_a_rig(path: Path, seen: dict[int, np.ndarray]) -> None:
    """Play the recording, and hold what the rig senses to what somebody else received."""
    out = path.with_suffix(".npz")
    taped = export_tape(path, out)
    played = 0
    with ReplayRig(ReplayConfig(file=out, clock="virtual"), read_tape(out)) as rig:
        for _ in range(round(taped.seconds * 20_000.0) // 100):
            block = rig.exchange(np.zeros(100))
            assert block.overrun_samples == 0
            if block.first_sample in seen:
                force_n = block.force_n.T.astype(np.float32)
                assert np.array_equal(force_n, seen[block.first_sample])
                played += 1
    assert played >= 190


def check_contents(path: Path) -> None:
    """Look for everything that a recording has to hold."""
    summary = summary_of(path)
    assert summary.sound
    assert summary.info.participant == "p7"
    assert summary.info.notes == "a note"
    assert summary.gaps == ()
    assert set(summary.streams) == {"force", "accel", "voltage", "truth", "render"}
    for suffix in ("finger", "touch", "status", "scene", "model", "time"):
        assert summary.states[f"state/{suffix}"] > 0, suffix
    with RecordingReader(path) as reader:
        attached = reader.attachments
        forms = {i.stream: i.pack(_step(reader, i))[6] for i in samples_of(reader)}
    # Force and acceleration come from a converter, and take two bytes per sample.
    assert [forms[stream] == INT16 for stream in sorted(forms)] == [True, True] + 3 * [False]
    assert {"model.json", "scene.json", "status.json", "configuration.json"} <= set(attached)
    assert b"missed_deadlines" in attached["configuration.json"]
    assert SECRET.encode() not in path.read_bytes()


def test_a_recording_holds_every_model_of_a_rig_that_follows_the_finger(
    rig: frictus.Rig, tmp_path: Path
) -> None:
    as_set = rig.model()
    law = as_set.model.base
    assert isinstance(law, FirstOrderSpeedLaw)
    finer = law.model_copy(update={"gain_n": 1.1 * law.gain_n})
    rig.set_adaptation("adapt")
    rig.record("adapted")
    with rig.arm(lease_ms=10_000):
        adapted = rig.adapt(as_set.model.model_copy(update={"base": finer}), as_set.etag, "why")
        assert rig.model().etag == adapted
        with rig.blocks("force", timeout_s=10.0) as feed:
            for _ in range(400):  # two seconds of strokes
                next(feed)
        rig.set_adaptation("observe", undo=True)
        assert rig.model().etag == as_set.etag
    recorded = rig.end_recording().path
    assert recorded is not None
    path = Path(recorded)
    summary = summary_of(path)
    assert summary.sound
    found = [(model.etag, model.adapted_from, model.reason) for model in summary.models]
    assert found == [
        (as_set.etag, None, ""),
        (adapted, as_set.etag, "why"),
        (as_set.etag, None, ""),
    ]
    lines = [line for line in lines_of(path, summary) if line.startswith("model ")]
    assert [line.split(" from ")[0] for line in lines] == [
        f"model {etag}" for etag, _, _ in found
    ]
    assert lines[1].endswith("s, adapted: why")
    trial = "--participant p7 --speed 60 --force 0.4 --tone 0".split()
    for command in (
        ["export", recorded, "--to", "replay", "--out", str(tmp_path / "tape.npz")],
        ["export", recorded, "--to", "h5", "--out", str(tmp_path / "study.h5"), *trial],
        ["track", recorded],
    ):
        told = CliRunner().invoke(app, command)
        assert told.exit_code == 0, told.output


def test_a_recording_says_which_compensation_was_in_force(
    service: Service, rig: frictus.Rig
) -> None:
    rig.record("modes")
    chosen = [frictus.Compensation(mode="model")]
    with rig.arm(lease_ms=10_000):
        for mode, speed in (("none", None), ("fixed", 60.0)):
            chosen.append(rig.compensate(mode, speed_mm_s=speed))  # type: ignore[arg-type]
            assert rig.status().compensation == chosen[-1]
    assert rig.status().compensation == chosen[0]
    path = rig.end_recording().path
    assert path is not None
    summary = summary_of(Path(path))
    found = [change.compensation for change in summary.compensations]
    assert found == [*chosen, chosen[0]]
    times = [change.utc_ns for change in summary.compensations]
    assert times == sorted(times)
    with RecordingReader(Path(path)) as reader:
        attached = json.loads(reader.attachments["status.json"])
    assert attached["compensation"] == {"mode": "model", "speed_mm_s": None}
    told = CliRunner().invoke(app, ["verify", path, "--json"])
    modes = [change["mode"] for change in json.loads(told.stdout)["compensation"]]
    assert modes == ["model", "none", "fixed", "model"]
    lines = lines_of(Path(path), summary)
    assert [line.split(" from ")[0] for line in lines if line.startswith("compensation")] == [
        "compensation model",
        "compensation none",
        "compensation fixed:60",
        "compensation model",
    ]


def samples_of(reader: RecordingReader) -> list[Samples]:
    return [item for item in reader.items() if isinstance(item, Samples)]


def _step(reader: RecordingReader, samples: Samples) -> float | None:
    name = STREAMS[samples.stream].suffix.removeprefix("stream/")
    return reader.info.converter_steps.get(name)


def test_refusals(service: Service, rig: frictus.Rig) -> None:
    with pytest.raises(frictus.RefusedError, match="nothing is being recorded"):
        rig.end_recording()
    with pytest.raises(ValueError, match="name"):
        rig.record("../escaped")
    rig.record("refusals")
    with pytest.raises(frictus.RefusedError, match="end it first") as refused:
        rig.record("another")
    assert refused.value.code == "conflict"
    rig.end_recording()
    with pytest.raises(frictus.RefusedError, match="already"):
        rig.record("refusals")


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


def test_rest(service: Service, rig: frictus.Rig) -> None:
    open_to_all = service.config.model_copy(update={"api": ApiConfig()})
    with TestClient(build_app(open_to_all), base_url="http://127.0.0.1") as api:
        base = "/v1/rigs/rig1"
        started = api.post(f"{base}/recordings", json={"name": "by-rest"})
        assert started.status_code == 201, started.text
        assert started.headers["location"] == f"{base}/recording"
        assert api.get(started.headers["location"]).json()["recording"]
        again = api.post(f"{base}/recordings", json={"name": "by-rest"})
        assert (again.status_code, again.json()["code"]) == (409, "recording_conflict")
        listed = {one["name"]: one for one in api.get("/v1/recordings").json()["recordings"]}
        assert not listed["by-rest"]["finished"]
        ended = api.post(f"{base}/recording/stop")
        assert ended.status_code == 200
        assert not ended.json()["recording"]
        assert api.post(f"{base}/recording/stop").status_code == 409
        listed = {one["name"]: one for one in api.get("/v1/recordings").json()["recordings"]}
        assert listed["by-rest"]["finished"]
        assert listed["by-rest"]["bytes"] == ended.json()["bytes_written"]
        bad = api.post(f"{base}/recordings", json={"name": "a/b", "more": 1})
        assert bad.status_code == 422
        assert api.post("/v1/rigs/absent/recordings", json={"name": "a"}).status_code == 404
        assert api.post("/v1/rigs/absent/recording/stop").status_code == 404
    assert summary_of(service.config.recordings / "by-rest.mcap").sound


@posix_signals
def test_a_recording_is_finished_whatever_ends_its_command(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        before = signal.getsignal(number)
        with interruption() as interrupted:
            signal.raise_signal(number)
        assert interrupted == [number]
        assert signal.getsignal(number) is before
    monkeypatch.setattr(signal, "getsignal", lambda _: signal.SIG_IGN)
    taken: list[int] = []
    monkeypatch.setattr(signal, "signal", lambda number, _: taken.append(number))
    with interruption():
        pass
    assert signal.SIGHUP not in taken  # `nohup` has it ignored


def test_command_line(service: Service, rig: frictus.Rig, tmp_path: Path) -> None:
    runner = CliRunner()
    at = ["--router", service.config.router.endpoint, "--rig", "rig1", "--json"]
    started = runner.invoke(app, ["record", "--start", "--name", "by-cli", *at])
    assert started.exit_code == 0, started.output
    here = tmp_path / "here.mcap"
    recorded = runner.invoke(app, ["record", "--out", str(here), "--seconds", "1", *at])
    assert recorded.exit_code == 0, recorded.output
    assert runner.invoke(app, ["record", "--stop", *at]).exit_code == 0
    assert runner.invoke(app, ["record", "--stop", *at]).exit_code == 5
    assert runner.invoke(app, ["record", "--stop", "--start", *at]).exit_code == 2
    handler = signal.getsignal(signal.SIGINT)
    taken = runner.invoke(app, ["record", "--out", str(here), *at])
    assert taken.exit_code == 2
    assert signal.getsignal(signal.SIGINT) is handler
    verified = runner.invoke(app, ["verify", str(here), "--json"])
    assert verified.exit_code == 0
    assert '"sound": true' in verified.output
    torn = tmp_path / "torn.mcap"
    torn.write_bytes(here.read_bytes()[:-40_000])
    assert runner.invoke(app, ["verify", str(torn)]).exit_code == 6
    mended = tmp_path / "mended.mcap"
    assert runner.invoke(app, ["recover", str(torn), "--out", str(mended)]).exit_code == 0
    assert runner.invoke(app, ["verify", str(mended)]).exit_code == 0
    (tmp_path / "text.mcap").write_text("not a recording", encoding="utf-8")
    assert runner.invoke(app, ["verify", str(tmp_path / "text.mcap")]).exit_code == 2
    study = tmp_path / "study.h5"
    said = ["--participant", "p1", "--speed", "60", "--force", "0.4", "--tone", "0"]
    exported = runner.invoke(app, ["export", str(here), "--out", str(study), *said])
    assert exported.exit_code == 0, exported.output
    assert runner.invoke(app, ["study", "show", "--check", str(study)]).exit_code == 0


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

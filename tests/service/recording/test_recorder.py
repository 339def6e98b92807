"""A real recorder beside a real simulated rig: driven by client, REST and command line."""

import json
import signal
import sys
from pathlib import Path

import numpy as np
import pytest
from fastapi.testclient import TestClient
from tests.service.recording.recorder_service import (
    SECRET,
    Service,
    samples_of,
    summary_of,
    until,
)
from typer.testing import CliRunner

import frictus
from frictus.keys import STREAMS
from frictus.model import FirstOrderSpeedLaw
from frictus_hardware import ReplayConfig
from frictus_hardware.replay.rig import ReplayRig
from frictus_hardware.replay.tape import read_tape
from frictus_service.api.server import build_app
from frictus_service.cli.app import app
from frictus_service.cli.streams.record import lines_of
from frictus_service.config import ApiConfig
from frictus_service.processes import interruption
from frictus_service.recording.reader import RecordingReader
from frictus_service.recording.samples import INT16, Samples
from frictus_service.recording.tape import export_tape

posix_signals = pytest.mark.skipif(
    sys.platform == "win32", reason="Windows has no SIGKILL for others"
)


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

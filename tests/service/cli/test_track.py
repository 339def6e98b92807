"""`frictus track` beside a real rig with a simulated person, and over its recording."""

import json
import math
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from tests.patience import PATIENT
from tests.service.recording import known
from typer.testing import CliRunner

import frictus
from frictus.errors import LinkError
from frictus.keys import Topics
from frictus.messages import EstimateState, Interval, LawNow, LawValues, ModelChange
from frictus.model import Covariance, FirstOrderSpeedLaw, Model
from frictus.recordings import texture_of
from frictus.textures import Region, Scene
from frictus_hardware import SimulatedConfig
from frictus_hardware.simulated.config import SimulatedParticipant
from frictus_hardware.simulated.strokes import SteadyStrokes
from frictus_service.cli.app import app
from frictus_service.cli.options import Exit
from frictus_service.cli.streams.track import line_of, summary_of
from frictus_service.config import ApiConfig, Config, RouterConfig
from frictus_service.daemon.processes.supervisor import Supervisor
from frictus_service.library import SHIPPED
from frictus_service.processes import free_endpoint
from frictus_service.recording.writer import RecordingWriter

PERSON = SimulatedParticipant(gain_n=0.3, cutoff_0_hz=700.0, slope_hz_per_mm_s=25.0)
SLIDING_S = 6.0


@pytest.fixture(scope="module")
def endpoint() -> Iterator[str]:
    config = Config(
        backend=SimulatedConfig(
            finger=SteadyStrokes(speed_mm_s=40.0), participant=PERSON, lead_ms=100.0
        ),
        block_ms=10.0,
        router=RouterConfig(endpoint=free_endpoint()),
        api=ApiConfig(port=0),
        limits=PATIENT,
    )
    with Supervisor(config, ("rig",), say=lambda _line: None) as supervisor:
        supervisor.wait_ready(100.0)
        yield config.router.endpoint


def run(*args: object) -> Any:
    return CliRunner().invoke(app, [str(arg) for arg in args])


def started(*args: object) -> subprocess.Popen[str]:
    main = "from frictus_service.cli import main; main()"
    command = [sys.executable, "-c", main, *(str(arg) for arg in args)]
    pipe = subprocess.PIPE
    return subprocess.Popen(command, stdout=pipe, stderr=pipe, text=True)


def law_of(file: Path) -> FirstOrderSpeedLaw:
    model = Model.model_validate_json(file.read_bytes())
    assert not model.placeholder
    assert model.provenance["source"] == "live"
    law = model.base
    assert isinstance(law, FirstOrderSpeedLaw)
    return law


@pytest.mark.long
def test_it_learns_the_person_from_a_texture_and_from_a_recording_of_it(
    endpoint: str, tmp_path: Path
) -> None:
    flat = texture_of((SHIPPED / "flat.json").read_text(encoding="utf-8"))
    seconds = ("--seconds", SLIDING_S)
    live, recorded, mcap = tmp_path / "live.json", tmp_path / "rec.json", tmp_path / "a.mcap"
    with frictus.connect(endpoint, "test") as client:
        rig = client.rig("rig1", wait_s=5.0)
        rig.set_scene(Scene(regions=[Region(texture=flat, gain=0.8)]))
        with rig.arm(lease_ms=10_000), rig.watch(Topics.ESTIMATE, timeout_s=30.0) as heard:
            with (
                started("record", "--router", endpoint, "--out", mcap, *seconds) as recording,
                started("track", "--router", endpoint, "--out", live, *seconds) as tracking,
            ):
                stdout, stderr = tracking.communicate(timeout=90.0)
                told = heard.drain()
                _, problem = recording.communicate(timeout=60.0)
    assert recording.returncode == 0, problem
    assert tracking.returncode == 0, stderr
    *lines, model = [json.loads(line) for line in stdout.splitlines()]
    assert model == {"event": "model", "file": str(live)}
    states = [EstimateState.model_validate(line) for line in lines]
    assert [state.windows for state in states] == sorted(state.windows for state in states)
    assert {state.utc_ns for state in states} >= {
        state.utc_ns for state in told if isinstance(state, EstimateState)
    }
    assert told
    # What the person is is known after six seconds; the placeholder in force is wrong.
    assert "cutoff" in states[-1].alarms
    again = run("track", mcap, "--out", recorded)
    assert again.exit_code == Exit.OK, again.stderr
    for file in (live, recorded):
        law = law_of(file)
        cutoff = law.cutoff_0_hz + law.slope_hz_per_mm_s * 40.0
        assert law.gain_n == pytest.approx(PERSON.gain_n, rel=0.05)
        assert cutoff == pytest.approx(700.0 + 25.0 * 40.0, rel=0.1)


def test_without_a_texture_it_says_what_was_missing(endpoint: str, tmp_path: Path) -> None:
    told = run("track", "--router", endpoint, "--seconds", 0.5)
    assert told.exit_code == Exit.OK, told.stderr
    refused = run("track", "--router", endpoint, "--seconds", 0.5, "--out", tmp_path / "m.json")
    assert refused.exit_code == Exit.CHECK_FAILED
    assert "Play a texture, and slide over it" in refused.stderr
    assert not (tmp_path / "m.json").exists()


def test_a_mount_that_a_running_tracker_would_not_take_is_refused(
    endpoint: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(frictus.Rig, "estimate", lambda _rig: None)  # somebody tracks it
    refused = run("track", "--router", endpoint, "--mount", "none", "--seconds", 0.5)
    assert refused.exit_code == Exit.USAGE
    assert "leave it out" in refused.stderr


def test_a_client_hears_that_nobody_estimates(endpoint: str) -> None:
    with frictus.connect(endpoint, "test", timeout_s=0.3) as client:
        rig = client.rig("rig1", wait_s=5.0)
        with pytest.raises(LinkError, match="start `frictus track`"):
            rig.estimate()


@pytest.mark.parametrize(("count", "said"), [(3, "3 times while"), (16, "16 times or more")])
def test_of_more_changes_than_are_told_it_does_not_say_how_many(count: int, said: str) -> None:
    one = Interval(value=1.0, low=0.9, high=1.1)
    law = LawNow(gain_n=one, cutoff_20_hz=one, cutoff_100_hz=one, delay_us=one)
    values = LawValues(gain_n=0.4, cutoff_20_hz=600.0, cutoff_100_hz=1_700.0)
    change = ModelChange(
        utc_ns=0, etag_before="a", etag_after="b", before=values, after=values, reason=""
    )
    state = EstimateState(utc_ns=0, run=1, windows=9, law=law, changes=(change,) * count)
    assert any(f"the model was changed {said}" in line for line in summary_of(state, True))


def test_the_gain_of_a_contact_is_not_told_as_the_person_s() -> None:
    """One contact is known within 0.2 %, the person about whom contacts lie within 5 %."""
    gain_n = Interval(value=0.31, low=0.3095, high=0.3105)
    one = Interval(value=1.0, low=0.9, high=1.1)
    law = LawNow(gain_n=gain_n, cutoff_20_hz=one, cutoff_100_hz=one, delay_us=one)
    model = Model(
        base=FirstOrderSpeedLaw(gain_n=0.3, cutoff_0_hz=400.0, slope_hz_per_mm_s=10.0),
        covariance=Covariance(
            parameters=["gain_n"], matrix=[[(0.3 * math.log(1.05) / 1.96) ** 2]]
        ),
    )
    state = EstimateState(utc_ns=0, run=1, windows=9, law=law, model=model, participant="P01")
    first, second, *_ = summary_of(state, False)
    assert first == "gain        0.310 [0.309, 0.310] N in the newest contact"
    assert second == "            0.300 [0.286, 0.315] N in the mean of contacts"
    assert line_of(state).startswith("P01, 9 windows: gain 0.31 N")


def test_a_file_that_is_no_recording_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "a.mcap"
    file.write_bytes(b"nothing of the kind")
    refused = run("track", file)
    assert refused.exit_code == Exit.USAGE
    assert str(file) in refused.stderr
    assert "frictus study import makes a study" in " ".join(refused.stderr.split())


def test_why_a_torn_recording_has_no_status_is_said(tmp_path: Path) -> None:
    file = tmp_path / "a.mcap"
    with RecordingWriter(file, known.info("a"), {}, lambda: 0.0) as writer:
        known.hand_over(writer, 0)
        writer.end("asked for", known.UTC_NS)
    file.write_bytes(file.read_bytes()[:-1_000])
    refused = run("track", file)
    assert refused.exit_code == Exit.USAGE
    assert (
        "no status of its rig, so that its screen is unknown: it ends early" in refused.stderr
    )

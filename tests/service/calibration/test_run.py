"""A whole calibration on a simulated rig that runs faster than time, over the network."""

import json
import re
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.patience import PATIENT
from tests.rig_status import rig_status
from typer.testing import CliRunner, Result

import frictus
from frictus.errors import NoRigError
from frictus.keys import Topics
from frictus.messages import GuidanceState
from frictus.recordings import texture_of
from frictus_hardware import SimulatedConfig
from frictus_hardware.physics.friction import FrictionLaw, cutoff_hz
from frictus_hardware.physics.linear import Mount
from frictus_hardware.physics.screen import Screen
from frictus_hardware.physics.stages import standard_twin
from frictus_hardware.simulated.config import SimulatedParticipant
from frictus_hardware.simulated.guided import GuidedStrokes
from frictus_hardware.simulated.motion import Press
from frictus_hardware.simulated.strokes import SteadyStrokes
from frictus_service.calibration import rehearsal
from frictus_service.calibration.folder import CalibrationFolder
from frictus_service.calibration.job import (
    CalibrationResult,
    CalibrationSpec,
    PaperProtocol,
    Progress,
    QuickProtocol,
)
from frictus_service.calibration.plan import HOPELESS
from frictus_service.calibration.rehearsal import rehearse
from frictus_service.calibration.run import CalibrationRun, run_calibration
from frictus_service.calibration.session import REST_N
from frictus_service.cli.app import app
from frictus_service.config import ApiConfig, Config, RouterConfig
from frictus_service.daemon.processes.supervisor import Supervisor
from frictus_service.errors import (
    CalibrationError,
    CancelledError,
    EstimateError,
    FolderError,
)
from frictus_service.fidelity.measure import (
    compare,
    feel,
    full_gain,
    steady_segments,
    target_along,
)
from frictus_service.fidelity.path import walk
from frictus_service.identification.observation.validity import REVERSAL_S
from frictus_service.library import SHIPPED
from frictus_service.processes import free_endpoint
from frictus_service.study.reader import StudyReader
from frictus_service.synthesis.compensability import law_of, placeholder_model

FASTER = 4.0
STRANGER = SimulatedParticipant(cutoff_0_hz=0.6 * 385.68, slope_hz_per_mm_s=0.6 * 13.811)
"""40 % off the population."""
BRIEF = QuickProtocol(
    speeds_mm_s=(30.0, 90.0),
    forces_n=(0.4,),
    approach_s=1.5,  # of three trials the sensors need 4 s without their ends
    record_s=2.0,
    precision=0.05,
    max_recorded_s=30.0,
)


@pytest.fixture(scope="module")
def endpoint() -> Iterator[str]:
    config = Config(
        backend=SimulatedConfig(
            finger=GuidedStrokes(),
            participant=STRANGER,
            clock=FASTER,
            lead_ms=240.0,  # 60 ms for the machine
        ),
        block_ms=40.0,
        router=RouterConfig(endpoint=free_endpoint()),
        api=ApiConfig(port=0),
        limits=PATIENT,
    )
    with Supervisor(config, ("rig",), say=lambda _line: None) as supervisor:
        supervisor.wait_ready(100.0)
        yield config.router.endpoint


@pytest.fixture
def client(endpoint: str) -> Iterator[frictus.Client]:
    with frictus.connect(endpoint, name="calibration") as client:
        yield client
        until(client.rig("rig1"), lambda status: status.state == "disarmed")


def until(rig: frictus.Rig, holds: Callable[[frictus.RigStatus], bool]) -> None:
    """Wait until the rig's status says something."""
    given_up_s = time.monotonic() + 30.0
    with rig.watch(Topics.STATUS, timeout_s=10.0) as states:
        for state in states:
            if isinstance(state, frictus.RigStatus):
                if holds(state):
                    return
                assert time.monotonic() < given_up_s, f"the rig stayed {state}"


def spec_of(
    rng: np.random.Generator, protocol: PaperProtocol | QuickProtocol = BRIEF
) -> CalibrationSpec:
    seed = int(rng.integers(2**31))
    return CalibrationSpec(rig="rig1", participant="P01", protocol=protocol, seed=seed)


def rendering_error_db(law: FrictionLaw) -> float:
    """Return the rendering error of the flat texture with true finger state, dB rms."""
    flat = texture_of((SHIPPED / "flat.json").read_text(encoding="utf-8"))
    screen = Screen()
    scene = full_gain(flat, law, screen, 20_000.0)
    twin = standard_twin(screen=screen, law=STRANGER.law, sensors=())
    errors = []
    for speed in (40.0, 80.0):
        finger = SteadyStrokes(speed_mm_s=speed, press=Press(wander_n=0.0))
        path = walk(SimulatedConfig(finger=finger), 3.0, known=True)
        signals, clipped = feel(path, scene, law, screen, twin)
        segments = steady_segments(path, speed)
        target = target_along(flat, scene, path)
        errors.append(compare(signals, clipped, target, Mount().lateral, segments).bands_db)
    return float(np.sqrt(np.nanmean(np.square(errors))))


def test_a_quick_calibration_makes_rendering_right(
    client: frictus.Client, rng: np.random.Generator, tmp_path: Path
) -> None:
    told: list[Progress] = []
    rig = client.rig("rig1")
    with rig.guidance(timeout_s=60.0) as feed:
        shown: list[GuidanceState] = []
        watching = threading.Thread(target=lambda: shown.extend(_until_done(feed)))
        watching.start()
        result = run_calibration(
            spec_of(rng), tmp_path, client, "lab", told.append, cancelled=lambda: False
        )
        watching.join()
    assert result.reached
    assert result.precision <= BRIEF.precision
    sensors = result.details["sensors"]
    assert sensors is not None, result.notes
    assert sensors["explained"] > 0.9
    assert abs(sensors["touch_late_s"]) < 3.0 * sensors["touch_late_sd_s"] + 5e-4
    assert not [note for note in result.notes if "accel" in note or "touch" in note]
    _expect_model(result)
    _expect_diagnostics(result)
    _expect_guidance(shown, told)
    assert [(p.phase, p.message) for p in told[-2:]] == 2 * [("done", "estimating the model")]
    assert {p.phase for p in told} == {"approach", "record", "analyse", "done"}
    assert told[-1].recorded_s == result.recorded_s == 2.0 * told[-1].trials_done
    # What the rig then inverts is what was measured.
    before_db = rendering_error_db(law_of(placeholder_model()))
    etag = rig.set_model(result.model)
    until(rig, lambda status: status.model_etag == etag)
    after_db = rendering_error_db(law_of(rig.model().model))
    assert after_db <= 0.15
    assert after_db <= before_db / 4.0


def test_a_rig_that_somebody_holds_is_refused_before_anything_is_prepared(
    client: frictus.Client, endpoint: str, rng: np.random.Generator, tmp_path: Path
) -> None:
    told: list[Progress] = []
    with frictus.connect(endpoint, name="ann") as other, other.rig("rig1").arm():
        until(client.rig("rig1"), lambda status: status.owner == "ann")
        with pytest.raises(CalibrationError, match="'ann' holds rig rig1"):
            run_calibration(spec_of(rng), tmp_path, client, "lab", told.append, lambda: False)
        assert other.rig("rig1").status().state == "armed"
    assert not told


def test_a_force_at_which_the_rig_would_trip_is_refused_before_anything_is_prepared(
    client: frictus.Client, rng: np.random.Generator, tmp_path: Path
) -> None:
    told: list[Progress] = []
    spec = spec_of(rng, BRIEF.model_copy(update={"forces_n": (0.4, 9.5)}))
    with pytest.raises(CalibrationError, match=r"trips above 10 N.*ask for at most 9\.09 N"):
        run_calibration(spec, tmp_path, client, "lab", told.append, lambda: False)
    assert not told
    assert not list(tmp_path.iterdir())


def test_a_rig_of_the_same_name_at_another_site_is_left_alone(
    client: frictus.Client, rng: np.random.Generator, tmp_path: Path
) -> None:
    told: list[Progress] = []
    with pytest.raises(NoRigError, match="no rig 'rig1' at site 'hall'"):
        run_calibration(spec_of(rng), tmp_path, client, "hall", told.append, lambda: False)
    assert not told
    assert not list(tmp_path.iterdir())


def _until_done(feed: frictus.Feed[GuidanceState]) -> list[GuidanceState]:
    shown = []
    for state in feed:
        shown.append(state)
        if state.phase == "done":
            break
    return shown


def _expect_model(result: CalibrationResult) -> None:
    model = result.model
    law, true = law_of(model), STRANGER.law
    for speed in (30.0, 90.0):
        off = float(cutoff_hz(law, speed)) / float(cutoff_hz(true, speed)) - 1.0
        assert abs(off) < 0.05
    assert law.gain_n == pytest.approx(true.gain_n, rel=0.05)
    assert model.participant == "P01"
    assert not model.placeholder
    assert model.provenance["simulated"] is True
    assert model.covariance is not None
    assert model.validity.speed_mm_s == (30.0, 90.0)
    assert model.validity.drive_vpp == pytest.approx((150.0, 150.0), rel=0.05)
    with StudyReader(result.study) as study:
        assert model.provenance["study_sha256"] == study.sha256
        assert len(study.trials) == result.details["trials"]
        assert study.info.rig == "rig1"
        trial = study.read(study.trials[-1].id)
        assert trial.voltage_source == "monitor"
        assert not np.isnan(trial.force_n).any()


def _expect_diagnostics(result: CalibrationResult) -> None:
    found = result.details["diagnostics"]
    speeds = {point["speed_mm_s"] for point in found["points"]}
    assert speeds == {30.0, 90.0}
    for point in found["points"]:
        true = STRANGER.law.gain_n * float(
            1.0 / np.hypot(1.0, point["tone_hz"] / cutoff_hz(STRANGER.law, point["speed_mm_s"]))
        )
        assert point["magnitude_n"] == pytest.approx(true, rel=0.1)
        assert point["fit_n"] == pytest.approx(true, rel=0.1)
    assert found["residual_db"] < 0.5
    assert (found["held_out"] is None) == bool(found["note"])


def _expect_guidance(shown: list[GuidanceState], told: list[Progress]) -> None:
    phases = [state.phase for state in shown]
    assert phases[-1] == "done"
    assert {"approach", "record", "analyse"} <= set(phases)
    recording = [state for state in shown if state.phase == "record" and state.x_mm is not None]
    accepted = {p.trials_done for p in told if p.message.endswith("accepted")}
    speeds = {state.target_speed_mm_s for state in recording}
    assert speeds == {30.0, 90.0}
    for speed in speeds:
        # A late machine tells the finger late what to do, and such a trial is rejected.
        actual = [
            s.speed_mm_s
            for s in recording
            if s.target_speed_mm_s == speed and s.trial in accepted and not _turns(s)
        ]
        assert np.median(np.array(actual, dtype=float)) == pytest.approx(speed, rel=0.15)
    colours = [state.colour for state in recording]
    assert colours.count("green") > 0.5 * len(colours)


def _turns(state: GuidanceState) -> bool:
    """Whether the finger is so close to the end of a stroke that its speed is not judged."""
    assert state.x_mm is not None
    low, high = state.span_mm
    way = REVERSAL_S * state.target_speed_mm_s
    return not low + way < state.x_mm < high - way


def test_a_calibration_that_was_cancelled_goes_on(
    client: frictus.Client, rng: np.random.Generator, tmp_path: Path
) -> None:
    protocol = BRIEF.model_copy(update={"precision": 1e-6, "max_recorded_s": 6.0})
    spec, told = spec_of(rng, protocol), list[Progress]()

    def after_one() -> bool:
        return told[-1].trials_done == 1 and told[-1].phase == "record"

    with pytest.raises(CancelledError, match="kept"):
        run_calibration(spec, tmp_path, client, "lab", told.append, after_one)
    until(client.rig("rig1"), lambda status: status.state == "disarmed")
    (first,) = (tmp_path / "trials").glob("*.h5")
    written = first.read_bytes()
    told.clear()
    result = run_calibration(spec, tmp_path, client, "lab", told.append, lambda: False)
    assert told[0].trials_done == 1
    assert first.read_bytes() == written
    assert not result.reached
    assert result.recorded_s == 6.0
    with StudyReader(result.study) as study:
        assert [info.order for info in study.trials] == [0, 1, 2]
    # Once more: nothing is left to measure, the same comes of it.
    again = run_calibration(spec, tmp_path, client, "lab", told.append, lambda: False)
    assert again.model.base == result.model.base
    other = spec.model_copy(update={"seed": spec.seed + 1})
    with pytest.raises(FolderError, match="seed"):
        run_calibration(other, tmp_path, client, "lab", told.append, lambda: False)


def test_a_trial_that_ends_early_asks_for_nothing_more(
    client: frictus.Client, rng: np.random.Generator, tmp_path: Path
) -> None:
    told: list[Progress] = []

    def at_once() -> bool:
        return told[-1].phase == "approach"

    with client.rig("rig1").guidance(timeout_s=10.0) as feed:
        with pytest.raises(CancelledError):
            run_calibration(spec_of(rng), tmp_path, client, "lab", told.append, at_once)
        last = next(state for state in feed if state.phase not in ("approach", "record"))
    assert (last.phase, last.target_force_n, last.seconds_left) == ("break", REST_N, 0.0)


def test_losing_the_rig_keeps_what_is_finished(
    client: frictus.Client, endpoint: str, rng: np.random.Generator, tmp_path: Path
) -> None:
    told: list[Progress] = []
    stopped = threading.Event()
    with frictus.connect(endpoint, name="somebody") as other:
        rig = other.rig("rig1")

        def tell(progress: Progress) -> None:
            told.append(progress)
            if (progress.phase, progress.trials_done) == ("record", 1) and not stopped.is_set():
                stopped.set()
                rig.stop()

        with pytest.raises(
            CalibrationError, match=r"took the lease away: .*stopped by|was stopped by"
        ):
            run_calibration(spec_of(rng), tmp_path, client, "lab", tell, lambda: False)
    assert len(list((tmp_path / "trials").glob("*.h5"))) == 1


@pytest.mark.parametrize("phase", ["analyse", "break"])
def test_a_stop_between_two_trials_ends_it_too(
    phase: str,
    client: frictus.Client,
    endpoint: str,
    rng: np.random.Generator,
    tmp_path: Path,
) -> None:
    """The screen is off then, and whoever stops means that it stays so."""
    protocol = PaperProtocol(
        tones_hz=(70.0, 250.0),
        speeds_mm_s=(30.0, 85.0),
        forces_n=(0.4,),
        approach_s=0.7,
        record_s=1.5,
        trials_per_block=1,
        break_s=20.0 if phase == "break" else 0.0,
    )
    told: list[Progress] = []
    before = client.rig("rig1").status().last_calls.get("stop")
    with frictus.connect(endpoint, name="somebody") as other:
        rig = other.rig("rig1")

        def tell(progress: Progress) -> None:
            told.append(progress)
            stops = [each for each in told if (each.phase, each.trials_done) == (phase, 1)]
            if len(stops) == 1 and progress is stops[0]:
                rig.stop()
                until(
                    client.rig("rig1"), lambda status: status.last_calls.get("stop") != before
                )

        with pytest.raises(CalibrationError, match="was stopped by 'somebody'"):
            run_calibration(
                spec_of(rng, protocol), tmp_path, client, "lab", tell, lambda: False
            )
        until(rig, lambda status: status.state == "disarmed")
    assert {each.trials_done for each in told} == {0, 1}
    assert len(list((tmp_path / "trials").glob("*.h5"))) == 1


def test_the_papers_protocol_rests_with_the_drive_off(
    client: frictus.Client, rng: np.random.Generator, tmp_path: Path
) -> None:
    protocol = PaperProtocol(
        tones_hz=(70.0, 250.0, 600.0, 1_500.0),
        speeds_mm_s=(30.0, 85.0),
        forces_n=(0.4,),
        approach_s=0.7,
        record_s=1.5,
        trials_per_block=4,
        break_s=1.0,
    )
    rig = client.rig("rig1")
    states, told = list[str](), list[Progress]()

    def tell(progress: Progress) -> None:
        told.append(progress)
        if progress.phase == "break":
            states.append(rig.status().state)

    result = run_calibration(
        spec_of(rng, protocol), tmp_path, client, "lab", tell, lambda: False
    )
    assert set(states) <= {"stopping", "disarmed"}
    phases = [p.phase for p in told]
    assert sum(a != "break" == b for a, b in pairwise(phases)) >= 1
    done = told[-1]
    assert done.trials_done - done.trials_rejected == 8
    assert result.reached
    law = law_of(result.model)
    for speed in (30.0, 85.0):
        off = float(cutoff_hz(law, speed)) / float(cutoff_hz(STRANGER.law, speed)) - 1.0
        assert abs(off) < 0.03
    assert law.gain_n == pytest.approx(STRANGER.gain_n, rel=0.02)
    with StudyReader(result.study) as study:
        assert {len(info.tones_hz) for info in study.trials} == {1}


def test_a_trial_that_no_reader_accepts_is_not_estimated_from(
    tmp_path: Path, rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    spec = spec_of(rng)
    kept = CalibrationFolder.open(tmp_path, spec)
    calibration = CalibrationRun(spec, kept, rig_status(), Mount().lateral, lambda _told: None)
    monkeypatch.setattr(rehearsal, "observe", lambda trial, _study: trial)
    ask = calibration._next()
    assert ask is not None
    asked = calibration._asked(ask)
    ideal: Any = rehearse(
        replace(asked, started_utc="2026-01-31T12:00:00Z"), calibration._study
    )
    noisy = ideal.force_n + rng.normal(0.0, 2e-3, ideal.force_n.shape)
    for scale, accepted in ((1.0, True), (1.3, False)):  # of a monitor that is not calibrated
        info = replace(ideal.info, id=kept.next_id, order=len(kept.done))
        trial = replace(ideal, info=info, voltage_v=scale * ideal.voltage_v, force_n=noisy)
        calibration._keep(trial)
        assert calibration._observations()[-1].valid == accepted
        assert ("voltage_v: peaks at 97" in kept.done[-1].rejected) != accepted


def test_a_trial_that_cannot_be_followed_is_rejected_and_left_out(
    client: frictus.Client, endpoint: str, rng: np.random.Generator, tmp_path: Path
) -> None:
    """No virtual finger strokes at 250 mm/s: it rests, and the trials are refused."""
    protocol = BRIEF.model_copy(
        update={
            "speeds_mm_s": (60.0, 250.0),
            "approach_s": 4.0,  # a busy machine starts its finger late
            "precision": 1e-6,
            "max_repeats": 0,
            "max_recorded_s": 8.0,
        }
    )
    told: list[Progress] = []
    drawn: list[tuple[str, float, str]] = []
    screen = threading.Thread(target=_documented_screen, args=(endpoint, drawn))
    screen.start()
    result = run_calibration(
        spec_of(rng, protocol), tmp_path, client, "lab", told.append, lambda: False
    )
    screen.join()
    assert told[-1].trials_rejected >= 1  # a busy machine may reject another
    assert any("250 mm/s" in note for note in result.notes)
    assert any("was rejected" in note for note in result.notes)
    assert any("is not in the study: position_mm" in note for note in result.notes)
    assert result.model.validity.speed_mm_s == (60.0, 60.0)
    assert result.details["trials"] == 4
    # The screen that the documentation shows has seen all of it.
    assert {what for what, _, _ in drawn} >= {"reference", "finger", "done"}
    assert "green" in {colour for _, _, colour in drawn}


def test_a_finger_that_fails_every_trial_is_let_go(
    client: frictus.Client, rng: np.random.Generator, tmp_path: Path
) -> None:
    protocol = BRIEF.model_copy(
        update={"speeds_mm_s": (240.0, 250.0), "approach_s": 0.5, "record_s": 0.5}
    )
    told: list[Progress] = []
    with pytest.raises(
        EstimateError, match=rf"none of {HOPELESS} trials is valid \(the last: "
    ):
        run_calibration(
            spec_of(rng, protocol), tmp_path, client, "lab", told.append, lambda: False
        )
    assert any("all rejected: no more are asked for" in each.message for each in told)
    assert told[-1].trials_rejected == told[-1].trials_done == HOPELESS


def _documented_screen(endpoint: str, drawn: list[tuple[str, float, str]]) -> None:
    """Run the example of `docs/calibration.md`."""
    text = (Path(__file__).parents[3] / "docs" / "calibration.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"```python\n(import frictus\n.*?)```", text, re.DOTALL)

    def draw(what: str, where: float, colour: str) -> None:
        drawn.append((what, where, colour))

    exec(code, {"ROUTER": endpoint, "draw": draw})


def test_the_command_calibrates_publishes_and_goes_on(endpoint: str, tmp_path: Path) -> None:
    config = tmp_path / "frictus.toml"
    config.write_text(f'studies = "studies"\n[router]\nendpoint = "{endpoint}"\n', "utf-8")

    def run(*more: str, participant: str = "P07") -> Result:
        options = ["calibrate", "--participant", participant, "-c", str(config)]
        return CliRunner().invoke(app, [*options, "--precision", "0.5", *more])

    done = run("--publish", "--seed", "11")
    assert done.exit_code == 0, done.stderr
    told = [json.loads(line) for line in done.stdout.splitlines()]
    assert {line["event"] for line in told} == {"progress", "result"}
    result = told[-1]
    assert result["published"] == "rig1/P07@1"
    folder = tmp_path / "studies" / "rig1-P07-quick"
    model = frictus.Model.model_validate_json((folder / "model.json").read_bytes())
    assert model.participant == "P07"
    assert model.provenance["seed"] == 11
    # Nothing is left to do: the same model comes of what is there, whatever seed is drawn.
    again = run()
    assert again.exit_code == 0, again.stderr
    assert json.loads(again.stdout.splitlines()[-1])["model"]["base"] == result["model"]["base"]
    other = run("--seed", "12")
    assert (other.exit_code, "another seed" in other.stderr) == (2, True)
    assert run(participant="not a name").exit_code == 2
    assert run("--protocol", "paper").exit_code == 2

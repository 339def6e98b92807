"""`frictus experiment` on a simulated rig: an observer feels its friction, a person types."""

import csv
import json
import math
import os
import sys
import threading
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from statistics import median
from typing import Any, cast

import pytest
from tests.campaigns.service import config_in
from tests.patience import PATIENT
from typer.testing import CliRunner

import frictus
from frictus.experiment import (
    Experiment,
    SimulatedObserver,
    load_protocol,
    parse_protocol,
    read_log,
)
from frictus.keys import STREAMS
from frictus_hardware import SimulatedConfig
from frictus_hardware.simulated.strokes import SteadyStrokes
from frictus_service.cli.app import app
from frictus_service.cli.experiment import Keyboard
from frictus_service.daemon.processes.supervisor import Supervisor
from frictus_service.recording.reader import RecordingReader
from frictus_service.recording.samples import Samples

QUICK = """
[presentation]
interval_s = 0.3
gap_s = 0.03
fade_s = 0.05
"""
DIFFERENCE = f"""
name = "difference"
task = {{ kind = "2afc", feedback = true }}
[procedure]
kind = "staircase"
start = 5.0
low = 0.2
high = 6.0
steps_db = [6.0, 4.0, 2.0]
reversals = 30
trials = 30
[conditions.ridges]
kind = "difference"
texture = {{ kind = "spectrum", components = [{{ amplitude_n = 0.06, cycles_per_mm = 0.8 }}] }}
{QUICK}
"""
LOUD = f"""
name = "loud"
task = {{ kind = "yes-no" }}
procedure = {{ kind = "constant", levels = [0.05, 0.6], repeats = 2 }}
[conditions.ridges]
kind = "amplitude"
texture = {{ kind = "spectrum", components = [{{ amplitude_n = 1.0, cycles_per_mm = 0.8 }}] }}
[design]
catch_every = 2
{QUICK}
"""
MATCH = f"""
name = "match"
task = {{ kind = "adjustment", low = 0.01, high = 0.9, step_db = 3.0, steps = 30 }}
procedure = {{ kind = "constant", levels = [0.03], repeats = 2 }}
[conditions.ridges]
kind = "amplitude"
texture = {{ kind = "spectrum", components = [{{ amplitude_n = 1.0, cycles_per_mm = 0.8 }}] }}
standard = {{ kind = "spectrum", components = [{{ amplitude_n = 0.06, cycles_per_mm = 0.8 }}] }}
{QUICK}
"""


@pytest.fixture(scope="module")
def router(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Endpoint of a router with one simulated rig whose finger strokes."""
    folder = tmp_path_factory.mktemp("rig")
    config = config_in(folder, SimulatedConfig(finger=SteadyStrokes())).model_copy(
        update={"limits": PATIENT}
    )
    with Supervisor(config, parts=("rig", "recorder")) as supervisor:
        supervisor.wait_ready(100.0)
        yield config.router.endpoint


def run(protocol: str, folder: Path, router: str, *more: str, typed: str = "") -> Any:
    file = folder / "protocol.toml"
    file.write_text(protocol)
    arguments = [file, "--router", router, "--log", folder / "log.jsonl", "--seed", "1", *more]
    return CliRunner().invoke(app, ["experiment", *map(str, arguments)], input=typed)


@pytest.mark.long
def test_an_observer_has_its_difference_threshold_back(router: str, tmp_path: Path) -> None:
    done = run(DIFFERENCE, tmp_path, router, "--observer", "--events", str(tmp_path / "bids"))
    assert done.exit_code == 0, done.output
    assert "log.jsonl; Ctrl-C ends it, and the same command goes on" in done.stderr
    assert [done.stderr.count(f"trial {n}: ") for n in range(1, 32)] == [1] * 30 + [0]
    result = json.loads(done.stdout.splitlines()[-1])
    threshold = result["fit"]["threshold"]
    assert threshold["low"] < SimulatedObserver().jnd_db < threshold["high"]
    rows, _ = read_log(tmp_path / "log.jsonl")
    trials = [row for row in rows if "trial" in row]
    assert len(trials) == 30
    for row in trials:
        assert row["level_rendered"] == row["level"]
        first, second = row["intervals"]
        assert first["last_sample"] <= second["first_sample"]
        for each in (first, second):
            assert each["finger"]["path_mm"] > 1.0
            played = each["last_sample"] - each["first_sample"]
            assert abs(each["force"]["samples"] - played) <= 100  # a block
    # On a busy machine one interval may last longer or less; the row says so, and few do.
    lasted_s = [each["duration_s"] for row in trials for each in row["intervals"]]
    assert median(lasted_s) == pytest.approx(0.3, abs=0.1)
    with (tmp_path / "bids" / "sub-observer_task-difference_events.tsv").open() as file:
        events = list(csv.DictReader(file, delimiter="\t"))
    assert [float(row["level"]) for row in events] == [row["level"] for row in trials]
    assert [int(row["sample"]) for row in events] == [
        row["intervals"][0]["first_sample"] for row in trials
    ]
    onsets = [float(row["onset"]) for row in events]
    assert onsets == sorted(onsets)
    again = run(DIFFERENCE, tmp_path, router, "--results")
    assert json.loads(again.stdout)["fit"] == result["fit"]
    other = run(DIFFERENCE.replace("6.0, 4.0, 2.0", "6.0"), tmp_path, router, "--results")
    assert other.exit_code == 2
    assert "procedure differ" in other.stderr


@pytest.mark.parametrize(
    "more", [("--observer", "--participant", "P3"), ("--participant", "observer2")]
)
def test_a_person_and_a_simulated_observer_never_share_a_log(
    more: tuple[str, ...], tmp_path: Path
) -> None:
    done = run(DIFFERENCE, tmp_path, "tcp/127.0.0.1:9", *more)
    assert done.exit_code == 2
    assert "simulated observer" in done.stderr
    assert not (tmp_path / "log.jsonl").exists()


def test_the_rendered_interval_is_where_the_samples_say(router: str, tmp_path: Path) -> None:
    """Friction begins and ends at the samples of the row, within lead and fade."""
    with frictus.connect(router) as client:
        rig = client.rig("rig1")
        protocol = load_protocol("amplitude-difference")
        quick = protocol.presentation.model_copy(update={"interval_s": 0.4, "fade_s": 0.0})
        document = protocol.model_copy(update={"presentation": quick})
        with (
            rig.blocks("render", capacity=4_000) as feed,
            Experiment.of(rig, document, log=tmp_path / "log.jsonl", seed=1) as made,
        ):
            trial = made.next()
            assert trial is not None
            shown = made.present(trial)
            assert shown is not None
            blocks = [item for item in feed.drain() if isinstance(item, frictus.Block)]
    slack = 0.05 * blocks[0].sample_rate_hz
    active = [block.first_sample for block in blocks if abs(block.data[3]).max() > 0.01]
    assert min(active) == pytest.approx(shown[0].first_sample, abs=slack)
    assert max(active) == pytest.approx(shown[-1].last_sample, abs=slack)


def test_a_recording_holds_the_samples_of_its_trials(router: str, tmp_path: Path) -> None:
    short = "record = true\n" + DIFFERENCE.replace("trials = 30", "trials = 2")
    with frictus.connect(router) as client:  # as a start leaves it that was killed
        client.rig("rig1").record("difference-observer-20260101T000000Z")
    done = run(short, tmp_path, router, "--observer")
    assert done.exit_code == 0, done.output
    with frictus.connect(router) as client:
        state = client.rig("rig1").recording()
    trials = [row for row in read_log(tmp_path / "log.jsonl")[0] if "trial" in row]
    assert not state.recording
    assert {row["recording"] for row in trials} == {state.name}
    with RecordingReader(Path(str(state.path))) as reader:
        forces = [
            item
            for item in reader.items()
            if isinstance(item, Samples) and STREAMS[item.stream].suffix == "stream/force"
        ]
    last = forces[-1]
    begin, end = forces[0].first_sample, last.first_sample + last.data.shape[1]
    for each in (interval for row in trials for interval in row["intervals"]):
        assert {item.run for item in forces} == {each["run"]}
        # An observer that answers at once is done before the last fade has played.
        assert begin <= each["first_sample"] < each["last_sample"] <= end + 1_000


def test_what_the_rig_would_scale_is_not_presented(router: str, tmp_path: Path) -> None:
    done = run(LOUD, tmp_path, router, "--observer")
    assert done.exit_code == 0, done.output
    trials = [row for row in read_log(tmp_path / "log.jsonl")[0] if "trial" in row]
    refused = [row for row in trials if row["status"] == "refused"]
    assert [row["level"] for row in refused] == [0.6]
    assert 0.0 < refused[0]["gain"] < 1.0
    answered = [row for row in trials if row["status"] == "answered"]
    assert {row["level"] for row in answered if not row["catch"]} == {0.05}
    assert json.loads(done.stdout)["refused"] == 1


def test_a_scaled_trial_counts_by_its_rendered_level(router: str, tmp_path: Path) -> None:
    flagged = LOUD.replace("fade_s", 'on_scaled = "flag"\nfade_s')
    done = run(flagged, tmp_path, router, "--observer")
    assert done.exit_code == 0, done.output
    trials = [row for row in read_log(tmp_path / "log.jsonl")[0] if "trial" in row]
    loud = [row for row in trials if row["level"] == 0.6 and not row["catch"]]
    assert len(loud) == 2
    for row in loud:
        assert "scaled" in row["flags"]
        gain = row["intervals"][0]["applied"]["gain"]
        assert row["level_rendered"] == pytest.approx(0.6 * gain)
        assert gain < 0.8


def test_a_level_is_set_by_adjustment(router: str, tmp_path: Path) -> None:
    done = run(MATCH, tmp_path, router, "--observer")
    assert done.exit_code == 0, done.output
    setting = json.loads(done.stdout)["setting"]
    assert abs(20.0 * math.log10(setting["value"] / 0.06)) < 4.0
    for row in read_log(tmp_path / "log.jsonl")[0][2:]:
        assert row["settings"][-1] == row["level_rendered"]


def test_a_person_types(router: str, tmp_path: Path) -> None:
    short = DIFFERENCE.replace("trials = 30", "trials = 3")
    begun = run(short, tmp_path, router, typed="1\nperhaps\n2\n")
    assert begun.exit_code == 130  # the input ended: as Ctrl-C
    assert "'perhaps': 1, 2 accepted" in begun.stderr
    assert begun.stderr.count("interval 2 ...") == 3
    assert "right" in begun.stderr or "wrong" in begun.stderr
    done = run(short, tmp_path, router, typed="1\n")
    assert done.exit_code == 0, done.output
    assert json.loads(done.stdout)["trials"] == 3
    assert "the log holds 2 trials of '01' and goes on after them" in done.stderr
    again = run(short, tmp_path, router).stderr
    assert "the log holds 3 trials of '01' and is complete: nothing is presented" in again


def test_the_log_of_another_participant_is_not_analysed_as_that_of_the_one_named(
    tmp_path: Path,
) -> None:
    protocol = parse_protocol(DIFFERENCE.encode(), "")
    header = {
        "format": "frictus-experiment/1",
        "participant": "P07",
        "seed": 1,
        "order_row": 0,
        "protocol": protocol.model_dump(mode="json"),
    }
    (tmp_path / "log.jsonl").write_text(json.dumps(header) + "\n")
    other = run(DIFFERENCE, tmp_path, "", "--results", "--participant", "P08")
    assert other.exit_code == 2
    told = "".join(other.stderr.replace("│", "").split())  # a long path is broken anywhere
    assert "log.jsonlisofparticipant'P07',not'P08'" in told
    for named in ([], ["--participant", "P07"]):
        assert run(DIFFERENCE, tmp_path, "", "--results", *named).exit_code == 0


def test_what_cannot_be_run_is_a_usage_error(tmp_path: Path) -> None:
    nowhere = run("name = 3", tmp_path, "tcp/127.0.0.1:1")
    assert nowhere.exit_code == 2
    assert "protocol.toml" in nowhere.stderr
    missing = CliRunner().invoke(app, ["experiment", "no-such-protocol"])
    assert missing.exit_code == 2
    assert "similarity" in missing.stderr


def test_what_is_typed_before_a_question_is_no_answer_to_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    pty = pytest.importorskip("pty", reason="Windows has no pseudo-terminals")
    terminal, keyboard = pty.openpty()
    with os.fdopen(keyboard, encoding="utf-8") as typed, closing(os.fdopen(terminal, "wb", 0)):
        monkeypatch.setattr(sys, "stdin", typed)
        os.write(terminal, b"1\n1\n")  # a key that was pressed twice, and a trial before
        later = threading.Timer(0.5, os.write, (terminal, b"2\n"))
        later.start()
        assert Keyboard(load_protocol("detection")).ask(cast(Any, None), []) == "2"
        later.join()

"""An experiment on a rig: killed at any trial it goes on; only answered trials are logged."""

import contextlib
import dataclasses
import json
import random
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from frictus import ArgumentError, Client, Component, LeaseLostError, Spectrum, Topics
from frictus.experiment import (
    Adjustment,
    Amplitude,
    ConstantPlan,
    Experiment,
    LevelRange,
    Presentation,
    QuestPlusPlan,
    ScheduledTrial,
    SimulatedObserver,
    TwoAlternatives,
    VirtualParticipant,
    read_log,
    results,
    sensed,
)
from frictus.experiment.events import event_rows
from frictus.experiment.procedures.schedule import Schedule
from frictus.rig import Rig

TRIALS = 10
QUICK = Presentation(interval_s=0.05, gap_s=0.0, fade_s=0.0)
RIDGES = Amplitude(texture=Spectrum(components=[Component(amplitude_n=1.0, cycles_per_mm=0.5)]))
PLAN = QuestPlusPlan(levels=LevelRange(low=0.01, high=0.2, count=9), trials=TRIALS)
PROGRAM = """
import sys
from pathlib import Path
sys.path.insert(0, sys.argv[3])
import frictus
from test_experiment import Right, experiment
with frictus.connect(sys.argv[1], "subject") as client:
    with experiment(client, Path(sys.argv[2])) as made:
        made.run(Right())
"""


class Right:
    """Is right in two trials of three."""

    def rest(self, trial: ScheduledTrial) -> None:
        raise AssertionError

    def begin(self, trial: ScheduledTrial, interval: int) -> None:
        pass

    def ask(self, trial: ScheduledTrial, intervals: list[Any]) -> str:
        right = str(trial.correct)
        return right if trial.number % 3 else {"1": "2", "2": "1"}[right]

    def learn(self, trial: ScheduledTrial, right: bool) -> None:
        raise AssertionError


def experiment(client: Client, log: Path, **options: Any) -> Experiment:
    fields: dict[str, Any] = {"presentation": QUICK, "seed": 5}
    rig = client.rig("sim", "lab")
    return Experiment(rig, TwoAlternatives(), PLAN, RIDGES, log=log, **(fields | options))


def held_by(fake: Any, owner: str) -> None:
    fake.say_everything_once()
    fake.say(Topics.STATUS, fake.status(state="armed", owner=owner))


def trials_of(log: Path) -> list[dict[str, Any]]:
    rows, _ = read_log(log)
    return [row for row in rows if "trial" in row]


def expected() -> list[tuple[int, float, list[str]]]:
    """What an experiment that is never interrupted presents."""
    made = Experiment(
        None,  # type: ignore[arg-type]
        TwoAlternatives(),
        PLAN,
        RIDGES,
        log="none",
        presentation=QUICK,
    )
    schedule = Schedule(made.protocol, 5)
    seen: list[tuple[int, float, list[str]]] = []
    while (trial := schedule.next()) is not None:
        seen.append((trial.number, trial.level, list(trial.order)))
        schedule.record(trial, trial.level, Right().ask(trial, []) == trial.correct)
    return seen


def test_killed_at_any_trial_it_goes_on_with_the_same(
    fake: Any, router: str, tmp_path: Path, seed: int
) -> None:
    held_by(fake, "subject")
    log, draw = tmp_path / "log.jsonl", random.Random(seed)
    arguments = [router, str(log), str(Path(__file__).parent)]
    with fake.stroking():
        kills = killed_and_gone_on(arguments, log, draw)
    assert kills == 3
    rows = trials_of(log)
    presented = [(row["trial"], row["level"], row["order"]) for row in rows]
    assert presented == expected()
    assert all(row["status"] == "answered" for row in rows)
    assert sum(row.get("event") == "start" for row in read_log(log)[0]) >= 2


def killed_and_gone_on(arguments: list[str], log: Path, draw: random.Random) -> int:
    """How often an experiment was killed before it came to its end."""
    kills = 0
    for at_least in (0, 3, 6, TRIALS):
        process = subprocess.Popen([sys.executable, "-c", PROGRAM, *arguments])
        try:
            deadline = time.monotonic() + 60.0
            while process.poll() is None:
                assert time.monotonic() < deadline
                done = len(trials_of(log)) if log.exists() and log.stat().st_size else 0
                if at_least < TRIALS and done >= at_least + (at_least > 0):
                    time.sleep(draw.uniform(0.0, 0.15))  # anywhere within a trial
                    break
                time.sleep(0.005)
        finally:
            process.kill()
            kills += process.wait() != 0
    return kills


@pytest.mark.parametrize("lost", ["contact", "motion"])
def test_what_was_not_felt_counts_for_nothing_and_comes_again(
    lost: str, fake: Any, client: Client, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    held_by(fake, "tester")
    log = tmp_path / "log.jsonl"
    with experiment(client, log) as made, contextlib.ExitStack() as finger:
        trial = made.next()
        assert trial is not None
        if lost == "motion":
            monkeypatch.setattr(sensed, "STILL_MM", 100.0)
            finger.enter_context(fake.stroking())
        row = made.answer(trial, made.present(trial) or [], "1", 0.5)
        assert row["flags"] == ["no contact" if lost == "contact" else "still"]
        assert made.next() == dataclasses.replace(trial, number=2)
        assert not results(made.protocol, made.rows)
    with experiment(client, log) as made, fake.stroking():  # gone on with
        monkeypatch.undo()
        trial = made.next()
        assert trial is not None
        made.answer(trial, made.present(trial) or [], "1", 0.5)
        (found,) = results(made.protocol, made.rows)
    assert (found.trials, found.not_felt, found.fit and found.fit.trials) == (1, 1, 1)
    assert [row["trial_type"] for row in event_rows(read_log(log)[0])] == ["not felt", "main"]


def test_an_interval_is_sensed_to_its_end_a_lead_after_it_was_asked_for(
    fake: Any, client: Client, tmp_path: Path
) -> None:
    """What is asked for plays a lead later: what was sensed by then is all before it."""
    fake.say_everything_once()
    fake.say(Topics.STATUS, fake.status(state="armed", owner="tester", lead_ms=200.0))
    with experiment(client, tmp_path / "log.jsonl") as made, fake.stroking(ahead_samples=0):
        trial = made.next()
        assert trial is not None
        shown = made.present(trial)
    assert shown is not None
    assert all(interval.felt for interval in shown)


def test_waiting_for_what_was_sensed_lengthens_no_gap(
    fake: Any, client: Client, tmp_path: Path
) -> None:
    held_by(fake, "tester")
    spaced = QUICK.model_copy(update={"gap_s": 0.5})
    with experiment(client, tmp_path / "log.jsonl", presentation=spaced) as made:
        trial = made.next()
        assert trial is not None
        shown = made.present(trial)
    assert shown is not None
    gap_s = (shown[1].first_sample - shown[0].last_sample) / 20_000.0
    assert gap_s == pytest.approx(0.5, abs=0.1)


def test_an_experiment_without_a_finger_ends(fake: Any, client: Client, tmp_path: Path) -> None:
    held_by(fake, "tester")
    log = tmp_path / "log.jsonl"
    for trials in (10, 20):  # it can be gone on with
        with (
            experiment(client, log) as made,
            pytest.raises(ArgumentError, match=f"{trials} trials in a row were not felt"),
        ):
            made.run(Right())
        assert made.schedule.recorded == trials


def test_rows_say_what_was_asked_and_rendered(
    fake: Any, client: Client, tmp_path: Path
) -> None:
    held_by(fake, "tester")
    log = tmp_path / "log.jsonl"
    with experiment(client, log) as made:
        trial = made.next()
        assert trial is not None
        shown = made.present(trial)
        assert shown is not None
        with pytest.raises(ArgumentError, match="accepted"):
            made.answer(trial, shown, "3", 0.1)
        assert made.next() == trial
        made.answer(trial, shown, str(trial.correct), 0.1)
        assert made.next() != trial
    header, start, row = read_log(log)[0]
    assert header["seed"] == 5
    assert start["event"] == "start"
    assert row["level"] == row["level_rendered"] == trial.level
    assert [each["shows"] for each in row["intervals"]] == list(trial.order)
    assert all(each["applied"]["gain"] == 1.0 for each in row["intervals"])
    assert row["correct"]
    assert row["flags"] == ["no contact"]  # a finger that says nothing
    scenes = []
    while not fake.calls.empty():
        call, request = fake.calls.get()
        scenes += [request.scene] if call == "scene" else []
    gains = [scene.regions[0].gain for scene in scenes if scene.regions]
    assert gains == [trial.level]
    assert not scenes[-1].regions


def test_fades_rise_and_fall_and_never_exceed_the_level(
    fake: Any, client: Client, tmp_path: Path
) -> None:
    held_by(fake, "tester")
    # The fake's feasible gain is no scene's own: nothing is to be refused by it.
    fading = Presentation(interval_s=0.3, gap_s=0.0, fade_s=0.1, on_scaled="flag")
    with experiment(client, tmp_path / "log.jsonl", presentation=fading) as made:
        trial = made.next()
        assert trial is not None
        made.present(trial)
    gains = []
    while not fake.calls.empty():
        call, request = fake.calls.get()
        if call == "scene" and request.scene.regions:
            gains.append(request.scene.regions[0].gain / trial.level)
    top = gains.index(1.0)
    assert gains[: top + 1] == sorted(gains[: top + 1])
    assert gains[top:] == sorted(gains[top:], reverse=True)
    assert 3 <= len(gains) <= 9
    assert max(gains) == 1.0


@pytest.mark.parametrize("fade_s", [0.0, 0.05])
def test_a_slow_reply_does_not_shorten_an_interval(
    fake: Any, client: Client, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fade_s: float
) -> None:
    held_by(fake, "tester")
    begins: list[float] = []
    ends: list[float] = []
    rendered = Rig.set_scene

    def slow(rig: Rig, scene: Any, *more: Any, **options: Any) -> Any:
        if not scene.regions:
            ends.append(time.monotonic())
            return rendered(rig, scene, *more, **options)
        if not begins:
            time.sleep(0.3)  # as long as the interval
        state = rendered(rig, scene, *more, **options)
        if not begins:
            begins.append(time.monotonic())
        return state

    monkeypatch.setattr(Rig, "set_scene", slow)
    lasting = Presentation(interval_s=0.3, gap_s=0.0, fade_s=fade_s, on_scaled="flag")
    with experiment(client, tmp_path / "log.jsonl", presentation=lasting) as made:
        trial = made.next()
        assert trial is not None
        made.present(trial)
    following = [end for end in ends if end > begins[0]]
    assert following[0] - begins[0] >= 0.3 - 1e-3


def test_a_mask_is_felt_between_intervals_and_nothing_after_them(
    fake: Any, client: Client, tmp_path: Path
) -> None:
    held_by(fake, "tester")
    mask = Spectrum(components=[Component(amplitude_n=0.02, hz=100.0)])
    masked = QUICK.model_copy(update={"mask": mask})
    with experiment(client, tmp_path / "log.jsonl", presentation=masked) as made:
        trial = made.next()
        assert trial is not None
        made.present(trial)
    felt = []
    while not fake.calls.empty():
        call, request = fake.calls.get()
        if call == "scene":
            regions = request.scene.regions
            kind = "smooth" if not regions else "test"
            felt.append("mask" if regions and regions[0].texture == mask else kind)
    shown = ["test" if each == "test" else "smooth" for each in trial.order]
    assert felt == ["mask", shown[0], "mask", "mask", shown[1], "mask", "smooth"]


def test_a_lost_lease_ends_it_and_logs_nothing(
    fake: Any, client: Client, tmp_path: Path
) -> None:
    held_by(fake, "tester")
    log = tmp_path / "log.jsonl"
    slow = Presentation(interval_s=30.0, gap_s=0.0, fade_s=0.0)
    with experiment(client, log, presentation=slow) as made:
        fake.say(Topics.STATUS, fake.status(state="tripped"))
        with pytest.raises(LeaseLostError):
            made.run(Right())
    assert not trials_of(log)


def test_a_log_has_one_participant_and_one_protocol(
    fake: Any, client: Client, tmp_path: Path
) -> None:
    held_by(fake, "tester")
    log = tmp_path / "log.jsonl"
    with experiment(client, log):
        pass
    before = log.read_bytes()
    for options, says in (
        ({"participant": "02"}, "participant"),
        ({"name": "other"}, "name"),
    ):
        with pytest.raises(ArgumentError, match=says):
            experiment(client, log, **options).__enter__()
    assert log.read_bytes() == before
    with experiment(client, log, seed=99) as made:  # a log has its own seed
        assert made.seed == 5
    assert json.loads(log.read_bytes().splitlines()[-1])["trials_before"] == 0


def test_a_trial_is_answered_once(fake: Any, client: Client, tmp_path: Path) -> None:
    held_by(fake, "tester")
    log = tmp_path / "log.jsonl"
    with experiment(client, log) as made:
        trial = made.next()
        assert trial is not None
        shown = made.present(trial)
        assert shown is not None
        made.answer(trial, shown, "1", 0.5)
        with pytest.raises(ArgumentError, match="trial 1 was answered"):
            made.answer(trial, shown, "1", 0.5)
    assert len(trials_of(log)) == 1
    with experiment(client, log) as made:  # goes on
        assert made.schedule.recorded == 1


def test_an_observer_sets_a_level_to_within_half_a_step() -> None:
    observer = SimulatedObserver(jnd_db=1e-6, floor_n=1e-9)
    task, rng = Adjustment(step_db=4.0), np.random.default_rng(1)
    for above_db, answer in ((-2.1, "+"), (-1.9, "="), (1.9, "="), (2.1, "-")):
        felt = [0.1, 0.1 * 10.0 ** (above_db / 20.0)]
        assert observer.answer(task, felt, rng) == answer


def test_outside_of_its_context_it_presents_nothing(
    client: Client, fake: Any, tmp_path: Path
) -> None:
    made = experiment(client, tmp_path / "log.jsonl")
    trial = made.next()
    assert trial is not None
    with pytest.raises(RuntimeError, match="with"):
        made.present(trial)


@pytest.mark.parametrize("options", [{"participant": "a b"}, {"order_row": -1}, {"seed": -1}])
def test_what_is_no_experiment_is_refused(
    options: dict[str, Any], client: Client, fake: Any, tmp_path: Path
) -> None:
    with pytest.raises(ArgumentError):
        experiment(client, tmp_path / "log.jsonl", **options)
    with pytest.raises(ArgumentError, match="levels"):
        Experiment(client.rig("sim", "lab"), TwoAlternatives(), ConstantPlan(), RIDGES, log="x")


def test_an_observer_wants_a_simulated_rig(fake: Any, client: Client) -> None:
    fake.say(Topics.STATUS, fake.status(simulated=False))
    with pytest.raises(ArgumentError, match="not simulated"):
        VirtualParticipant(client.rig("sim", "lab"), TwoAlternatives(), SimulatedObserver(), 1)


class Louder(Right):
    """Wants more, so many times, and takes what there is."""

    def __init__(self, wishes: int) -> None:
        self.left = wishes

    def ask(self, trial: ScheduledTrial, intervals: list[Any]) -> str:
        self.left -= 1
        return "+" if self.left >= 0 else "="


@pytest.mark.parametrize(("wishes", "flags"), [(0, []), (1, []), (12, ["limited"])])
def test_a_setting_that_could_go_no_further_says_so(
    wishes: int, flags: list[str], fake: Any, client: Client, tmp_path: Path
) -> None:
    held_by(fake, "tester")
    made = Experiment(
        client.rig("sim", "lab"),
        Adjustment(step_db=2.0, high=0.4),
        ConstantPlan(levels=[0.1], repeats=1),
        RIDGES,
        log=tmp_path / "log.jsonl",
        presentation=QUICK,
        seed=1,
    )
    with made, fake.stroking():
        made.run(Louder(wishes))
        row = made.rows[-1]
        (found,) = results(made.protocol, made.rows)
    assert row["flags"] == flags
    assert (row["settings"][-1] == 0.4) == bool(flags)
    assert found.limited == len(flags)

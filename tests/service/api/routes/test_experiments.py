"""Experiments as jobs over REST: real processes that ask, are answered, paused and killed."""

import json
import os
import queue
import shutil
import signal
import sys
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, cast

import pytest
from fastapi.testclient import TestClient
from tests.service.api.conftest import TOKENS, FakeRig, configuration

from frictus.experiment import load_protocol, read_log, ready_protocols, results
from frictus_service.api.server import build_app
from frictus_service.experiments.report import report
from frictus_service.jobs import process

RUN = "tests.service.jobs.stepwise_experiment:run"
ROOT = Path(__file__).parents[4]
TRIALS = 6
TOML = f"""
name = "brief"
description = "A few trials."
[task]
kind = "2afc"
[procedure]
kind = "quest+"
levels = {{ low = 0.001, high = 0.1, count = 9 }}
trials = {TRIALS}
[conditions.ridges]
kind = "amplitude"
texture = {{ kind = "spectrum", components = [{{ amplitude_n = 1.0, cycles_per_mm = 0.5 }}] }}
[design]
break_every = 4
"""
ADJUST = TOML.replace('"2afc"', '"adjustment"').replace(
    f'"quest+"\nlevels = {{ low = 0.001, high = 0.1, count = 9 }}\ntrials = {TRIALS}',
    '"constant"\nlevels = [0.01]\nrepeats = 2',
)
Serve = Callable[..., TestClient]


@pytest.fixture
def api(serve: Serve, monkeypatch: pytest.MonkeyPatch) -> TestClient:
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    return serve(present=RUN)


def start(api: TestClient, rig: str, who: str = "P01", **more: Any) -> Any:
    asked = {"rig": rig, "participant": who, "seed": 3} | (more or {"toml": TOML})
    return api.post("/v1/experiments", json=asked)


def begun(api: TestClient, rig: FakeRig, **more: Any) -> str:
    answer = start(api, rig.name, **more)
    assert answer.status_code == 202, answer.text
    return str(answer.headers["location"])


def screen(api: TestClient, job: str, *phases: str) -> Any:
    """Wait until the participant is shown one of these phases, and return what is."""
    while True:
        found = api.get(job).json()
        assert found["state"] in ("queued", "running"), found
        if found["screen"] is not None and found["screen"]["phase"] in phases:
            return found["screen"]


def give(api: TestClient, job: str, shown: Any, answer: str) -> Any:
    asked = {"trial": shown["trial"], "step": shown["step"], "answer": answer}
    return api.post(f"{job}/answers", json=asked)


def answer(api: TestClient, job: str, answer: str = "1") -> Any:
    """Answer the next question, breaks before it included; return what was shown."""
    while True:
        shown = screen(api, job, "ready", "break", "question")
        given = answer if shown["phase"] == "question" else "go"
        assert give(api, job, shown, given).status_code == 202
        if shown["phase"] == "question":
            return shown


def until_end(api: TestClient, job: str) -> str:
    """Wait until an experiment runs no more; return its last state."""
    events = api.get(f"{job}/events").text
    last = [line for line in events.splitlines() if line.startswith("data: ")][-1]
    return str(json.loads(last.removeprefix("data: "))["state"])


def until_told(caplog: pytest.LogCaptureFixture, text: str) -> None:
    while text not in caplog.text:
        time.sleep(0.01)


def pid_of(api: TestClient, job: str) -> int:
    running = api.app.state.services.experiments._jobs[job.rpartition("/")[2]]  # type: ignore[attr-defined]
    return int(running.process.pid)


def test_from_the_first_question_to_the_table(
    api: TestClient, rig: FakeRig, tmp_path: Path
) -> None:
    job = begun(api, rig)
    ready = screen(api, job, "ready")
    spec = {"rig": rig.name, "participant": "P01", "seed": 1}
    refused = api.post("/v1/calibrations", json=spec)
    assert (refused.status_code, refused.json()["code"]) == (409, "rig_busy")
    assert (ready["trial"], ready["step"], ready["answered"]) == (1, 0, 0)
    asked = [answer(api, job, "12"[k % 2]) for k in range(TRIALS)]
    assert [shown["answered"] for shown in asked] == list(range(TRIALS))
    assert until_end(api, job) == "done"

    done = api.get(job).json()
    assert (done["protocol"], done["planned"], done["screen"]) == ("brief", TRIALS, None)
    folder = tmp_path / "studies" / "experiments" / done["id"]
    assert (folder / "client").read_text("ascii").endswith(f"experiment-{done['id'][-8:]}")
    rows, _ = read_log(folder / "trials.jsonl")
    trials = [row for row in rows if "trial" in row]
    assert [row["response"] for row in trials] == list("121212")
    assert [row["level"] for row in trials] == [shown["level"] for shown in asked]

    said = api.get(f"{job}/report", params={"most": 4}).json()
    assert [row["trial"] for row in said["trials"]] == [6, 5, 4, 3]
    assert (said["left_out"], api.get(f"{job}/report").json()["left_out"]) == (2, 0)
    (condition,) = said["conditions"]
    protocol = api.app.state.services.experiments.store.protocol(done["id"])  # type: ignore[attr-defined]
    (found,) = results(protocol, rows)
    assert found.fit is not None
    assert condition["threshold"]["value"] == found.fit.threshold.value
    assert sum(point["trials"] for point in condition["points"]) == TRIALS
    assert f"{found.fit.threshold.value:.3g} N" in " ".join(condition["lines"])
    # Half way between guess and lapse rate is the threshold.
    half = 0.5 + 0.5 * (0.5 - found.fit.lapse)
    (before, after) = (
        [level for level, p in condition["curve"] if (p > half) == above]
        for above in (False, True)
    )
    assert max(before) <= condition["threshold"]["value"] <= min(after)

    table = api.get(f"{job}/events.tsv")
    assert table.headers["content-type"].startswith("text/tab-separated-values")
    assert len(table.text.splitlines()) == TRIALS + 1
    listed = api.get("/v1/experiments", params={"rig": rig.name}).json()
    assert not listed["more"]
    assert [each["id"] for each in listed["experiments"]] == [done["id"]]
    assert {each["name"] for each in listed["ready"]} == set(ready_protocols())


def test_who_may_not_calibrate_is_not_told_what_is_played(
    serve: Serve, rig: FakeRig, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    api = serve(tokens=True, present=RUN)

    def by(scope: str) -> dict[str, str]:
        return {"Authorization": f"Bearer {TOKENS[scope]}"}

    asked = {"rig": rig.name, "participant": "P01", "toml": TOML, "seed": 3}
    made = api.post("/v1/experiments", json=asked, headers=by("calibrate"))
    job = made.headers["location"]
    assert made.json()["seed"] == 3
    api.headers.update(by("read"))
    shown = screen(api, job, "ready")
    given = {"trial": shown["trial"], "step": shown["step"], "answer": "go"}
    answered = api.post(f"{job}/answers", json=given, headers=by("render"))
    asked_of = screen(api, job, "question")
    (listed,) = api.get("/v1/experiments", params={"rig": rig.name}).json()["experiments"]
    for told in (asked_of, answered.json()["screen"], listed["screen"]):
        hidden = {name: told[name] for name in ("condition", "level", "unit", "refused")}
        assert hidden == {"condition": None, "level": None, "unit": "", "refused": 0}
    api.delete(job, headers=by("calibrate"))
    events = api.get(f"{job}/events").text.splitlines()  # until it has ended
    followed = [json.loads(line[6:]) for line in events if line.startswith("data: ")]
    for told in (answered.json(), listed, *followed, api.get(job).json()):
        assert told["seed"] is None


def test_a_question_takes_one_answer_that_the_task_has(api: TestClient, rig: FakeRig) -> None:
    job = begun(api, rig)
    ready = screen(api, job, "ready")
    assert give(api, job, ready, "1").json()["code"] == "bad_request"  # go is
    # A quick experiment shows its question before the answer is told.
    assert give(api, job, ready, "go").json()["screen"]["phase"] in ("wait", "question")
    assert give(api, job, ready, "go").json()["code"] == "wrong_state"
    first = screen(api, job, "question")
    assert (first["trial"], first["step"]) == (1, 1)
    wrong = give(api, job, first, "3")
    assert (wrong.status_code, wrong.json()["code"]) == (422, "bad_request")
    assert "1, 2 accepted" in wrong.json()["detail"]
    assert give(api, job, first, "2").status_code == 202
    while (second := screen(api, job, "question"))["trial"] == 1:
        pass
    replayed = give(api, job, first, "1")
    assert (replayed.status_code, replayed.json()["code"]) == (409, "wrong_state")
    assert "trial 2 is under way" in replayed.json()["detail"]
    assert give(api, job, second, "1").status_code == 202
    assert api.delete(job).status_code == 202
    assert until_end(api, job) == "cancelled"
    assert give(api, job, second, "1").json()["code"] == "wrong_state"


@pytest.mark.parametrize(
    "asked",
    [
        {},
        {"protocol": "detection", "toml": TOML},
        {"protocol": "no-such"},
        {"protocol": "../../etc/passwd"},
        {"toml": "name = "},
        {"toml": "[" * 100_000},
        {"toml": "a." * 90_000 + "a = 1"},
        {"toml": "x" * 200_001},
        {"toml": TOML.replace("0.5 }", "nan }")},
        {"toml": TOML.replace("trials = 6", "trials = 1e400")},
        {"protocol": "detection", "participant": "P 01"},
        {"protocol": "detection", "order_row": -1},
        {"protocol": "detection", "seed": 2**53},
        {"protocol": "detection", "more": 1},
    ],
)
def test_what_is_no_experiment_is_refused(
    api: TestClient, rig: FakeRig, asked: dict[str, Any]
) -> None:
    answer = api.post("/v1/experiments", json={"rig": rig.name, "participant": "P01"} | asked)
    assert (answer.status_code, answer.json()["code"]) == (422, "bad_request"), answer.text
    assert len(answer.text) < 3_000
    assert api.get("/v1/experiments").json()["experiments"] == []


def test_one_on_a_rig_that_is_there(api: TestClient, rig: FakeRig) -> None:
    assert start(api, "no-such-rig").json()["code"] == "no_rig"
    job = begun(api, rig)
    refused = start(api, rig.name, "P02")
    assert (refused.status_code, refused.json()["code"]) == (409, "rig_busy")
    assert "brief, P01" in refused.json()["detail"]
    screen(api, job, "ready")
    api.delete(job)
    assert until_end(api, job) == "cancelled"
    begun(api, rig, who="P02", toml=TOML)
    for method, path in (("GET", ""), ("GET", "/report"), ("POST", "/pause"), ("DELETE", "")):
        answer = api.request(method, f"/v1/experiments/0-0{path}")
        assert answer.json()["code"] == "no_experiment"


def test_a_pause_comes_before_the_next_trial(api: TestClient, rig: FakeRig) -> None:
    job = begun(api, rig)
    give(api, job, screen(api, job, "ready"), "go")
    first = screen(api, job, "question")
    assert api.post(f"{job}/pause").json()["screen"]["pausing"]
    assert screen(api, job, "question")["trial"] == 1  # it is answered first
    give(api, job, first, "1")
    paused = screen(api, job, "pause")
    assert (paused["trial"], paused["answered"]) == (2, 1)
    assert give(api, job, paused, "go").json()["code"] == "wrong_state"
    assert api.post(f"{job}/resume").status_code == 202
    assert screen(api, job, "question")["trial"] == 2
    answer(api, job)
    api.delete(job)
    assert until_end(api, job) == "cancelled"
    assert api.post(f"{job}/pause").json()["code"] == "wrong_state"
    assert api.delete(job).json()["code"] == "wrong_state"


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGKILL for others")
def test_killed_it_goes_on_with_the_same_stimulus(api: TestClient, rig: FakeRig) -> None:
    job = begun(api, rig)
    for _ in range(3):
        answer(api, job)
    while (before := screen(api, job, "question"))["trial"] == 3:
        pass
    os.kill(pid_of(api, job), signal.SIGKILL)
    assert until_end(api, job) == "interrupted"
    assert give(api, job, before, "1").json()["code"] == "wrong_state"
    assert len(api.get(f"{job}/report").json()["trials"]) == 3
    assert api.post(f"{job}/resume").json()["state"] == "queued"
    assert screen(api, job, "ready")["answered"] == 3
    after = answer(api, job)
    same = ("trial", "level", "condition", "practice", "answered")
    assert {name: after[name] for name in same} == {name: before[name] for name in same}
    while api.get(job).json()["state"] != "done":
        shown = api.get(job).json()["screen"]
        if shown is not None and shown["phase"] in ("break", "question"):
            give(api, job, shown, "1" if shown["phase"] == "question" else "go")
    assert api.post(f"{job}/resume").json()["code"] == "wrong_state"
    assert len(api.get(f"{job}/report").json()["trials"]) == TRIALS


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGSTOP")
def test_one_that_stands_still_holds_nobody_up(
    api: TestClient, rig: FakeRig, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(process, "GRACE_S", 0.1)
    job = begun(api, rig)
    screen(api, job, "ready")
    os.kill(pid_of(api, job), signal.SIGSTOP)
    said = [api.post(f"{job}/{what}") for _ in range(20) for what in ("pause", "resume")]
    refused = [answer.json()["detail"] for answer in said if answer.status_code == 409]
    assert len(refused) == len(said) - process.MOST_UNHEARD
    assert "stop it" in refused[0]
    assert api.delete(job).status_code == 202
    assert until_end(api, job) == "cancelled"


def test_an_end_says_why_and_it_can_go_on(
    api: TestClient, rig: FakeRig, tmp_path: Path
) -> None:
    job = begun(api, rig)
    answer(api, job)
    screen(api, job, "question")
    stopped = tmp_path / "studies" / "experiments" / job.rpartition("/")[2] / "stopped"
    stopped.touch()  # while the participant thinks
    assert until_end(api, job) == "failed"
    assert api.get(job).json()["failure"] == "stopped by local.rest"
    stopped.unlink()
    resumed = api.post(f"{job}/resume").json()
    assert (resumed["state"], resumed["failure"]) == ("queued", None)
    assert answer(api, job)["trial"] == 2
    api.delete(job)
    assert until_end(api, job) == "cancelled"
    broken = begun(api, rig, who="broken", toml=TOML)
    assert until_end(api, broken) == "failed"
    assert "ZeroDivisionError: in the middle" in api.get(broken).json()["failure"]


def test_what_is_damaged_is_said(api: TestClient, rig: FakeRig, tmp_path: Path) -> None:
    job = begun(api, rig)
    answer(api, job)
    screen(api, job, "question")
    api.delete(job)
    assert until_end(api, job) == "cancelled"
    folder = tmp_path / "studies" / "experiments" / job.rpartition("/")[2]
    log, protocol = folder / "trials.jsonl", folder / "protocol.json"
    whole = log.read_bytes()
    log.write_bytes(b"{}\n" + whole)
    assert api.get(f"{job}/report").json()["code"] == "bad_request"
    api.post(f"{job}/resume")
    assert until_end(api, job) == "failed"
    assert "no header" in api.get(job).json()["failure"]
    log.write_bytes(whole)
    protocol.write_bytes(b"{")
    assert api.get(f"{job}/report").json()["code"] == "wrong_state"
    api.post(f"{job}/resume")
    assert until_end(api, job) == "failed"
    assert "protocol.json cannot be read" in api.get(job).json()["failure"]


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGSTOP")
def test_one_whose_folder_is_deleted_ends_and_gives_its_rig_back(
    api: TestClient,
    rig: FakeRig,
    tmp_path: Path,
    caplog: pytest.LogCaptureFixture,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    engine = cast(Any, api.app).state.services.experiments
    job = begun(api, rig)
    answer(api, job)
    screen(api, job, "question")
    pid = pid_of(api, job)
    os.kill(pid, signal.SIGSTOP)
    looked, get = queue.SimpleQueue[str](), engine.get

    def get_and_tell(of: str) -> Any:
        found = get(of)
        looked.put(of)
        return found

    monkeypatch.setattr(engine, "get", get_and_tell)
    with ThreadPoolExecutor() as pool:
        followed = pool.submit(until_end, api, job)
        for _ in ("whether it is there", "as the first event"):
            looked.get()
        shutil.rmtree(tmp_path / "studies" / "experiments" / job.rpartition("/")[2])
        assert "was deleted or moved" in api.get(job).json()["detail"]
        assert start(api, rig.name, toml=TOML).json()["code"] == "rig_busy"
        os.kill(pid, signal.SIGCONT)
        assert followed.result() == "failed"
    while (again := start(api, rig.name, toml=TOML)).status_code == 409:
        pass
    assert again.status_code == 202
    until_told(caplog, "trials.jsonl takes no more trials: the file was deleted")
    assert "Traceback" not in caplog.text
    api.delete(again.headers["location"])
    assert until_end(api, again.headers["location"]) == "cancelled"


def test_an_adjustment_has_a_question_for_each_step(api: TestClient, rig: FakeRig) -> None:
    job = begun(api, rig, toml=ADJUST)
    shown = answer(api, job, "=")
    assert (shown["trial"], shown["step"], shown["intervals"]) == (1, 1, 2)
    answer(api, job, "=")
    assert until_end(api, job) == "done"
    (condition,) = api.get(f"{job}/report").json()["conditions"]
    assert (condition["points"], condition["curve"]) == ([], [])
    assert condition["threshold"] is not None


def test_an_api_that_ends_leaves_it_to_be_gone_on_with(
    router: str, rig: FakeRig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    config = configuration(router, tmp_path / "textures")
    base = "http://127.0.0.1:8420"
    with TestClient(build_app(config, present=RUN), base_url=base) as api:
        job = begun(api, rig)
        answer(api, job)
    with TestClient(build_app(config, present=RUN), base_url=base) as api:
        assert api.get(job).json()["state"] == "interrupted"
        assert api.post(f"{job}/resume").status_code == 202
        assert answer(api, job)["trial"] == 2


def test_a_report_of_an_experiment_that_has_no_answers_yet() -> None:
    said = report(load_protocol("detection"), [], 10)
    assert (said.trials, said.conditions) == ([], [])

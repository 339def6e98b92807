"""Calibrations as jobs over REST: real processes, started, followed, cancelled and killed."""

import contextlib
import importlib.util
import json
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from http.client import HTTPConnection, HTTPResponse
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import pytest
from fastapi.testclient import TestClient

from frictus_service.config import ApiConfig, Config, RegistryConfig, RouterConfig
from frictus_service.processes import free_port
from frictus_service.registry.calibrations import Calibrations

STEPWISE = Path(__file__).parents[2] / "jobs" / "stepwise.py"
RUN = "stepwise:run"
SERVER = """
import sys, uvicorn
from frictus_service.api.server import build_app
from frictus_service.config import Config
config = Config.model_validate_json(sys.argv[1])
uvicorn.run(build_app(config, sys.argv[2]), port=config.api.port, log_level="warning")
"""


class Event(NamedTuple):
    number: int
    kind: str
    data: Any


def events_in(text: str) -> list[Event]:
    """Return the events of a stream, read as the specification of the format has it."""
    found = []
    for block in text.split("\n\n"):
        fields = dict(line.split(": ", 1) for line in block.splitlines() if line[:1] != ":")
        if fields:
            data = json.loads(fields["data"])
            found.append(Event(int(fields["id"]), fields["event"], data))
    return found


def states(events: list[Event]) -> list[str]:
    return [event.data for event in events if event.kind == "state"]


@pytest.fixture(autouse=True)
def importable(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the processes of calibrations import the function that they shall run."""
    monkeypatch.setenv("PYTHONPATH", str(STEPWISE.parent))


@pytest.fixture
def stepwise() -> ModuleType:
    found = importlib.util.spec_from_file_location("stepwise", STEPWISE)
    assert found is not None
    assert found.loader is not None
    module = importlib.util.module_from_spec(found)
    found.loader.exec_module(module)
    return module


@pytest.fixture
def allow(stepwise: ModuleType, tmp_path: Path) -> Callable[[int], None]:
    """Let calibrations do so many trials; at first, all."""
    stepwise.allow(tmp_path / "studies", stepwise.TRIALS)
    return lambda trials: stepwise.allow(tmp_path / "studies", trials)


@pytest.fixture
def api(serve: Any, allow: Any) -> TestClient:
    client: TestClient = serve(calibrate=RUN)
    return client


def start(api: TestClient, rig: str, participant: str = "P01", **more: Any) -> Any:
    headers = more.pop("headers", {})
    body = {"rig": rig, "participant": participant, "seed": 7, **more}
    return api.post("/v1/calibrations", json=body, headers=headers)


def follow(api: TestClient, job: str, after: int | None = None) -> list[Event]:
    """Wait until a calibration runs no more; return what it told."""
    headers = {} if after is None else {"Last-Event-ID": str(after)}
    answer = api.get(f"{job}/events", headers=headers)
    assert answer.headers["content-type"].startswith("text/event-stream")
    return events_in(answer.text)


def wait_for_trials(api: TestClient, job: str, trials: int) -> None:
    while (api.get(job).json()["progress"] or {"trials_done": -1})["trials_done"] < trials:
        pass


def test_from_start_to_published_model(api: TestClient, rig: Any, tmp_path: Path) -> None:
    started = start(api, rig.name)
    assert started.status_code == 202
    assert started.json()["state"] == "queued"
    job = started.headers["location"]
    told = follow(api, job)
    assert [event.number for event in told] == list(range(1, len(told) + 1))
    assert states(told) == ["queued", "running", "done"]
    progress = [event.data["trials_done"] for event in told if event.kind == "progress"]
    assert progress == [0, 1, 2, 3]
    assert follow(api, job, after=3) == told[3:]
    assert follow(api, job, after=told[-1].number) == []
    assert api.get(f"{job}/events", headers={"Last-Event-ID": "x"}).status_code == 422

    done = api.get(job).json()
    assert (done["state"], done["published"]) == ("done", None)
    assert done["result"]["model"]["schema"] == "model/1"
    client = (tmp_path / "studies" / done["id"] / "client").read_text("ascii")
    assert client == f"local.calibration-{done['id'][-8:]}"  # as rigs know it
    assert api.delete(job).json()["code"] == "wrong_state"
    assert api.post(f"{job}/resume").json()["code"] == "wrong_state"

    published = api.post(f"{job}/publish", json={"comment": "first"})
    assert published.status_code == 201
    assert published.headers["location"] == f"/v1/models/{rig.name}/P01@1"
    assert published.json()["calibration"] == done["id"]
    again = api.post(f"{job}/publish", json={"name": "elsewhere"})
    assert again.json() == published.json()
    assert api.get(job).json()["published"] == f"{rig.name}/P01@1"
    assert len(api.get("/v1/models").json()["models"]) == 1


def test_who_follows_does_not_read_again_and_again_what_was_asked(
    api: TestClient, rig: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    # With 200 earlier people in it, 12 ms: 50 streams that look five times a second took all.
    job = start(api, rig.name).headers["location"]
    read: list[str] = []
    get = Calibrations.get

    def counted(self: Calibrations, calibration: str) -> Any:
        read.append(calibration)
        return get(self, calibration)

    monkeypatch.setattr(Calibrations, "get", counted)
    assert states(follow(api, job))[-1] == "done"
    assert len(read) == 1


def test_one_at_a_time_then_cancelled(api: TestClient, rig: Any, allow: Any) -> None:
    allow(1)
    key = {"Idempotency-Key": "once"}
    first = start(api, rig.name, headers=key)
    job = first.headers["location"]
    second = start(api, rig.name, "P02")
    assert (second.status_code, second.json()["code"]) == (409, "rig_busy")
    experiment = {"rig": rig.name, "participant": "P01", "protocol": "detection"}
    third = api.post("/v1/experiments", json=experiment)
    assert (third.status_code, third.json()["code"]) == (409, "rig_busy")
    again = start(api, rig.name, headers=key)  # the same request: the same calibration
    assert (again.status_code, again.headers["location"]) == (202, job)
    assert again.json()["id"] == first.json()["id"]
    wait_for_trials(api, job, 1)
    assert api.post(f"{job}/publish", json={}).json()["code"] == "wrong_state"
    assert api.post(f"{job}/resume").json()["code"] == "wrong_state"

    assert api.delete(job).status_code == 202
    assert states(follow(api, job)) == ["queued", "running", "cancelled"]
    assert api.post(f"{job}/resume").json()["code"] == "wrong_state"
    allow(3)
    other = start(api, rig.name, "P02").headers["location"]
    assert states(follow(api, other))[-1] == "done"

    def found(**wanted: str) -> list[str]:
        page = api.get("/v1/calibrations", params=wanted).json()
        return [row["participant"] for row in page["calibrations"]]

    assert sorted(found()) == ["P01", "P02"]
    assert found(state="done") == ["P02"]
    assert found(rig="another") == []
    assert found(participant="P01", state="cancelled") == ["P01"]


def test_failed_and_resumed(api: TestClient, rig: Any, tmp_path: Path) -> None:
    job = start(api, rig.name, "clumsy").headers["location"]
    assert states(follow(api, job)) == ["queued", "running", "failed"]
    failed = api.get(job).json()
    assert failed["failure"] == "the rig has tripped"
    (tmp_path / "studies" / "mended").touch()
    assert api.post(f"{job}/resume").status_code == 202
    told = follow(api, job)
    assert states(told)[3:] == ["queued", "running", "done"]
    resumed = [e.data["trials_done"] for e in told[len(told) - 3 :] if e.kind == "progress"]
    assert resumed[-1:] == [3]  # nothing was measured again
    done = api.get(job).json()
    assert done["failure"] is None
    trials = tmp_path / "studies" / done["id"] / "trials"
    assert len(trials.read_text("ascii").splitlines()) == 3


@pytest.mark.parametrize(
    ("participant", "end"), [("broken", "failed"), ("fatal", "interrupted")]
)
def test_a_process_that_breaks_is_told(
    api: TestClient, rig: Any, participant: str, end: str
) -> None:
    job = start(api, rig.name, participant).headers["location"]
    assert states(follow(api, job))[-1] == end
    failure = api.get(job).json()["failure"]
    assert failure is None or "ZeroDivisionError" in failure


def test_what_does_not_stop_is_ended(api: TestClient, rig: Any, allow: Any) -> None:
    allow(1)
    job = start(api, rig.name, "deaf").headers["location"]
    wait_for_trials(api, job, 1)
    api.delete(job)
    assert states(follow(api, job))[-1] == "cancelled"


def test_an_api_that_stops_interrupts_and_the_next_resumes(
    serve: Any, rig: Any, allow: Any, tmp_path: Path
) -> None:
    allow(1)
    before = serve(calibrate=RUN)
    started = start(before, rig.name)
    job = started.headers["location"]
    wait_for_trials(before, job, 1)
    before.__exit__(None, None, None)
    assert (tmp_path / "studies" / started.json()["id"] / "disarmed").exists()

    after = serve(calibrate=RUN)
    assert after.get(job).json()["state"] == "interrupted"
    allow(3)
    assert after.post(f"{job}/resume").status_code == 202
    told = follow(after, job)
    assert states(told) == ["queued", "running", "interrupted", "queued", "running", "done"]


def test_an_interrupted_one_can_be_given_up(serve: Any, rig: Any, allow: Any) -> None:
    allow(0)
    before = serve(calibrate=RUN)
    job = start(before, rig.name).headers["location"]
    before.__exit__(None, None, None)
    after = serve(calibrate=RUN)
    assert after.delete(job).json()["state"] == "cancelled"


def test_sent_again_it_is_answered_without_the_rig_too(api: TestClient, rig: Any) -> None:
    key = {"Idempotency-Key": "of-a-rig-that-goes"}
    first = start(api, rig.name, headers=key)
    assert first.status_code == 202
    rig.vanish()
    while start(api, rig.name, "P02").status_code != 404:
        pass
    again = start(api, rig.name, headers=key)
    assert (again.status_code, again.json()["id"]) == (202, first.json()["id"])
    assert start(api, rig.name, "P02", headers=key).json()["code"] == "key_reused"


def test_one_of_another_site_is_left_to_it(serve: Any, rig: Any, allow: Any) -> None:
    allow(1)
    first = serve(calibrate=RUN)
    job = start(first, rig.name).headers["location"]
    wait_for_trials(first, job, 1)
    elsewhere = serve(calibrate=RUN, site="hall")  # with the same registry
    assert elsewhere.get(job).json()["site"] == "lab"
    for told in (elsewhere.delete(job), elsewhere.post(f"{job}/resume")):
        assert told.json()["code"] == "wrong_state"
        assert "of site 'lab', and this is 'hall'" in told.json()["detail"]
    assert first.get(job).json()["state"] == "running"
    first.delete(job)
    assert states(follow(first, job))[-1] == "cancelled"


def test_what_cannot_be_started(api: TestClient, rig: Any) -> None:
    assert start(api, "nobody").json()["code"] == "no_rig"
    for more in (
        {"seed": -1},
        {"unknown": 1},
        {"protocol": {"kind": "slow"}},
        {"protocol": {"kind": "quick", "precision": 2.0}},
        {"protocol": {"kind": "quick", "speeds_mm_s": [0.0]}},
        {"protocol": {"kind": "paper", "speeds_mm_s": []}},
        {"protocol": {"kind": "paper", "tones_hz": [1e9]}},
        {"protocol": {"kind": "paper", "forces_n": [-0.3]}},
        {"protocol": {"kind": "paper", "speeds_mm_s": [50.0] * 30, "forces_n": [0.3] * 30}},
        {"participant": "Jane Doe"},
        {"rig": ""},
        {"rig": "a/b"},
        {"rig": "*"},
    ):
        said = start(api, **({"rig": rig.name, "participant": "P01"} | more))
        assert (said.status_code, said.json()["code"]) == (422, "bad_request")
    text = json.dumps({"rig": rig.name, "participant": "P", "seed": 1, "protocol": {}})
    bad = text.replace("{}", '{"kind": "quick", "record_s": NaN}')
    headers = {"Content-Type": "application/json"}
    assert api.post("/v1/calibrations", content=bad, headers=headers).status_code == 422
    assert api.get("/v1/calibrations").json()["calibrations"] == []
    for path in ("0", "0/events", "x"):
        assert api.get(f"/v1/calibrations/{path}").status_code in (404, 422)


def test_quick_learns_from_those_who_were_published(
    api: TestClient, rig: Any, allow: Any
) -> None:
    allow(0)
    law = {"law": "first_order_speed", "cutoff_0_hz": 400.0, "slope_hz_per_mm_s": 12.0}
    names = ["gain_n", "cutoff_0_hz", "slope_hz_per_mm_s"]
    diagonal = [[1e-4, 0.0, 0.0], [0.0, 25.0, 0.0], [0.0, 0.0, 0.01]]
    for person, gain, covariance in (
        ("P01", 0.3, True),
        ("P02", 0.4, True),
        ("P02", 0.5, True),
        ("P03", 0.6, False),
        (None, 0.7, True),
    ):
        model: dict[str, Any] = {"base": {**law, "gain_n": gain}, "participant": person}
        model["provenance"] = {"source": "a test"}
        if covariance:
            model["covariance"] = {"parameters": names, "matrix": diagonal}
        body = {"name": f"rig1/{person or 'all'}", "model": model}
        assert api.post("/v1/models", json=body).status_code == 201

    def gains(participant: str, **protocol: Any) -> list[float]:
        more = {"protocol": protocol} if protocol else {}
        started = start(api, rig.name, participant, **more)
        api.delete(started.headers["location"])
        follow(api, started.headers["location"])
        return [model["base"]["gain_n"] for model in started.json()["spec"]["prior"]]

    assert gains("P09") == [0.5, 0.3]
    assert gains("P01") == [0.5]
    assert gains("P09", kind="quick", use_prior=False) == []


@pytest.fixture
def config(router: str, tmp_path: Path) -> Config:
    return Config(
        router=RouterConfig(endpoint=router, host=False),
        textures=tmp_path / "textures",
        studies=tmp_path / "studies",
        registry=RegistryConfig(url=f"sqlite:///{tmp_path / 'registry.db'}"),
        api=ApiConfig(port=free_port()),
    )


@contextlib.contextmanager
def ask(config: Config, method: str, path: str, body: Any = None) -> Iterator[HTTPResponse]:
    connection = HTTPConnection("127.0.0.1", config.api.port, timeout=60.0)
    content = None if body is None else json.dumps(body)
    with contextlib.closing(connection):
        connection.request(method, path, content, {"Content-Type": "application/json"})
        with connection.getresponse() as answer:
            yield answer


def serving(config: Config) -> "subprocess.Popen[bytes]":
    """Start an API process, and wait until it answers."""
    command = [sys.executable, "-c", SERVER, config.model_dump_json(), RUN]
    process = subprocess.Popen(command)
    while process.poll() is None:
        try:
            with ask(config, "GET", "/v1/health") as answer:
                assert answer.status == 200
                return process
        except ConnectionError:
            time.sleep(0.005)
    raise AssertionError("the API process has ended")


def test_a_killed_api_leaves_nothing_running_and_loses_nothing(
    config: Config, rig: Any, allow: Any
) -> None:
    allow(1)
    process = serving(config)
    try:
        body = {"rig": rig.name, "participant": "P01", "seed": 7}
        with ask(config, "POST", "/v1/calibrations", body) as answer:
            started = json.loads(answer.read())
        job = f"/v1/calibrations/{started['id']}"
        with ask(config, "GET", f"{job}/events") as stream:  # as it happens, not at its end
            while b'"trials_done":1' not in stream.readline():
                pass
            process.kill()
            process.wait(60.0)
        while not (config.studies / started["id"] / "disarmed").exists():
            time.sleep(0.005)  # until the calibration's process has seen it, and stopped
        process = serving(config)
        with ask(config, "GET", job) as answer:
            found = json.loads(answer.read())
        assert found["state"] == "interrupted"
        assert found["progress"]["trials_done"] == 1
        allow(3)
        with ask(config, "POST", f"{job}/resume") as answer:
            assert answer.status == 202
        with ask(config, "GET", f"{job}/events") as answer:
            told = events_in(answer.read().decode())
        assert states(told)[-3:] == ["queued", "running", "done"]
        assert [e.number for e in told] == list(range(1, len(told) + 1))
    finally:
        process.kill()
        process.wait(60.0)

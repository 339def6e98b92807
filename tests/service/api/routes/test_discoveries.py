"""Discoveries as jobs over REST: real processes, started, followed, cancelled and killed."""

import errno
import json
import os
import queue
import shutil
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple, cast

import pytest
from fastapi.testclient import TestClient
from tests.full_disk import full_after
from tests.service.api.conftest import configuration
from tests.service.jobs import stepwise_discovery

from frictus_service import job_folder
from frictus_service.api.server import build_app
from frictus_service.discovery.across_studies.document import AcrossStudies
from frictus_service.discovery.document import Discovery
from frictus_service.discovery.jobs import DiscoverySpec, DiscoveryStore
from frictus_service.jobs import discoveries

RUN = "tests.service.jobs.stepwise_discovery:run"
ROOT = Path(__file__).parents[4]
STUDIES = ("visit.h5", "bad.h5", "fatal.h5")


class Event(NamedTuple):
    number: int
    kind: str
    data: Any


@pytest.fixture
def studies(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    folder = tmp_path / "studies"
    folder.mkdir()
    for name in STUDIES:
        (folder / name).touch()
    stepwise_discovery.allow(folder, stepwise_discovery.STEPS)
    return folder


Serve = Callable[..., TestClient]


@pytest.fixture
def api(studies: Path, serve: Serve) -> TestClient:
    return serve(discover=RUN)


def start(api: TestClient, study: str | list[str] = "visit.h5", **more: Any) -> Any:
    return api.post("/v1/discoveries", json={"study": study, "seed": 3, **more})


def follow(api: TestClient, job: str, after: int | None = None) -> list[Event]:
    """Wait until a discovery runs no more; return what it told."""
    headers = {} if after is None else {"Last-Event-ID": str(after)}
    answer = api.get(f"{job}/events", headers=headers)
    assert answer.headers["content-type"].startswith("text/event-stream")
    found = []
    for block in answer.text.split("\n\n"):
        fields = dict(line.split(": ", 1) for line in block.splitlines() if line[:1] != ":")
        if fields:
            data = json.loads(fields["data"])
            found.append(Event(int(fields["id"]), fields["event"], data))
    return found


def states(events: list[Event]) -> list[str]:
    return [event.data for event in events if event.kind == "state"]


def wait_until(api: TestClient, job: str, message: str) -> None:
    while (api.get(job).json()["progress"] or {}).get("message") != message:
        pass


def test_from_start_to_report(api: TestClient) -> None:
    started = start(api)
    assert (started.status_code, started.json()["state"]) == (202, "queued")
    job = started.headers["location"]
    told = follow(api, job)
    assert [event.number for event in told] == list(range(1, len(told) + 1))
    assert states(told) == ["queued", "running", "done"]
    steps = [event.data["message"] for event in told if event.kind == "progress"]
    assert steps == ["step 0", "step 1", "step 2"]
    assert follow(api, job, after=3) == told[3:]

    done = api.get(job).json()
    assert done["result"]["causes"] == ["speed_dependent_cutoff"]
    assert done["result"]["verdict"] == "explained"
    report = api.get(f"{job}/report")
    found = Discovery.model_validate_json(report.content)
    assert report.json()["schema"] == "discovery/1"
    assert found.extended_model.effects[0].id == "speed_dependent_cutoff"
    page = api.get(f"{job}/report.html")
    assert page.headers["content-type"].startswith("text/html")
    assert done["result"]["sentence"] in page.text
    assert api.delete(job).json()["code"] == "wrong_state"
    listed = api.get("/v1/discoveries").json()["discoveries"]
    assert [one["id"] for one in listed] == [done["id"]]


def test_one_runs_at_a_time_and_each_can_be_cancelled(api: TestClient, studies: Path) -> None:
    stepwise_discovery.allow(studies, 1)
    first = start(api).headers["location"]
    wait_until(api, first, "step 1")
    second = start(api).headers["location"]
    third = start(api, "bad.h5").headers["location"]
    assert api.get(second).json()["state"] == "queued"
    assert api.get(f"{first}/report").json()["code"] == "wrong_state"
    assert api.delete(second).status_code == 202
    assert api.delete(first).status_code == 202
    assert states(follow(api, first)) == ["queued", "running", "cancelled"]
    assert states(follow(api, second)) == ["queued", "cancelled"]
    stepwise_discovery.allow(studies, stepwise_discovery.STEPS)
    assert states(follow(api, third)) == ["queued", "running", "failed"]
    listed = api.get("/v1/discoveries").json()["discoveries"]
    assert [f"/v1/discoveries/{one['id']}" for one in listed] == [third, second, first]


def test_more_than_may_wait_are_asked_to_come_again(
    api: TestClient, studies: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(discoveries, "MOST", 2)
    stepwise_discovery.allow(studies, 1)  # until it is cancelled
    first = start(api).headers["location"]
    refused = start(api)
    assert (refused.status_code, refused.json()["code"]) == (503, "busy")
    assert "Cancel some, or ask again" in refused.json()["detail"]
    api.delete(first)
    assert states(follow(api, first))[-1] == "cancelled"


def test_failures_say_why(api: TestClient) -> None:
    bad, fatal = (start(api, name).headers["location"] for name in ("bad.h5", "fatal.h5"))
    assert states(follow(api, bad))[-1] == "failed"
    assert api.get(bad).json()["failure"] == "trial 7 has no position"
    assert states(follow(api, fatal))[-1] == "interrupted"


def test_events_end_where_the_folder_is_deleted(
    api: TestClient,
    studies: Path,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    stepwise_discovery.allow(studies, 1)
    job = start(api).headers["location"]
    wait_until(api, job, "step 1")
    store = cast(Any, api.app).state.services.discoveries.store
    told, events = queue.SimpleQueue[str](), store.events

    def events_and_tell(of: str, after: int) -> Any:
        found = events(of, after)
        told.put(of)
        return found

    monkeypatch.setattr(store, "events", events_and_tell)
    with ThreadPoolExecutor() as pool:
        followed = pool.submit(follow, api, job)
        told.get()
        shutil.rmtree(studies / "discoveries" / job.rpartition("/")[2])
        assert states(followed.result()) == ["queued", "running"]
    assert "Traceback" not in caplog.text
    assert "was deleted or moved" in api.get(job).json()["detail"]


def test_a_study_is_a_file_below_the_folder(api: TestClient, studies: Path) -> None:
    (studies.parent / "outside.h5").touch()
    answer = start(api, "missing.h5")
    assert (answer.status_code, answer.json()["code"]) == (404, "no_study")
    assert "visit.h5" in answer.json()["detail"]
    assert start(api, 200 * "\U00010437").json()["code"] == "no_study", "800 bytes of a name"
    for name in ("../outside.h5", "/etc/passwd", "a/../../outside.h5", "", ".hidden"):
        assert start(api, name).status_code == 422, name
    assert start(api, base="better").status_code == 422
    assert start(api, response="heat").status_code == 422
    assert api.get("/v1/discoveries/0-0").json()["code"] == "no_discovery"
    assert api.get("/v1/discoveries").json() == {"discoveries": []}


def test_several_studies_are_asked_about_together(api: TestClient, studies: Path) -> None:
    for names in ([], ["visit.h5"], ["visit.h5", "../outside.h5"], ["visit.h5"] * 1001):
        assert start(api, names).status_code == 422, names
    assert start(api, ["visit.h5", "missing.h5"]).json()["code"] == "no_study"
    second = "0a-1b/study.h5"
    (studies / second).parent.mkdir()
    (studies / second).touch()
    job = start(api, ["visit.h5", second]).headers["location"]
    assert states(follow(api, job))[-1] == "done"
    done = api.get(job).json()
    assert done["spec"]["study"] == ["visit.h5", second]
    assert done["result"]["verdict"] is None
    found = AcrossStudies.model_validate_json(api.get(f"{job}/report").content)
    assert [study.name for study in found.studies] == ["visit", "study"]
    assert found.sentence in api.get(f"{job}/report.html").text


def test_studies_are_listed_as_discoveries_name_them(api: TestClient, studies: Path) -> None:
    (studies / "visit.h5").write_bytes(b"12345")
    os.utime(studies / "visit.h5", (2e9, 2e9))
    (studies / "0a-1b").mkdir()
    (studies / "0a-1b" / "study.h5").touch()
    (studies / "notes.txt").touch()
    (studies / "no name for it.h5").touch()
    (studies / "discoveries" / "1-2" / "study.h5").mkdir(parents=True)
    listed = api.get("/v1/studies").json()["studies"]
    assert {one["name"] for one in listed} == {*STUDIES, "0a-1b/study.h5"}
    assert listed[0] == {
        "name": "visit.h5",
        "bytes": 5,
        "modified_utc": "2033-05-18T03:33:20+00:00",
    }


def test_no_folder_no_studies(serve: Serve) -> None:
    assert serve().get("/v1/studies").json() == {"studies": []}


@pytest.mark.skipif(sys.platform == "win32", reason="links need a privilege there")
def test_a_link_out_of_the_folder_is_not_followed(api: TestClient, studies: Path) -> None:
    (studies.parent / "outside.h5").touch()
    (studies / "link.h5").symlink_to(studies.parent / "outside.h5")
    assert start(api, "link.h5").json()["code"] == "no_study"
    listed = api.get("/v1/studies").json()["studies"]
    assert {one["name"] for one in listed} == set(STUDIES)


@pytest.mark.parametrize("torn", [b"", b'{"id": "2026', b"\0" * 400, b"[" * 100_000])
def test_a_torn_job_is_set_aside_and_the_rest_served(
    studies: Path, serve: Serve, caplog: pytest.LogCaptureFixture, torn: bytes
) -> None:
    shelf = DiscoveryStore(studies)
    whole, lost = (shelf.create(DiscoverySpec(study="visit.h5"), by="me") for _ in range(2))
    job = studies / "discoveries" / lost.id / "job.json"
    job.write_bytes(torn)
    api = serve(discover=RUN)
    listed = api.get("/v1/discoveries").json()["discoveries"]
    assert [one["id"] for one in listed] == [whole.id]
    assert api.get(f"/v1/discoveries/{whole.id}").json()["state"] == "interrupted"
    assert api.get(f"/v1/discoveries/{lost.id}").json()["code"] == "no_discovery"
    assert job.with_name("job.json.damaged").read_bytes() == torn
    assert not job.exists()
    assert "job.json.damaged" in caplog.text


def test_a_job_of_another_version_is_left_to_it(
    studies: Path, caplog: pytest.LogCaptureFixture
) -> None:
    shelf = DiscoveryStore(studies)
    newer, whole = (shelf.create(DiscoverySpec(study="visit.h5"), by="me") for _ in range(2))
    job = studies / "discoveries" / newer.id / "job.json"
    content = job.read_bytes().replace(b"{", b'{"added": 1, ', 1)
    job.write_bytes(content)
    for _ in range(3):
        assert [one.id for one in shelf.all()] == [whole.id]
    assert job.read_bytes() == content
    assert caplog.text.count("another version of frictus wrote it") == 1


def test_an_api_that_ends_leaves_interrupted_ones(
    router: str, tmp_path: Path, studies: Path
) -> None:
    stepwise_discovery.allow(studies, 1)
    config = configuration(router, tmp_path / "textures")
    base = "http://127.0.0.1:8420"
    with TestClient(build_app(config, discover=RUN), base_url=base) as api:
        running, waiting = (start(api).headers["location"] for _ in range(2))
        wait_until(api, running, "step 1")
    shelf = DiscoveryStore(studies)
    lost = shelf.create(DiscoverySpec(study="visit.h5"), by="a process that was killed")
    events = studies / "discoveries" / lost.id / "events.jsonl"
    events.write_bytes(events.read_bytes() + b'{"number": 2, "ki')  # in the middle of a word
    with TestClient(build_app(config, discover=RUN), base_url=base) as api:
        for job in (running, waiting, f"/v1/discoveries/{lost.id}"):
            assert api.get(job).json()["state"] == "interrupted"
        assert states(follow(api, f"/v1/discoveries/{lost.id}")) == ["queued", "interrupted"]


def test_of_a_discovery_that_the_disk_does_not_take_nothing_stays(
    api: TestClient, studies: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(path: Path, content: bytes) -> None:
        raise OSError(errno.ENOSPC, "No space left on device", str(path))

    with monkeypatch.context() as disk:
        disk.setattr(job_folder, "replace_file", full)
        answer = start(api)
    assert (answer.status_code, answer.json()["code"]) == (507, "not_stored")
    assert list((studies / "discoveries").iterdir()) == []
    assert start(api).status_code == 202


def test_a_state_that_the_disk_does_not_take_is_not_told(studies: Path) -> None:
    """It was tried once a second, and told each time: `failed` six times in 20 s."""
    shelf = DiscoveryStore(studies)
    job = shelf.create(DiscoverySpec(study="visit.h5"), "ann").id
    for _ in range(3):
        with full_after(200), pytest.raises(OSError, match="too large"):
            shelf.change(job, "running", of=("queued",))
    assert [event.data for event in shelf.events(job, 0)] == ['"queued"']
    shelf.change(job, "running", of=("queued",))
    told = [(event.number, event.data) for event in shelf.events(job, 0)]
    assert told == [(1, '"queued"'), (2, '"running"')]

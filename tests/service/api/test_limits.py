"""What one client may cost: time, memory, connections, requests."""

import asyncio
import json
import logging
import socket
import sys
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import anyio
import pytest
from fastapi.testclient import TestClient
from tests.service.api.test_server import configuration, get
from uvicorn.protocols.http.h11_impl import H11Protocol

from frictus_service.api import error_handlers, limits, requests, uploads
from frictus_service.api.problems import BusyError, GoneError
from frictus_service.api.server import run_api
from frictus_service.api.services import RigConnection
from frictus_service.config import Config
from frictus_service.processes import free_port

HALF_BODY = (
    b"POST /v1/calibrations HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: application/json\r\n"
    b'Content-Length: 1000\r\n\r\n{"a":'
)


@contextmanager
def serving(config: Config) -> Iterator[int]:
    stop, ready = threading.Event(), threading.Event()
    thread = threading.Thread(target=run_api, args=(config, stop, ready))
    thread.start()
    assert ready.wait(20.0)
    yield config.api.port
    stop.set()
    thread.join(20.0)
    assert not thread.is_alive()


@pytest.fixture
def port(router: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """A real server that is quickly impatient."""
    monkeypatch.setattr(limits, "HEAD_S", 0.5)
    monkeypatch.setattr(limits, "TAKE_S", 0.5)
    monkeypatch.setattr(requests, "BODY_S", 0.5)
    with serving(configuration(router, tmp_path, free_port())) as port:
        yield port


def connected(port: int, sent: bytes) -> socket.socket:
    opened = socket.create_connection(("127.0.0.1", port), timeout=30.0)
    opened.sendall(sent)
    return opened


def all_of(opened: socket.socket) -> bytes:
    """Return what comes until the connection ends."""
    received = b""
    try:
        while more := opened.recv(1 << 16):
            received += more
    except ConnectionResetError:
        pass
    return received


def test_one_address_has_half_of_the_connections(router: str, tmp_path: Path) -> None:
    port = free_port()
    config = configuration(router, tmp_path, port)
    few = config.api.model_copy(update={"max_connections": 10})
    with serving(config.model_copy(update={"api": few})), ExitStack() as opened:
        for _ in range(5):
            opened.enter_context(connected(port, b""))
        told = all_of(opened.enter_context(connected(port, b"")))
    assert told.startswith(b"HTTP/1.1 503")
    head, _, text = told.partition(b"\r\n\r\n")
    assert f"Content-Length: {len(text)}".encode() in head.split(b"\r\n")


@pytest.mark.parametrize(
    "sent", [b"", b"GET /v1/hea", b"GET /v1/health HTTP/1.1\r\nHost: 127.0.0.1\r\nA"]
)
def test_heads_that_do_not_come_end_their_connections(port: int, sent: bytes) -> None:
    with ExitStack() as opened:
        many = [opened.enter_context(connected(port, sent)) for _ in range(50)]
        assert {all_of(one) for one in many} == {b""}
    assert get(port, "/v1/health")[0] == 200


def test_a_half_head_after_an_answer_ends_its_connection(port: int) -> None:
    whole = b"GET /v1/health HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"
    with connected(port, whole + b"GET /v1/hea") as opened:
        assert all_of(opened).startswith(b"HTTP/1.1 200")


def test_a_body_that_does_not_come_is_told_so(port: int) -> None:
    with connected(port, HALF_BODY) as opened:
        answer = all_of(opened)
    assert answer.startswith(b"HTTP/1.1 408")
    assert json.loads(answer.partition(b"\r\n\r\n")[2])["code"] == "slow_body"


def put_study(length: int, *begun: bytes) -> bytes:
    """Return a request that announces a study of this length, and how it begins."""
    head = (
        "PUT /v1/studies/visit.h5 HTTP/1.1\r\nHost: 127.0.0.1\r\n"
        f"Content-Type: application/x-hdf5\r\nContent-Length: {length}\r\n\r\n"
    )
    return head.encode() + b"".join(begun)


@pytest.mark.parametrize("begun", [b"", b"\x89HDF" * 1_000])
def test_a_study_that_does_not_come_holds_no_place(
    port: int, begun: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(uploads, "BODY_S", 0.3)
    with connected(port, put_study(uploads.MAX_STUDY_BYTES, begun)) as opened:
        answer = all_of(opened)
    assert answer.startswith(b"HTTP/1.1 408")
    assert b"without a pause of 0.3 s" in answer
    assert list((tmp_path / "studies").iterdir()) == []


def test_a_study_that_is_announced_as_too_large_is_refused_before_it_comes(port: int) -> None:
    for length in (uploads.MAX_STUDY_BYTES + 1, 10**19):
        with connected(port, put_study(length)) as opened:
            assert all_of(opened).startswith(b"HTTP/1.1 413")


def test_who_leaves_within_a_body_leaves_no_fault(
    port: int, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    left = threading.Semaphore(0)

    def gone(text: str) -> GoneError:
        left.release()
        return GoneError(text)

    monkeypatch.setattr(requests, "GoneError", gone)
    monkeypatch.setattr(requests, "BODY_S", 60.0)
    with ExitStack() as opened:
        for _ in range(20):
            opened.enter_context(connected(port, HALF_BODY))
        assert get(port, "/v1/health")[0] == 200
    for _ in range(20):
        assert left.acquire(timeout=20.0)
    assert get(port, "/v1/health")[0] == 200
    assert [one for one in caplog.records if one.levelno >= logging.ERROR] == []


def test_who_leaves_within_a_study_leaves_nothing_of_it(
    port: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    left, unlink = threading.Event(), Path.unlink

    def noted(path: Path, missing_ok: bool = False) -> None:
        unlink(path, missing_ok)
        left.set()

    monkeypatch.setattr(Path, "unlink", noted)
    with connected(port, put_study(10_000, b"half of it")):
        pass
    assert left.wait(20.0)
    assert list((tmp_path / "studies").iterdir()) == []


def test_who_does_not_take_its_answers_is_cut(
    port: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    cut = threading.Event()
    lost = limits.PatientProtocol.connection_lost

    def noted(self: limits.PatientProtocol, error: Exception | None) -> None:
        cut.set()
        lost(self, error)

    monkeypatch.setattr(limits.PatientProtocol, "connection_lost", noted)
    asked = b"GET /openapi.json HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n" * 400
    with connected(port, asked):  # and nothing is read
        assert cut.wait(30.0)
    assert get(port, "/v1/health")[0] == 200


def test_nothing_is_done_for_who_does_not_take_its_answers(
    port: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun, completed = [], []
    cut = threading.Event()
    allows = limits.Rate._allows

    def begin(self: limits.Rate, client: str) -> bool:
        begun.append(client)
        return allows(self, client)

    monkeypatch.setattr(limits.Rate, "_allows", begin)
    complete = H11Protocol.on_response_complete

    def note_complete(self: H11Protocol) -> None:
        completed.append(self)
        complete(self)

    lost = limits.PatientProtocol.connection_lost

    def note_lost(self: limits.PatientProtocol, error: Exception | None) -> None:
        cut.set()
        lost(self, error)

    monkeypatch.setattr(H11Protocol, "on_response_complete", note_complete)
    monkeypatch.setattr(limits.PatientProtocol, "connection_lost", note_lost)
    asked = b"GET /openapi.json HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n" * 400
    with connected(port, asked):
        assert cut.wait(30.0)
    assert len(begun) == len(completed)  # the next has not been begun
    assert len(begun) < 20  # of 170 kB each


def test_who_takes_its_answers_late_gets_all(
    port: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(limits, "TAKE_S", 60.0)
    monkeypatch.setattr(limits, "HEAD_S", 60.0)
    full = threading.Event()
    pause = limits.PatientProtocol.pause_writing

    def noted(self: limits.PatientProtocol) -> None:
        pause(self)
        full.set()

    monkeypatch.setattr(limits.PatientProtocol, "pause_writing", noted)
    head = b"GET /openapi.json HTTP/1.1\r\nHost: 127.0.0.1\r\n"
    asked = (head + b"\r\n") * 99 + head + b"Connection: close\r\n\r\n"
    with connected(port, asked) as opened:
        assert full.wait(30.0)
        answers = all_of(opened)
    assert answers.count(b"HTTP/1.1 200 OK") == 100
    assert answers.endswith(get(port, "/openapi.json")[1].encode())


def test_health_does_not_wait_for_a_thread(port: int, monkeypatch: pytest.MonkeyPatch) -> None:
    waiting, released = threading.Semaphore(0), threading.Event()

    def names(_: RigConnection) -> list[str]:
        waiting.release()
        assert released.wait(60.0)
        return []

    monkeypatch.setattr(RigConnection, "names", names)
    asked = b"GET /v1/rigs HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n\r\n"
    with ExitStack() as opened:
        many = [opened.enter_context(connected(port, asked)) for _ in range(60)]
        for _ in range(40):  # as many as there are threads
            assert waiting.acquire(timeout=20.0)
        assert get(port, "/v1/health")[0] == 200
        released.set()
        assert {all_of(one)[:12] for one in many} == {b"HTTP/1.1 200"}


@pytest.mark.parametrize(
    "body",
    [
        b"[" + b"[]," * 3_300_000 + b"[]]",
        b"[" * 10_000_000,
        b'{"kind":"profile","friction_n":[' + b"0," * 4_000_000 + b"0]}",
    ],
    ids=["lists", "depth", "values"],
)
def test_what_would_fill_the_memory_is_not_parsed(
    api: TestClient, body: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(requests, "from_json", lambda _: pytest.fail("it was parsed"))
    said = put(api, body)
    assert said.status_code in (413, 422)
    assert said.json()["code"] in ("too_large", "bad_request")


def test_of_a_list_of_faults_the_first_is_named(api: TestClient) -> None:
    text = b'{"kind":"profile","friction_n":[' + b'"",' * 60_000 + b'""]}'
    said = put(api, text)
    assert said.status_code == 422
    assert len(said.json()["errors"]) == 1


def test_more_faults_than_a_list_should_have_are_counted(
    api: TestClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(requests, "MAX_FAULTS", 2)
    component = b'{"amplitude_n":-1,"cycles_per_mm":-1,"phase_rad":"x"}'
    said = put(api, b'{"kind":"spectrum","components":[' + component + b"]}")
    assert said.status_code == 422
    assert "errors" not in said.json()
    assert "3" in said.json()["detail"]


@pytest.mark.parametrize(
    "number", ["1e999", "1E+0400", "9" * 400, "NaN", "-Infinity", "9" * 250 + "e99"]
)
def test_no_number_that_is_not_finite_slips_through(api: TestClient, number: str) -> None:
    document = '{"kind":"profile","friction_n":[0.0,NUMBER],"period_mm":1.0}'
    assert put(api, document.replace("NUMBER", "0.1").encode()).status_code == 201
    said = put(api, document.replace("NUMBER", number).encode())
    assert said.status_code == 422


def put(api: TestClient, body: bytes) -> Any:
    headers = {"Content-Type": "application/json", "If-None-Match": "*"}
    return api.put("/v1/textures/new", content=body, headers=headers)


def test_a_command_is_smaller_than_a_scene(api: TestClient) -> None:
    headers = {"Content-Type": "application/json"}
    said = api.post("/v1/calibrations", content=b" " * 300_000, headers=headers)
    assert (said.status_code, said.json()["code"]) == (413, "too_large")


def test_places_are_given_back() -> None:
    places = limits.Places(3, "streams")
    with places.held("a", 2):
        with pytest.raises(BusyError, match="at most 3 streams"), places.held("b", 2):
            pass
        with places.held("b"):
            pass
    with places.held("a", 3):  # all of them: what is larger than half can be held, too
        pass


def test_nobody_holds_more_than_half_of_the_places() -> None:
    places = limits.Places(4, "streams")
    with places.held("a"), places.held("a"):
        with pytest.raises(BusyError, match="you hold 2 of the 4 streams"), places.held("a"):
            pass
        with places.held("b"), places.held("b"):
            pass


def test_threads_that_hold_places_at_once_leave_none_behind() -> None:
    places = limits.Places(64, "streams")

    def hold(holder: str) -> None:
        for _ in range(2_000):
            with places.held(holder):
                pass

    switch_s = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        with ThreadPoolExecutor(4) as threads:
            for done in [threads.submit(hold, f"h{n}") for n in range(4)]:
                done.result(60.0)
    finally:
        sys.setswitchinterval(switch_s)
    with places.held("one", 64):
        pass


def test_no_more_streams_of_events_than_there_are_places(
    api: TestClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(api.app.state.limits, "streams", limits.Places(0, "streams"))  # type: ignore[attr-defined]
    said = api.get("/v1/discoveries/0/events")
    assert (said.status_code, said.json()["code"]) == (503, "busy")


def test_who_leaves_a_stream_of_events_leaves_no_fault() -> None:
    async def left(_scope: Any, _receive: Any, _send: Any) -> None:
        raise ExceptionGroup("", [anyio.BrokenResourceError()])

    async def failed(_scope: Any, _receive: Any, _send: Any) -> None:
        raise ExceptionGroup("", [anyio.BrokenResourceError(), ValueError()])

    scope = {"type": "http", "path": "/v1/discoveries/0/events"}
    asyncio.run(error_handlers.Departures(left)(scope, None, None))  # type: ignore[arg-type]
    with pytest.raises(ExceptionGroup) as raised:
        asyncio.run(error_handlers.Departures(failed)(scope, None, None))  # type: ignore[arg-type]
    assert raised.value.subgroup(ValueError) is not None
    assert raised.value.subgroup(anyio.BrokenResourceError) is None


def test_a_client_asks_as_often_as_it_may() -> None:
    now_s = 100.0
    passed: list[str] = []

    async def app(scope: Any, _receive: Any, _send: Any) -> None:
        passed.append(scope["client"][0])

    async def send(message: Any) -> None:
        if message["type"] == "http.response.start":
            assert message["status"] == 429
            assert (b"retry-after", b"1") in message["headers"]

    rate = limits.Rate(app, 10.0, lambda: now_s)

    def ask(client: str, times: int) -> int:
        passed.clear()
        scope = {"type": "http", "client": (client, 1), "path": "/", "method": "GET"}
        for _ in range(times):
            asyncio.run(rate(scope, None, send))  # type: ignore[arg-type]
        return passed.count(client)

    assert ask("a", 50) == 20
    assert ask("b", 5) == 5
    now_s += 1.0
    assert ask("a", 50) == 10
    now_s += 100.0
    assert ask("a", 50) == 20


def test_one_connection_is_read_at_its_pace() -> None:
    now_s = 100.0
    pace = limits.Pace(10.0, 20.0, lambda: now_s)
    assert [pace.wait_s(1.0) for _ in range(20)] == [0.0] * 20
    assert pace.wait_s(5.0) == pytest.approx(0.5)
    now_s += 0.5
    assert pace.wait_s(1.0) == pytest.approx(0.1)
    now_s += 1_000.0
    assert pace.wait_s(20.0) == 0.0  # no more than a burst is saved up
    assert pace.wait_s(1.0) == pytest.approx(0.1)


@pytest.mark.parametrize(
    "sent",
    [
        b"GET /v1/rigs HTTP/1.1\r\n\r\n",  # no host
        b"GET /v1/rigs HTTP/1.1\r\nHost: 127.0.0.1\r\nHost: 127.0.0.1\r\n\r\n",
        b"GET /v1/rigs\r\n\r\n",
        b"\x16\x03\x01\x02\x00\x01\x00\r\n\r\n",  # TLS
        b"PUT /v1/textures/x HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: -1\r\n\r\n",
    ],
)
def test_what_is_not_http_is_refused_as_all_else_is(port: int, sent: bytes) -> None:
    with connected(port, sent) as opened:
        head, _, body = all_of(opened).partition(b"\r\n\r\n")
    assert head.startswith(b"HTTP/1.1 400 ")
    assert b"application/problem+json" in head
    assert json.loads(body)["code"] == "bad_http"


@pytest.mark.parametrize("coding", ["gzip", "deflate", "br"])
def test_a_packed_body_is_refused_for_being_packed(api: TestClient, coding: str) -> None:
    headers = {"Content-Encoding": coding, "Content-Type": "application/json", "If-Match": "*"}
    told = api.put("/v1/textures/packed", content=b"\x1f\x8b", headers=headers)
    assert told.status_code == 415
    assert told.headers["accept-encoding"] == "identity"
    assert f"Content-Encoding {coding}" in told.json()["detail"]

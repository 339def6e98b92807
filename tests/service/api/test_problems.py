"""Every error is a problem document of the one taxonomy."""

import json
import re
import socket
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from frictus.session import open_router
from frictus_service.api import problems
from frictus_service.config import Limits


def kinds(base: type[problems.ApiError] = problems.ApiError) -> Iterator[Any]:
    for kind in base.__subclasses__():
        yield kind
        yield from kinds(kind)


def check(answer: Any) -> None:
    assert answer.headers["content-type"] == "application/problem+json"
    said = answer.json()
    assert said["status"] == answer.status_code
    assert said["type"] == f"urn:frictus:problem:{said['code']}"
    assert said["title"]
    assert said["detail"]
    assert said["instance"].startswith("/")
    assert set(said) <= {"type", "title", "status", "code", "detail", "instance", "errors"}
    assert (said["status"], said["code"]) in {(kind.status, kind.code) for kind in kinds()}


def test_each_kind_owns_a_status_and_a_word_of_its_own() -> None:
    codes = [kind.code for kind in kinds()]
    assert len(set(codes)) == len(codes)
    for kind in kinds():
        assert 400 <= kind.status < 600
        assert re.fullmatch("[a-z_]+", kind.code)


def test_paths_and_methods(api: TestClient) -> None:
    for path in ("/none", "/v1", "/v2/rigs", "/v1/rigs/a/b/c"):
        answer = api.get(path)
        assert answer.status_code == 404
        check(answer)
    for method, path in (
        ("DELETE", "/v1/rigs"),
        ("PATCH", "/v1/textures/x"),
        ("PUT", "/metrics"),
    ):
        answer = api.request(method, path)
        assert answer.status_code == 405
        assert answer.headers["allow"]
        check(answer)


def test_unexpected_fault_is_a_problem_and_says_nothing_of_the_inside(
    api: TestClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(_: object) -> None:
        raise RuntimeError("secret path /root")

    monkeypatch.setattr("frictus_service.library.TextureLibrary.names", broken)
    answer = api.get("/v1/textures")
    assert answer.status_code == 500
    assert "secret" not in answer.text
    check(answer)


def test_body_limit_counts_bytes_not_promises(serve: Any, rig: Any) -> None:
    api = serve(limits=Limits(max_scene_bytes=1_024))
    headers = {"Content-Type": "application/json", "If-Match": "*"}
    path = f"/v1/rigs/{rig.name}/scene"
    for content in (b" " * 1_025, iter([b" " * 700, b" " * 700])):  # the second is chunked
        answer = api.put(path, content=content, headers=headers)
        assert answer.status_code == 413
        check(answer)
    fits = b'{"regions":[]}'.ljust(1_024)
    assert api.put(path, content=fits, headers=headers).status_code == 200


@pytest.mark.parametrize(
    "body",
    [b"", b"{", b"[" * 100_000, b"\xff\xfe", b"null", b"[]", b'"scene"', b'{"regions":{}}'],
)
def test_garbage_bodies(api: TestClient, rig: Any, body: bytes) -> None:
    headers = {"Content-Type": "application/json", "If-Match": "*"}
    for what in ("scene", "model"):
        answer = api.put(f"/v1/rigs/{rig.name}/{what}", content=body, headers=headers)
        assert answer.status_code == 422
        check(answer)
    assert not rig.calls


def test_a_hundred_thousand_components_are_refused(api: TestClient, rig: Any) -> None:
    component = '{"amplitude_n":1,"hz":9},'
    many = component * 100_000 + component[:-1]
    body = f'{{"regions":[{{"texture":{{"kind":"spectrum","components":[{many}]}}}}]}}'
    headers = {"Content-Type": "application/json", "If-Match": "*"}
    answer = api.put(f"/v1/rigs/{rig.name}/scene", content=body, headers=headers)
    assert answer.status_code == 422
    check(answer)


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: (
        st.lists(inner, max_size=4)
        | st.dictionaries(
            st.sampled_from(["regions", "texture", "kind", "components", "hz", "base", "x"]),
            inner,
            max_size=4,
        )
    ),
    max_leaves=12,
)


@settings(
    max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(document=JSON)
def test_any_json_is_taken_or_refused(api: TestClient, rig: Any, document: object) -> None:
    text = json.dumps(document)  # with NaN and Infinity
    headers = {"Content-Type": "application/json", "If-Match": "*"}
    for path in (f"/v1/rigs/{rig.name}/scene", "/v1/textures/fuzzed"):
        answer = api.put(path, content=text, headers=headers)
        assert answer.status_code in (200, 412, 422)
        if answer.status_code != 200:
            check(answer)


@settings(
    max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(tag=st.text(st.characters(min_codepoint=32, max_codepoint=126), max_size=30))
def test_any_etag_header_is_taken_or_refused(api: TestClient, rig: Any, tag: str) -> None:
    path = f"/v1/rigs/{rig.name}/scene"
    answer = api.get(path, headers={"If-None-Match": tag})
    assert answer.status_code in (200, 304, 422)
    answer = api.put(path, json={"regions": []}, headers={"If-Match": tag})
    assert answer.status_code in (200, 412, 422)


def test_no_router_is_503(serve: Any) -> None:
    api = serve(endpoint="tcp/127.0.0.1:1")
    assert api.get("/v1/health").status_code == 200
    for path in ("/v1/ready", "/v1/rigs", "/v1/rigs/x"):
        answer = api.get(path)
        assert answer.status_code == 503
        assert answer.json()["code"] == "no_link"
        check(answer)
    assert "frictus_router_linked 0.0" in api.get("/metrics").text


def test_follows_a_router_that_comes_late_and_goes(serve: Any) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        endpoint = f"tcp/127.0.0.1:{server.getsockname()[1]}"
    api = serve(endpoint=endpoint)

    def until(status: int) -> None:
        deadline_s = time.monotonic() + 20.0
        while api.get("/v1/ready").status_code != status:
            assert time.monotonic() < deadline_s, f"never {status}"

    until(503)
    for _ in range(2):
        with open_router(endpoint):
            until(200)
        until(503)


def test_openapi_lists_the_problems(api: TestClient) -> None:
    page = api.get("/openapi.json").json()
    problem = {"$ref": "#/components/schemas/Problem"}
    assert "detail" in page["components"]["schemas"]["Problem"]["properties"]
    for path, operations in page["paths"].items():
        for method, operation in operations.items():
            errors = {s: r for s, r in operation["responses"].items() if s >= "400"}
            if path not in ("/v1/health",):
                assert "500" in errors, (method, path)
            for said in errors.values():
                assert said["content"]["application/problem+json"]["schema"] == problem
    put = page["paths"]["/v1/rigs/{rig}/scene"]["put"]
    assert {"401", "403", "404", "409", "412", "413", "415", "422", "428", "503"} <= set(
        put["responses"]
    )
    text = str(page)
    for name in set(re.findall(r"#/components/schemas/(\w+)", text)):
        assert name in page["components"]["schemas"], name


def test_the_manual_has_every_error() -> None:
    manual = Path(__file__).parents[3] / "docs" / "rest.md"
    rows = re.findall(r"^\| (\d{3}) \| `(\w+)` \|", manual.read_text("utf-8"), re.MULTILINE)
    assert sorted(rows) == sorted((str(kind.status), kind.code) for kind in kinds())


@pytest.mark.parametrize("bad", ["VISIT", "a" * 65, "%E2%80%AE20261130"])
@pytest.mark.parametrize("plural", ["calibrations", "discoveries", "experiments"])
def test_an_id_that_is_none_is_refused_in_words(plural: str, bad: str, api: TestClient) -> None:
    paths = [("GET", ""), ("DELETE", ""), ("GET", "/events")]
    for method, path in paths + [("POST", "/pause")] * (plural == "experiments"):
        answer = api.request(method, f"/v1/{plural}/{bad}{path}")
        check(answer)
        assert answer.json()["code"] == "bad_request"
        (fault,) = answer.json()["errors"]
        assert fault["what"].startswith("1 to 64 digits, letters a to f and '-' are accepted")

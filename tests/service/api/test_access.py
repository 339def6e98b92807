"""Tokens, scopes, and what a web page may not do."""

from typing import Any

import pytest
from fastapi.testclient import TestClient

from frictus_service.api.access import is_loopback

TOKENS = {
    scope: f"the-{scope}-token-of-a-test" for scope in ("read", "render", "calibrate", "admin")
}
NEEDS = [
    ("GET", "/v1/rigs", "read"),
    ("GET", "/v1/rigs/{rig}", "read"),
    ("GET", "/v1/rigs/{rig}/time", "read"),
    ("GET", "/v1/rigs/{rig}/scene", "read"),
    ("GET", "/v1/rigs/{rig}/applied", "read"),
    ("GET", "/v1/rigs/{rig}/model", "read"),
    ("GET", "/v1/rigs/{rig}/compensation", "read"),
    ("GET", "/v1/rigs/{rig}/adaptation", "read"),
    ("GET", "/v1/rigs/{rig}/estimate", "read"),
    ("POST", "/v1/rigs/{rig}/estimate/publish", "calibrate"),
    ("PUT", "/v1/rigs/{rig}/scene", "render"),
    ("PUT", "/v1/rigs/{rig}/compensation", "render"),
    ("PUT", "/v1/rigs/{rig}/model", "calibrate"),
    ("PUT", "/v1/rigs/{rig}/adaptation", "calibrate"),
    ("POST", "/v1/rigs/{rig}/stop", "read"),
    ("POST", "/v1/rigs/{rig}/reset", "admin"),
    ("POST", "/v1/rigs/{rig}/recordings", "calibrate"),
    ("GET", "/v1/rigs/{rig}/recording", "read"),
    ("POST", "/v1/rigs/{rig}/recording/stop", "calibrate"),
    ("GET", "/v1/recordings", "read"),
    ("GET", "/v1/recordings/{name}/recording.mcap", "read"),
    ("GET", "/v1/recordings/{name}/course", "read"),
    ("GET", "/v1/recordings/{name}/export/{to}", "read"),
    ("GET", "/v1/textures", "read"),
    ("GET", "/v1/textures/x", "read"),
    ("PUT", "/v1/textures/x", "render"),
    ("DELETE", "/v1/textures/x", "render"),
    ("POST", "/v1/preview", "read"),
    ("GET", "/v1/models", "read"),
    ("POST", "/v1/models", "calibrate"),
    ("GET", "/v1/models/compare", "read"),
    ("GET", "/v1/models/{reference}", "read"),
    ("GET", "/v1/models/{reference}/model.json", "read"),
    ("GET", "/v1/models/{reference}/model.mat", "read"),
    ("GET", "/v1/models/{name}/audit", "read"),
    ("GET", "/v1/models/{name}/aliases", "read"),
    ("GET", "/v1/models/{name}/aliases/{alias}", "read"),
    ("PUT", "/v1/models/{name}/aliases/{alias}", "admin"),
    ("POST", "/v1/rigs/{rig}/model/activate", "calibrate"),
    ("GET", "/v1/calibrations", "read"),
    ("POST", "/v1/calibrations", "calibrate"),
    ("GET", "/v1/calibrations/{calibration}", "read"),
    ("GET", "/v1/calibrations/{calibration}/events", "read"),
    ("DELETE", "/v1/calibrations/{calibration}", "calibrate"),
    ("POST", "/v1/calibrations/{calibration}/resume", "calibrate"),
    ("POST", "/v1/calibrations/{calibration}/publish", "calibrate"),
    ("GET", "/v1/studies", "read"),
    ("PUT", "/v1/studies/x", "calibrate"),
    ("GET", "/v1/discoveries", "read"),
    ("POST", "/v1/discoveries", "calibrate"),
    ("GET", "/v1/discoveries/{discovery}", "read"),
    ("GET", "/v1/discoveries/{discovery}/events", "read"),
    ("GET", "/v1/discoveries/{discovery}/report", "read"),
    ("GET", "/v1/discoveries/{discovery}/report.html", "read"),
    ("DELETE", "/v1/discoveries/{discovery}", "calibrate"),
    ("GET", "/v1/experiments", "read"),
    ("POST", "/v1/experiments", "calibrate"),
    ("GET", "/v1/experiments/{experiment}", "read"),
    ("GET", "/v1/experiments/{experiment}/events", "read"),
    ("GET", "/v1/experiments/{experiment}/report", "calibrate"),
    ("GET", "/v1/experiments/{experiment}/events.tsv", "calibrate"),
    ("POST", "/v1/experiments/{experiment}/answers", "render"),
    ("POST", "/v1/experiments/{experiment}/pause", "calibrate"),
    ("POST", "/v1/experiments/{experiment}/resume", "calibrate"),
    ("DELETE", "/v1/experiments/{experiment}", "calibrate"),
    ("GET", "/metrics", "read"),
]
OPEN = {"/v1/health", "/v1/ready"}


@pytest.fixture
def guarded(serve: Any) -> TestClient:
    client: TestClient = serve(tokens=True)
    return client


def test_the_table_has_every_path(guarded: TestClient) -> None:
    paths = guarded.get("/openapi.json").json()["paths"]
    served = {(m.upper(), p) for p, methods in paths.items() for m in methods if p not in OPEN}
    assert served == {(method, path.replace("/x", "/{name}")) for method, path, _ in NEEDS}


@pytest.mark.parametrize(("method", "path", "scope"), NEEDS)
def test_scopes(guarded: TestClient, rig: Any, method: str, path: str, scope: str) -> None:
    names = {"reference": "x", "name": "x", "alias": "production", "to": "hdf5"}
    jobs = dict.fromkeys(("calibration", "discovery", "experiment"), "0")
    url = path.format(rig=rig.name, **jobs, **names)
    missing = guarded.request(method, url)
    assert missing.status_code == 401
    assert missing.headers["www-authenticate"].startswith("Bearer")
    for header in ("Bearer not-a-token-of-ours", "Basic dXNlcjpwdw==", "Bearer", "Bearer \xe4"):
        answer = guarded.request(
            method, url, headers={b"Authorization": header.encode("latin-1")}
        )
        assert answer.status_code == 401, header
        assert answer.json()["code"] == "unauthenticated"
    for held, token in TOKENS.items():
        answer = guarded.request(method, url, headers={"Authorization": f"Bearer {token}"})
        if held == scope:
            assert answer.status_code not in (401, 403)
        else:
            assert answer.status_code == 403
            assert repr(scope) in answer.json()["detail"]
            assert f'scope="{scope}"' in answer.headers["www-authenticate"]


def test_health_needs_no_token(guarded: TestClient, rig: Any) -> None:
    assert guarded.get("/v1/health").json() == {"alive": True}
    assert guarded.get("/v1/ready").json() == {
        "ready": True,
        "site": "lab",
        "rigs": 1,
        "registry": True,
    }


def test_a_body_without_a_token_is_not_read(guarded: TestClient, rig: Any) -> None:
    answer = guarded.put(f"/v1/rigs/{rig.name}/scene", content=b"x" * 20_000_000)
    assert answer.status_code == 401


@pytest.mark.parametrize("host", ["evil.example", "evil.example:8420", "10.0.0.1", "", "[::1"])
def test_other_hosts_are_refused(api: TestClient, host: str) -> None:
    answer = api.get("/v1/rigs", headers={"Host": host})
    assert answer.status_code == 421
    assert answer.headers["content-type"] == "application/problem+json"
    assert answer.json()["code"] == "wrong_host"


@pytest.mark.parametrize("host", ["localhost", "localhost:1", "127.0.0.1", "[::1]:8420"])
def test_loopback_hosts_are_served(api: TestClient, host: str) -> None:
    assert api.get("/v1/health", headers={"Host": host}).status_code == 200


def test_other_origins_change_nothing(api: TestClient, rig: Any) -> None:
    url = f"/v1/rigs/{rig.name}/reset"
    for origin in ("https://evil.example", "null", "http://127.0.0.1:9"):
        answer = api.post(url, headers={"Origin": origin})
        assert answer.status_code == 403
        assert answer.json()["code"] == "cross_origin"
    assert not rig.calls
    assert api.post(url, headers={"Origin": "http://127.0.0.1:8420"}).status_code == 200


def test_loopback_names() -> None:
    assert all(is_loopback(name) for name in ("localhost", "127.0.0.1", "127.9.9.9", "::1"))
    assert not any(is_loopback(name) for name in ("0.0.0.0", "::", "", "localhost.evil", "1"))

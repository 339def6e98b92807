"""The reference states what the API demands, so that requests can be drawn from it."""

import re
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest
from fastapi import FastAPI
from fastapi.testclient import TestClient
from tests.service.api.conftest import FakeRig

import frictus_service.api.server as application

REFERENCE = "/v1/models/{reference}"


@pytest.fixture
def page(api: TestClient) -> Any:
    return api.get("/openapi.json").json()


def test_it_is_encoded_once(api: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    first = api.get("/openapi.json")
    assert first.headers["content-type"] == "application/json"
    monkeypatch.setattr(application, "_encoded", lambda _: pytest.fail("encoded again"))
    assert api.get("/openapi.json").json() == first.json()


def test_many_who_ask_first_wait_for_one_encoding(
    api: TestClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    encode = application._encoded
    begun = []

    def noted(app: FastAPI) -> bytes:
        begun.append(app)
        return encode(app)

    monkeypatch.setattr(application, "_encoded", noted)
    with ThreadPoolExecutor(20) as threads:
        answers = list(threads.map(lambda _: api.get("/openapi.json").content, range(20)))
    assert len(set(answers)) == 1
    assert len(begun) == 1


def test_a_parameter_is_left_out_rather_than_null(page: Any) -> None:
    for path in page["paths"].values():
        for operation in path.values():
            for parameter in operation.get("parameters", ()):
                assert {"type": "null"} not in parameter["schema"].get("anyOf", ()), parameter


def test_bodies_have_no_other_fields(page: Any) -> None:
    schemas = page["components"]["schemas"]
    for kind in ("Scene", "Region", "Spectrum", "Component", "QuickProtocol"):
        assert schemas[kind]["additionalProperties"] is False, kind
    assert schemas["Model"]["additionalProperties"] is True  # carried on
    wanted = page["paths"]["/v1/rigs/{rig}/model/activate"]["post"]["requestBody"]
    assert wanted["content"]["application/json"]["schema"]["additionalProperties"] is False


def test_the_field_that_says_which_type_is_required(api: TestClient, page: Any) -> None:
    schemas = page["components"]["schemas"]
    for kind, tag in (("Spectrum", "kind"), ("Map", "kind"), ("MassSpringDamper", "law")):
        assert tag in schemas[kind]["required"], kind
    headers = {"Content-Type": "application/json"}
    body = b'{"components":[{"amplitude_n":0.1,"hz":100.0}]}'
    assert api.post("/v1/preview", content=body, headers=headers).status_code == 422


def pattern_of(page: Any, path: str, name: str) -> str:
    found = [p for p in page["paths"][path]["get"]["parameters"] if p["name"] == name]
    return str(found[0]["schema"]["pattern"])


@pytest.mark.parametrize(
    ("path", "name", "accepted", "refused"),
    [
        (REFERENCE, "reference", ["a", "rig1/P01", "a@3", "a@prod"], ["@", "a@", "a@01", "/a"]),
        ("/v1/models/{name}/aliases/{alias}", "alias", ["a", "a-1"], ["0", "A", "a" * 33]),
        ("/v1/textures/{name}", "name", ["linen", "0-1"], ["-", "Linen", "a" * 65]),
        (
            "/v1/rigs/{rig}/scene",
            "if-none-match",
            ["*", '"a"', 'W/"a"', '"a", "b"'],
            ["null", "a", '"a', "* , *", "", '"a",'],
        ),
    ],
)
def test_patterns_are_what_is_accepted(
    api: TestClient,
    rig: FakeRig,
    page: Any,
    path: str,
    name: str,
    accepted: list[str],
    refused: list[str],
) -> None:
    pattern = pattern_of(page, path, name)
    place = path.format(reference="a", name="a", alias="a", rig=rig.name)
    for texts, fits in ((accepted, True), (refused, False)):
        for text in texts:
            assert (re.search(pattern, text) is not None) == fits, text
            if name == "if-none-match":
                answer = api.get(place, headers={"If-None-Match": text})
            else:
                answer = api.get(path.format(**{"name": "a", name: text}))
            assert (answer.status_code == 422) != fits, (text, answer.text)


@pytest.mark.parametrize("after", ["x", "-1", "1.5", str(2**31)])
def test_versions_are_listed_behind_a_number(api: TestClient, after: str) -> None:
    assert api.get("/v1/models", params={"after": after}).status_code == 422


@pytest.mark.parametrize(
    ("path", "methods"),
    [
        ("/v1/models", "GET, HEAD, POST"),
        ("/v1/textures/x", "DELETE, GET, HEAD, PUT"),
        ("/docs", "GET, HEAD"),
    ],
)
def test_allow_names_every_method(api: TestClient, path: str, methods: str) -> None:
    answer = api.patch(path)
    assert (answer.status_code, answer.headers["allow"]) == (405, methods)
    assert methods in answer.json()["detail"]

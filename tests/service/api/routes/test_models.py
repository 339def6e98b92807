"""The registry over REST."""

import io
import json
from typing import Any

import pytest
from fastapi.testclient import TestClient
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.io import loadmat

from frictus.model import Model
from frictus_service.errors import RegistryUnavailableError
from frictus_service.registry.aliases import Activations

PROVENANCE = {"study_sha256": "ab" * 32, "code_version": "0.1.0", "settings": {}, "seed": 3}
NAME = "rig1/P01"


def document(gain_n: float = 0.4, **changes: Any) -> dict[str, Any]:
    return {
        "schema": "model/1",
        "base": {
            "law": "first_order_speed",
            "gain_n": gain_n,
            "cutoff_0_hz": 400.0,
            "slope_hz_per_mm_s": 12.0,
        },
        "participant": "P01",
        "provenance": PROVENANCE,
        "from_the_future": {"kept": [1, 2]},
        **changes,
    }


def publish(
    api: TestClient, gain_n: float = 0.4, name: str = NAME, key: str | None = None, **more: Any
) -> Any:
    headers = {"Idempotency-Key": key} if key is not None else {}
    body = {"name": name, "rig": "rig1", "comment": "", "model": document(gain_n, **more)}
    return api.post("/v1/models", json=body, headers=headers)


def test_published_is_got_back(api: TestClient) -> None:
    said = publish(api)
    assert said.status_code == 201
    assert said.headers["location"] == f"/v1/models/{NAME}@1"
    assert said.json()["published_by"] == "local"
    for reference in (f"{NAME}@1", NAME, "rig1%2FP01@1"):
        got = api.get(f"/v1/models/{reference}")
        assert got.status_code == 200
        assert got.json() == said.json()
    assert got.json()["model"]["from_the_future"] == {"kept": [1, 2]}
    assert publish(api, 0.5).json()["version"] == 2
    assert api.get(f"/v1/models/{NAME}").json()["version"] == 2
    gone = api.get("/v1/models/rig1/P02")
    assert (gone.status_code, gone.json()["code"]) == (404, "no_model")


def test_list_filters_and_pages(api: TestClient) -> None:
    for gain in (0.3, 0.4, 0.5):
        publish(api, gain)
    publish(api, name="population", participant=None)
    first = api.get("/v1/models", params={"limit": 3}).json()
    assert [m["name"] for m in first["models"]] == ["population", NAME, NAME]
    rest = api.get("/v1/models", params={"limit": 3, "after": first["next"]}).json()
    assert [m["version"] for m in rest["models"]] == [1]
    assert rest["next"] is None
    assert "model" not in rest["models"][0]
    only = api.get("/v1/models", params={"population": True}).json()["models"]
    assert [m["name"] for m in only] == ["population"]
    newest = api.get("/v1/models", params={"newest": True, "participant": "P01"}).json()
    assert [m["version"] for m in newest["models"]] == [3]
    for bad in ({"limit": 0}, {"limit": 1_001}, {"after": "!"}, {"response": "x"}):
        assert api.get("/v1/models", params=bad).status_code == 422


def test_same_key_same_answer_even_after_a_restart(serve: Any) -> None:
    first = publish(serve(), key="k-1")
    again = serve()  # another API process over the same database
    second = publish(again, key="k-1")
    assert (second.status_code, second.json()) == (first.status_code, first.json())
    assert second.headers["location"] == first.headers["location"]
    other = publish(again, 0.5, key="k-1")
    assert (other.status_code, other.json()["code"]) == (422, "key_reused")
    assert publish(again, 0.5, key="k-2").json()["version"] == 2
    assert publish(again, key="").status_code == 422


@pytest.mark.parametrize(
    ("body", "word"),
    [
        ({"name": NAME, "model": document(placeholder=True)}, "placeholder"),
        ({"name": NAME, "model": document(provenance={})}, "study_sha256"),
        ({"name": "a/b/c", "model": document()}, "accepted"),
        ({"name": NAME, "model": document(), "unknown": 1}, "fault"),
        ({"name": NAME, "model": document("0.4")}, "fault"),  # type: ignore[arg-type]
        ({"name": NAME}, "fault"),
        ([], "fault"),
    ],
)
def test_what_cannot_be_published(api: TestClient, body: object, word: str) -> None:
    said = api.post("/v1/models", json=body)
    assert (said.status_code, said.json()["code"]) == (422, "bad_request")
    assert word in said.json()["detail"]
    assert api.get("/v1/models").json()["models"] == []


def test_numbers_must_be_finite(api: TestClient) -> None:
    for number in ("NaN", "1e999", "-Infinity"):
        text = json.dumps({"name": NAME, "model": document()}).replace("400.0", number)
        said = api.post(
            "/v1/models", content=text, headers={"Content-Type": "application/json"}
        )
        assert said.status_code == 422
        assert said.json()["errors"][0]["where"] == ["body", "model", "base", "cutoff_0_hz"]


def test_aliases_move_for_those_who_saw_where_they_stood(api: TestClient) -> None:
    publish(api, 0.3)
    publish(api, 0.4)
    path = f"/v1/models/{NAME}/aliases/production"
    assert api.get(path).status_code == 404
    assert api.put(path, json={"version": 1}).status_code == 428
    assert api.put(path, json={"version": 1}, headers={"If-Match": "*"}).status_code == 412

    made = api.put(path, json={"version": 1}, headers={"If-None-Match": "*"})
    assert made.status_code == 201
    assert api.put(path, json={"version": 2}, headers={"If-None-Match": "*"}).status_code == 412
    seen = api.get(path)
    assert seen.headers["etag"] == made.headers["etag"]
    current = api.get(path, headers={"If-None-Match": seen.headers["etag"]})
    assert current.status_code == 304

    body = {"version": 2, "reason": "more precise"}
    moved = api.put(path, json=body, headers={"If-Match": seen.headers["etag"]})
    assert moved.status_code == 200
    assert api.get(f"/v1/models/{NAME}@production").json()["version"] == 2
    late = api.put(path, json={"version": 1}, headers={"If-Match": seen.headers["etag"]})
    assert (late.status_code, late.json()["code"]) == (412, "conflict")
    for version, status in ((3, 404), (0, 422), ("2", 422)):
        said = api.put(path, json={"version": version}, headers={"If-Match": "*"})
        assert said.status_code == status

    listed = api.get(f"/v1/models/{NAME}/aliases").json()["aliases"]
    assert [(a["alias"], a["version"], a["revision"]) for a in listed] == [("production", 2, 2)]
    audit = api.get(f"/v1/models/{NAME}/audit").json()
    assert [(m["from_version"], m["to_version"], m["reason"]) for m in audit["moves"]] == [
        (1, 2, "more precise"),
        (None, 1, ""),
    ]


def test_comparison(api: TestClient) -> None:
    publish(api, 0.4)
    publish(api, 0.5)
    said = api.get("/v1/models/compare", params={"a": f"{NAME}@1", "b": f"{NAME}@2"}).json()
    assert said["parameters"]["gain_n"]["difference"] == pytest.approx(0.1)
    assert [row["speed_mm_s"] for row in said["cutoff_hz"]] == [20, 40, 60, 80, 100]
    assert api.get("/v1/models/compare", params={"a": NAME}).status_code == 422
    assert api.get("/v1/models/compare", params={"a": NAME, "b": "x"}).status_code == 404


def test_downloads(api: TestClient) -> None:
    said = publish(api).json()
    got = api.get(f"/v1/models/{NAME}@1/model.json")
    assert got.headers["etag"] == f'"{said["etag"]}"'
    assert Model.model_validate_json(got.content) == Model.model_validate(said["model"])
    assert got.json()["schema"] == "model/1"
    tag = {"If-None-Match": got.headers["etag"]}
    assert api.get(f"/v1/models/{NAME}@1/model.json", headers=tag).status_code == 304
    mat = api.get(f"/v1/models/{NAME}/model.mat")
    assert mat.headers["content-type"] == "application/x-matlab-data"
    assert "rig1-P01-1.mat" in mat.headers["content-disposition"]
    file: Any = io.BytesIO(mat.content)  # the types of some versions of scipy know paths alone
    read = loadmat(file, simplify_cells=True)
    assert read["parameters"]["gain_n"] == 0.4
    tag = {"If-None-Match": mat.headers["etag"]}
    assert api.get(f"/v1/models/{NAME}/model.mat", headers=tag).status_code == 304


def test_a_rig_confirms_what_it_applied(api: TestClient, rig: Any) -> None:
    publish(api, 0.3)
    publish(api, 0.4)
    path = f"/v1/rigs/{rig.name}/model/activate"
    said = api.post(path, json={"model": f"{NAME}@1"})
    assert said.status_code == 200
    assert rig.calls[-1][1].model.base.gain_n == 0.3
    assert rig.calls[-1][1].model.from_the_future == {"kept": [1, 2]}
    assert said.json()["confirmed"] == api.get(f"/v1/rigs/{rig.name}/model").headers[
        "etag"
    ].strip('"')
    assert said.json()["as_published"] is False  # this rig names models as it likes
    assert f"measured on rig 'rig1', not on {rig.name!r}" in said.json()["message"]
    late = api.post(path, json={"model": NAME}, headers={"If-Match": '"m0"'})
    assert late.status_code == 412
    now = api.get(f"/v1/rigs/{rig.name}/model").headers["etag"]
    assert api.post(path, json={"model": NAME}, headers={"If-Match": now}).is_success

    audit = api.get(f"/v1/models/{NAME}/audit").json()["activations"]
    assert [(a["rig"], a["version"], a["activated_by"]) for a in audit] == [
        (rig.name, 2, "local"),
        (rig.name, 1, "local"),
    ]
    rig.refusal = ("conflict", "the model changes only while disarmed")
    refused = api.post(path, json={"model": NAME})
    assert (refused.status_code, refused.json()["code"]) == (412, "conflict")
    assert len(api.get(f"/v1/models/{NAME}/audit").json()["activations"]) == 2
    assert api.post(path, json={"model": "nobody"}).json()["code"] == "no_model"
    nobody = api.post("/v1/rigs/nobody/model/activate", json={"model": NAME})
    assert nobody.json()["code"] == "no_rig"


def test_what_a_rig_applies_is_told_though_it_cannot_be_written_down(
    api: TestClient, rig: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    publish(api)

    def fail(*_: Any, **__: Any) -> None:
        raise RegistryUnavailableError("the database is locked")

    path = f"/v1/rigs/{rig.name}/model/activate"
    with monkeypatch.context() as hanging:
        hanging.setattr(Activations, "record", fail)
        said = api.post(path, json={"model": NAME})
    assert (said.status_code, said.json()["code"]) == (503, "not_noted")
    etag = api.get(f"/v1/rigs/{rig.name}/model").headers["etag"]
    told = said.json()["detail"]
    assert f"{rig.name!r} applies it now, and its model has the ETag {etag}" in told
    assert "the database is locked" in told
    assert api.get(f"/v1/models/{NAME}/audit").json()["activations"] == []
    assert api.post(path, json={"model": NAME}).is_success, "as the detail asks for"
    assert len(api.get(f"/v1/models/{NAME}/audit").json()["activations"]) == 1


def test_who_may_do_what(serve: Any, rig: Any) -> None:
    api = serve(tokens=True)

    def bearer(scope: str) -> dict[str, str]:
        return {"Authorization": f"Bearer the-{scope}-token-of-a-test"}

    body = {"name": NAME, "model": document()}
    for scope in ("read", "render", "admin"):
        assert api.post("/v1/models", json=body, headers=bearer(scope)).status_code == 403
    made = api.post("/v1/models", json=body, headers=bearer("calibrate"))
    assert made.json()["published_by"] == "calibrate"  # the token's name
    assert api.get("/v1/models", headers=bearer("read")).is_success
    assert api.get("/v1/models").status_code == 401

    path = f"/v1/models/{NAME}/aliases/production"
    create = {"If-None-Match": "*"}
    target = {"version": 1}
    refused = api.put(path, json=target, headers=bearer("calibrate") | create)
    assert refused.status_code == 403
    assert api.put(path, json=target, headers=bearer("admin") | create).status_code == 201
    activate = f"/v1/rigs/{rig.name}/model/activate"
    wanted = {"model": f"{NAME}@production"}
    assert api.post(activate, json=wanted, headers=bearer("admin")).status_code == 403
    assert api.post(activate, json=wanted, headers=bearer("calibrate")).is_success
    audit = api.get(f"/v1/models/{NAME}/audit", headers=bearer("read")).json()
    assert audit["moves"][0]["moved_by"] == "admin"
    assert audit["activations"][0]["activated_by"] == "calibrate"


def test_without_its_database_the_rest_still_works(serve: Any, rig: Any) -> None:
    from frictus_service.config import RegistryConfig

    api = serve(registry=RegistryConfig(url="postgresql+psycopg://u:secret@127.0.0.1:1/x"))
    assert api.get("/v1/rigs").is_success
    assert api.get("/v1/ready").json()["registry"] is False
    said = api.get("/v1/models")
    assert (said.status_code, said.json()["code"]) == (503, "no_registry")
    assert "secret" not in said.text


def test_ready_says_that_the_registry_can_be_used(api: TestClient) -> None:
    assert api.get("/v1/ready").json()["registry"] is True
    publish(api)
    assert api.get("/v1/ready").json()["registry"] is True


@settings(
    max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(text=st.text(st.characters(codec="utf-8", exclude_characters="\r\n"), max_size=30))
def test_any_reference_is_found_or_refused(api: TestClient, text: str) -> None:
    from urllib.parse import quote

    path = quote(text, safe="/@")
    for suffix in ("", "/aliases", "/audit", "/model.json", "/aliases/production"):
        assert api.get(f"/v1/models/x{path}{suffix}").status_code in (404, 422)

"""Rigs over REST, against a rig on a real router."""

from typing import Any

import anyio
import pytest
from fastapi.testclient import TestClient

SCENE = {
    "name": "second",
    "regions": [
        {"texture": {"kind": "spectrum", "components": [{"amplitude_n": 0.2, "hz": 100.0}]}}
    ],
}
MODEL = {
    "schema": "model/1",
    "base": {
        "law": "first_order_speed",
        "gain_n": 0.4,
        "cutoff_0_hz": 400.0,
        "slope_hz_per_mm_s": 12.0,
    },
    "from_the_future": {"kept": [1, 2]},
}


def test_lists_and_describes_what_is_present(api: TestClient, rig: Any) -> None:
    listed = api.get("/v1/rigs").json()
    assert listed == {"site": "lab", "rigs": [rig.name]}
    said = api.get(f"/v1/rigs/{rig.name}").json()
    assert said["state"] == "disarmed"
    assert said["counters"]["blocks"] == 1234
    assert api.get(f"/v1/rigs/{rig.name}/time").json()["uncertainty_ns"] == 900


def test_status_is_the_newest(api: TestClient, rig: Any) -> None:
    assert api.get(f"/v1/rigs/{rig.name}").json()["state"] == "disarmed"
    rig.trip()
    for _ in range(1_000):  # it arrives by another way than our request
        said = api.get(f"/v1/rigs/{rig.name}").json()
        if said["state"] == "tripped":
            break
    assert said["fault"]["action"] == "reset"


def test_absent_rig_is_404(api: TestClient, rig: Any) -> None:
    for path in ("", "/time", "/scene", "/applied", "/compensation", "/model", "/adaptation"):
        answer = api.get(f"/v1/rigs/nobody{path}")
        assert answer.status_code == 404
        assert answer.json()["code"] == "no_rig"
        assert rig.name in answer.json()["detail"]  # says who is there
    api.get(f"/v1/rigs/{rig.name}")
    rig.vanish()
    assert api.get(f"/v1/rigs/{rig.name}").status_code == 404


def test_scene_round_trip_with_etags(api: TestClient, rig: Any) -> None:
    path = f"/v1/rigs/{rig.name}/scene"
    first = api.get(path)
    assert first.headers["etag"] == '"s0"'
    assert first.json()["name"] == "first"
    assert api.get(path, headers={"If-None-Match": 'W/"x", "s0"'}).status_code == 304

    put = api.put(path, json=SCENE, headers={"If-Match": '"s0"'})
    assert put.status_code == 200
    assert put.json()["gain"] == 0.8
    assert put.headers["etag"] == '"s1"'
    assert rig.calls[-1][1].if_match == "s0"

    second = api.get(path)  # at once: a GET shows what was PUT
    assert second.headers["etag"] == '"s1"'
    assert second.json()["name"] == "second"
    applied = api.get(f"/v1/rigs/{rig.name}/applied").json()
    assert applied["etag"] == "s1"
    assert applied["applied"]["notes"] == ["scaled to fit the drive"]

    late = api.put(path, json=SCENE, headers={"If-Match": '"s0"'})
    assert late.status_code == 412
    assert '"s1"' in late.json()["detail"]
    assert api.put(path, json=SCENE, headers={"If-Match": 'W/"s1"'}).status_code == 412
    assert api.put(path, json=SCENE, headers={"If-Match": '"q", "s1"'}).status_code == 200
    assert api.put(path, json=SCENE, headers={"If-Match": "*"}).status_code == 200
    assert rig.calls[-1][1].if_match is None
    assert api.put(path, json=SCENE, headers={"If-Match": "s1"}).status_code == 422


@pytest.mark.parametrize(("what", "body"), [("scene", SCENE), ("model", MODEL)])
def test_put_needs_if_match(api: TestClient, rig: Any, what: str, body: object) -> None:
    answer = api.put(f"/v1/rigs/{rig.name}/{what}", json=body)
    assert answer.status_code == 428
    assert not rig.calls


def test_what_is_got_can_be_put(api: TestClient, rig: Any) -> None:
    for what in ("scene", "model"):
        path = f"/v1/rigs/{rig.name}/{what}"
        got = api.get(path)
        put = api.put(path, json=got.json(), headers={"If-Match": got.headers["etag"]})
        assert put.is_success, put.json()
        assert api.get(path).json() == got.json()


@pytest.mark.parametrize(
    "asked",
    [{"mode": "none"}, {"mode": "fixed", "speed_mm_s": 60.0}, {"mode": "model"}],
    ids=str,
)
def test_a_compensation_mode_that_is_put_is_got(
    api: TestClient, rig: Any, asked: dict[str, Any]
) -> None:
    path = f"/v1/rigs/{rig.name}/compensation"
    assert api.get(path).json() == {"mode": "model", "speed_mm_s": None}
    put = api.put(path, json=asked)
    assert put.status_code == 200
    assert put.json() == {"speed_mm_s": None, **asked}
    assert rig.calls[-1][1].client == "local.rest"
    assert api.get(path).json() == put.json()  # at once: a GET shows what was PUT
    assert api.get(f"/v1/rigs/{rig.name}").json()["compensation"] == put.json()
    assert api.put(path, json=put.json()).status_code == 200, "what is got can be put"


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ("", "JSON"),
        ("{}", "mode"),
        ('{"mode": "off"}', "'model', 'fixed' or 'none'"),
        ('{"mode": "fixed"}', "give it"),
        ('{"mode": "fixed", "speed_mm_s": 0}', "speed_mm_s"),
        ('{"mode": "fixed", "speed_mm_s": "60"}', "speed_mm_s"),
        ('{"mode": "fixed", "speed_mm_s": 1e999}', "finite"),
        ('{"mode": "fixed", "speed_mm_s": NaN}', "finite"),
        ('{"mode": "none", "speed_mm_s": 60}', "leave it out"),
        ('{"mode": "none", "speed": 60}', "speed"),
        ("[" * 100_000, "body"),
    ],
)
def test_what_is_no_compensation_mode_is_refused(
    api: TestClient, rig: Any, body: str, said: str
) -> None:
    path = f"/v1/rigs/{rig.name}/compensation"
    answer = api.put(path, content=body, headers={"Content-Type": "application/json"})
    assert answer.status_code == 422
    assert said in answer.text
    assert not rig.calls
    assert api.put(path, content=body).status_code == 415


def test_a_mode_needs_the_rig(api: TestClient, rig: Any) -> None:
    rig.refusal = ("not_armed", "arm the rig first")
    answer = api.put(f"/v1/rigs/{rig.name}/compensation", json={"mode": "none"})
    assert (answer.status_code, answer.json()["code"]) == (409, "not_armed")


@pytest.mark.parametrize("policy", ["adapt", "suggest", "observe"])
@pytest.mark.parametrize("undo", [False, True])
def test_a_policy_that_is_put_is_got(
    api: TestClient, rig: Any, policy: str, undo: bool
) -> None:
    path = f"/v1/rigs/{rig.name}/adaptation"
    assert api.get(path).json() == {"policy": "observe"}
    put = api.put(path, json={"policy": policy, "undo": undo})
    assert (put.status_code, put.json()) == (200, {"policy": policy})
    asked = rig.calls[-1][1]
    assert (asked.client, asked.policy, asked.undo) == ("local.rest", policy, undo)
    assert api.get(path).json() == put.json()  # at once: a GET shows what was PUT
    assert api.get(f"/v1/rigs/{rig.name}").json()["adaptation"] == policy
    assert api.put(path, json=put.json()).status_code == 200, "what is got can be put"
    assert not rig.calls[-1][1].undo


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ("", "JSON"),
        ("{}", "policy"),
        ('{"policy": "follow"}', "'observe', 'suggest' or 'adapt'"),
        ('{"policy": "adapt", "undo": 1}', "undo"),
        ('{"policy": "adapt", "undone": true}', "undone"),
        ("[" * 100_000, "body"),
    ],
)
def test_what_is_no_policy_is_refused(api: TestClient, rig: Any, body: str, said: str) -> None:
    path = f"/v1/rigs/{rig.name}/adaptation"
    answer = api.put(path, content=body, headers={"Content-Type": "application/json"})
    assert answer.status_code == 422
    assert said in answer.text
    assert not rig.calls
    assert api.put(path, content=body).status_code == 415


def test_an_undo_that_the_rig_refuses_is_a_problem(api: TestClient, rig: Any) -> None:
    rig.refusal = ("not_owner", "'ann' holds the rig and keeps its model")
    body = {"policy": "observe", "undo": True}
    answer = api.put(f"/v1/rigs/{rig.name}/adaptation", json=body)
    assert (answer.status_code, answer.json()["code"]) == (409, "not_owner")
    assert "keeps its model" in answer.json()["detail"]


def test_model_keeps_what_newer_writers_add(api: TestClient, rig: Any) -> None:
    path = f"/v1/rigs/{rig.name}/model"
    put = api.put(path, json=MODEL, headers={"If-Match": '"m0"'})
    assert put.status_code == 204
    got = api.get(path)
    assert got.headers["etag"] == put.headers["etag"]
    assert got.json()["from_the_future"] == {"kept": [1, 2]}
    assert got.json()["schema"] == "model/1"


def test_a_stop_waits_for_no_other_request(api: TestClient, rig: Any) -> None:
    async def take_all_threads() -> None:
        limiter = anyio.to_thread.current_default_thread_limiter()
        for number in range(int(limiter.total_tokens)):
            limiter.acquire_on_behalf_of_nowait(number)

    async def give_them_back() -> None:
        limiter = anyio.to_thread.current_default_thread_limiter()
        for number in range(int(limiter.total_tokens)):
            limiter.release_on_behalf_of(number)

    assert api.portal is not None
    api.portal.call(take_all_threads)
    try:
        assert api.post(f"/v1/rigs/{rig.name}/stop").json() == {"state": "stopping"}
    finally:
        api.portal.call(give_them_back)


def test_stop_and_reset(api: TestClient, rig: Any) -> None:
    assert api.post(f"/v1/rigs/{rig.name}/stop").json() == {"state": "stopping"}
    assert api.post(f"/v1/rigs/{rig.name}/reset").json() == {"state": "disarmed"}
    assert [call for call, _ in rig.calls] == ["stop", "reset"]


REFUSED = {
    "bad_request": 422,
    "too_large": 413,
    "stale": 503,
    "not_owner": 409,
    "not_armed": 409,
    "tripped": 409,
    "conflict": 412,
    "not_feasible": 422,
    "unavailable": 503,
}


@pytest.mark.parametrize(("code", "status"), REFUSED.items())
def test_refusals_keep_their_word(api: TestClient, rig: Any, code: str, status: int) -> None:
    rig.refusal = (code, "says the rig")
    path = f"/v1/rigs/{rig.name}/scene"
    answer = api.put(path, json=SCENE, headers={"If-Match": "*"})
    assert answer.status_code == status
    assert answer.json()["code"] == code
    assert "says the rig" in answer.json()["detail"]


@pytest.mark.parametrize(
    ("method", "path", "body"),
    [
        ("PUT", "scene", SCENE),
        ("PUT", "model", MODEL),
        ("PUT", "compensation", {"mode": "none"}),
        ("PUT", "adaptation", {"policy": "suggest"}),
        ("POST", "stop", None),
        ("POST", "reset", None),
    ],
)
def test_what_is_not_answered_in_time_has_an_unknown_outcome(
    api: TestClient, rig: Any, method: str, path: str, body: object
) -> None:
    api.get(f"/v1/rigs/{rig.name}/scene")
    api.get(f"/v1/rigs/{rig.name}/model")
    rig.silent = True
    asked = f"/v1/rigs/{rig.name}/{path}"
    answer = api.request(method, asked, json=body, headers={"If-Match": "*"})
    assert (answer.status_code, answer.json()["code"]) == (504, "outcome_unknown")
    assert [call for call, _ in rig.calls] == [path]  # it was done
    if method == "PUT":  # what follows tells
        found = api.get(asked)
        if path == "compensation":
            assert found.json()["mode"] == "none"
        elif path == "adaptation":
            assert found.json()["policy"] == "suggest"
        else:
            assert found.headers["etag"] in ('"s1"', '"m1"')


def test_what_was_confirmed_and_is_not_published_is_said_to_be_out_of_date(
    api: TestClient, rig: Any
) -> None:
    path = f"/v1/rigs/{rig.name}/scene"
    api.get(path)
    rig.publishes = False
    assert api.put(path, json=SCENE, headers={"If-Match": "*"}).status_code == 200
    for _ in range(2):
        answer = api.get(path)
        assert (answer.status_code, answer.json()["code"]) == (503, "no_link")
        assert "out of date" in answer.json()["detail"]


def test_rigs_know_who_asks_by_the_name_of_the_token(serve: Any, rig: Any) -> None:
    api = serve(tokens=True)
    headers = {"Authorization": "Bearer the-read-token-of-a-test"}
    assert api.post(f"/v1/rigs/{rig.name}/stop", headers=headers).is_success
    no_page = headers | {"Frictus-Page": "not-a-key-of-any-page"}
    assert api.post(f"/v1/rigs/{rig.name}/stop", headers=no_page).is_success
    assert [request.client for _, request in rig.calls] == ["read.rest", "read.rest"]

"""What a tracker knows, over REST, and its way into the registry."""

import time
from typing import Any

from fastapi.testclient import TestClient
from tests.service.api.conftest import FakeRig

from frictus.keys import Topics
from frictus.messages import EstimateState
from frictus.model import FirstOrderSpeedLaw, Model


def felt(**changes: Any) -> EstimateState:
    law = FirstOrderSpeedLaw(gain_n=0.3, cutoff_0_hz=771.0, slope_hz_per_mm_s=27.6)
    model = Model(base=law, provenance={"source": "live", "windows": 40})
    told = {"utc_ns": time.time_ns(), "run": 1, "windows": 40, "model": model, **changes}
    return EstimateState(**told)


def test_the_estimate_is_told(api: TestClient, rig: FakeRig) -> None:
    state = felt()
    rig.publish(Topics.ESTIMATE, state)
    said = api.get(f"/v1/rigs/{rig.name}/estimate")
    assert said.status_code == 200
    assert EstimateState.model_validate(said.json()) == state


def test_where_nobody_tracks_it_says_what_to_start(api: TestClient, rig: FakeRig) -> None:
    for said in (
        api.get(f"/v1/rigs/{rig.name}/estimate"),
        api.post(f"/v1/rigs/{rig.name}/estimate/publish", json={}),
    ):
        assert (said.status_code, said.json()["code"]) == (404, "no_estimate")
        assert "frictus track" in said.json()["detail"]


def test_it_is_published_as_somebodys(api: TestClient, rig: FakeRig) -> None:
    path = f"/v1/rigs/{rig.name}/estimate/publish"
    rig.publish(Topics.ESTIMATE, felt())
    unnamed = api.post(path, json={})
    assert (unnamed.status_code, unnamed.json()["code"]) == (422, "bad_request")
    assert "whose finger" in unnamed.json()["detail"]
    for wrong in ("Jane Doe", "", "P\n"):
        refused = api.post(path, json={"participant": wrong, "name": "somebody"})
        assert (refused.status_code, refused.json()["code"]) == (422, "bad_request")
    said = api.post(path, json={"participant": "P07", "comment": "after the session"})
    assert said.status_code == 201, said.text
    published = said.json()
    assert said.headers["location"] == f"/v1/models/{rig.name}/P07@1"
    assert (published["participant"], published["rig"]) == ("P07", rig.name)
    model = api.get(f"/v1/models/{rig.name}/P07").json()["model"]
    assert model["provenance"]["source"] == "live"
    assert model["provenance"]["simulated"] is True
    assert model["base"]["gain_n"] == 0.3


def test_what_may_be_anothers_is_published_as_nobodys(api: TestClient, rig: FakeRig) -> None:
    """What was felt of another finger became a version of whom the model in force is of."""
    path, state = f"/v1/rigs/{rig.name}/estimate/publish", felt()
    assert state.model is not None
    own = state.model.model_copy(update={"participant": "P01"})
    rig.publish(Topics.ESTIMATE, felt(model=own, new_fingers=1))
    unnamed = api.post(path, json={})
    assert (unnamed.status_code, unnamed.json()["code"]) == (422, "bad_request")
    assert "another finger was noticed" in unnamed.json()["detail"]
    assert api.post(path, json={"participant": "P02"}).json()["participant"] == "P02"
    rig.publish(Topics.ESTIMATE, felt(model=own))
    assert api.post(path, json={}).json()["participant"] == "P01"


def test_before_anything_was_felt_nothing_is_published(api: TestClient, rig: FakeRig) -> None:
    rig.publish(Topics.ESTIMATE, felt(model=None, windows=0))
    said = api.post(f"/v1/rigs/{rig.name}/estimate/publish", json={"participant": "P07"})
    assert (said.status_code, said.json()["code"]) == (404, "no_estimate")
    assert "nothing was felt" in said.json()["detail"]

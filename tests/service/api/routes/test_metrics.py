"""What Prometheus reads."""

from typing import Any

import pytest
from fastapi.testclient import TestClient
from prometheus_client.parser import text_string_to_metric_families
from tests.rig_status import rig_status

from frictus.keys import Topics
from frictus_service.api.routes import monitoring


def samples(api: TestClient) -> dict[tuple[str, frozenset[tuple[str, str]]], float]:
    answer = api.get("/metrics")
    assert answer.headers["content-type"].startswith("text/plain")
    return {
        (sample.name, frozenset(sample.labels.items())): sample.value
        for family in text_string_to_metric_families(answer.text)
        for sample in family.samples
    }


def test_rigs(api: TestClient, rig: Any) -> None:
    found = samples(api)
    which = {("site", "lab"), ("rig", rig.name)}
    assert found["frictus_router_linked", frozenset()] == 1.0
    assert found["frictus_rig_up", frozenset(which)] == 1.0
    assert found["frictus_rig_blocks_total", frozenset(which)] == 1234.0
    assert found["frictus_rig_underruns_total", frozenset(which)] == 2.0
    assert found["frictus_rig_lead_growths_total", frozenset(which)] == 0.0
    assert found["frictus_rig_loop_lateness_p99_seconds", frozenset(which)] == 0.0
    assert found["frictus_rig_state", frozenset({*which, ("state", "disarmed")})] == 1.0
    assert found["frictus_rig_state", frozenset({*which, ("state", "armed")})] == 0.0


def test_a_rig_that_calls_itself_another_counts_as_itself(api: TestClient, rig: Any) -> None:
    rig.publish(Topics.STATUS, rig_status(site="elsewhere", rig="other", state="tripped"))
    tripped = {("site", "lab"), ("rig", rig.name), ("state", "tripped")}
    while not (found := samples(api))["frictus_rig_state", frozenset(tripped)]:
        pass
    rigs = {value for _, labels in found for key, value in labels if key == "rig"}
    assert rigs == {rig.name}


def test_many_silent_rigs_hold_no_answer_up(
    api: TestClient, rig: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(monitoring, "ASK_S", -1.0)
    found = samples(api)
    assert found["frictus_rigs_not_asked", frozenset()] == 1.0
    assert not any(name == "frictus_rig_up" for name, _ in found)


def test_requests_are_counted_by_path_not_by_name(api: TestClient) -> None:
    for number in range(5):
        api.get(f"/v1/textures/t{number}")
        api.get(f"/nowhere/{number}")
    api.request("BREW", "/v1/rigs")
    found = samples(api)

    def count(method: str, path: str, status: str) -> float:
        labels = frozenset({("method", method), ("path", path), ("status", status)})
        return found["frictus_api_requests_total", labels]

    assert count("GET", "/v1/textures/{name}", "404") == 5.0
    assert count("GET", "none", "404") == 5.0
    assert sum(1 for name, labels in found if ("method", "other") in labels) > 0
    timed = frozenset({("method", "GET"), ("path", "/v1/textures/{name}")})
    assert found["frictus_api_request_seconds_count", timed] == 5.0


def test_each_app_counts_for_itself(serve: Any) -> None:
    one, other = serve(), serve()
    one.get("/v1/health")
    assert not any("/v1/health" in str(labels) for _, labels in samples(other))

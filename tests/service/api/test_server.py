"""The API process: a real socket, a spawned process, a clean stop."""

import http.client
import json
import multiprocessing
import socket
import threading
from pathlib import Path
from typing import Any

import pytest
from prometheus_client.parser import text_string_to_metric_families

import frictus
from frictus_service.api.server import build_app, listen, run_api
from frictus_service.config import ApiConfig, Config, RegistryConfig, RouterConfig
from frictus_service.errors import StartError
from frictus_service.processes import free_port


def configuration(router: str, folder: Path, port: int) -> Config:
    return Config(
        router=RouterConfig(endpoint=router, host=False),
        textures=folder,
        studies=folder / "studies",
        registry=RegistryConfig(url=f"sqlite:///{folder / 'registry.db'}"),
        api=ApiConfig(port=port),
    )


def get(port: int, path: str) -> tuple[int, str]:
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=20.0)
    try:
        connection.request("GET", path)
        answer = connection.getresponse()
        return answer.status, answer.read().decode()
    finally:
        connection.close()


def test_spawned_process_serves_and_stops(router: str, rig: Any, tmp_path: Path) -> None:
    context = multiprocessing.get_context("spawn")
    stop, ready = context.Event(), context.Event()
    port = free_port()
    process = context.Process(
        target=run_api, args=(configuration(router, tmp_path, port), stop, ready)
    )
    process.start()
    try:
        assert ready.wait(40.0)
        status, body = get(port, "/v1/rigs")
        assert (status, json.loads(body)["rigs"]) == (200, [rig.name])
        status, body = get(port, "/metrics")
        assert status == 200
        assert list(text_string_to_metric_families(body))
    finally:
        stop.set()
        process.join(20.0)
        if process.is_alive():
            process.kill()
    assert process.exitcode == 0
    process.close()


def test_stops_with_a_connection_left_open(router: str, tmp_path: Path) -> None:
    stop, ready = threading.Event(), threading.Event()
    port = free_port()
    thread = threading.Thread(
        target=run_api, args=(configuration(router, tmp_path, port), stop, ready)
    )
    thread.start()
    try:
        assert ready.wait(20.0)
        with socket.create_connection(("127.0.0.1", port)):
            stop.set()
            thread.join(20.0)
    finally:
        stop.set()
        thread.join(20.0)
    assert not thread.is_alive()


@pytest.mark.parametrize(("page_lease_ms", "patient"), [(500, False), (10_000, True)])
def test_the_link_lasts_as_what_pages_hold(
    page_lease_ms: int, patient: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Else a page's rig goes with the link, however long its lease."""
    config = configuration("tcp/127.0.0.1:1", tmp_path, 0)
    app = build_app(
        config.model_copy(update={"api": ApiConfig(port=0, page_lease_ms=page_lease_ms)})
    )
    asked: dict[str, Any] = {}
    monkeypatch.setattr(frictus, "connect", lambda _router, **how: asked.update(how))
    app.state.hub._link.client()
    assert asked["patient"] == patient


def test_taken_port_is_named(router: str, tmp_path: Path) -> None:
    with listen("127.0.0.1", 0) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(StartError, match=str(port)):
            run_api(configuration(router, tmp_path, port), threading.Event(), threading.Event())

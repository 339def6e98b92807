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

from frictus_service.api.server import listen, run_api
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


def test_taken_port_is_named(router: str, tmp_path: Path) -> None:
    with listen("127.0.0.1", 0) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(StartError, match=str(port)):
            run_api(configuration(router, tmp_path, port), threading.Event(), threading.Event())

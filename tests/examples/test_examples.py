"""Every example runs, on a real service where it wants one, and says what it should."""

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from tests.campaigns.service import Said, config_in, serving
from tests.patience import PATIENT, PATIENT_LEASE_MS

from frictus_hardware import SimulatedConfig
from frictus_hardware.simulated.strokes import SteadyStrokes
from frictus_service.config import Config, RouterConfig
from frictus_service.daemon.processes.supervisor import Supervisor

FOLDER = Path(__file__).parents[2] / "examples"
ONLINE = {
    "first_touch": "mm/s",
    "stream_texture": "40 updates sent",
    "two_rigs": "rig2: x",
    "record_and_export": "reading: complete",
    "experiment": "threshold",
    "psychopy_experiment": "dB: ",
    "live_panel": "states of the finger",
}
OFFLINE = {
    "own_backend": "after 400 samples",
    "own_effect": "after 30.0 min: 1.299",
    "own_importer": "cutoff_0_hz",
}


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Config]:
    """A service with two simulated rigs whose fingers stroke."""
    rig = SimulatedConfig(finger=SteadyStrokes())
    config = config_in(tmp_path_factory.mktemp("service"), rig)
    api = config.api.model_copy(update={"page_lease_ms": PATIENT_LEASE_MS})
    patient = {"limits": PATIENT, "api": api, "block_ms": 20.0}
    config = config.model_copy(update=patient)
    router = RouterConfig(endpoint=config.router.endpoint, host=False)
    second = config.model_copy(update={"rig": "rig2", "router": router})
    with serving(config, Said()), Supervisor(second, parts=("rig",)) as supervisor:
        supervisor.wait_ready(100.0)
        yield config


def said_by(name: str, folder: Path, *arguments: str) -> str:
    done = subprocess.run(
        [sys.executable, str(FOLDER / f"{name}.py"), *arguments],
        capture_output=True,
        text=True,
        timeout=110,
        check=False,
        cwd=folder,
        env={**os.environ, "MPLBACKEND": "Agg"},
    )
    assert done.returncode == 0, done.stderr
    assert not done.stderr
    return done.stdout


@pytest.mark.long
@pytest.mark.parametrize("name", ONLINE)
def test_with_a_rig(name: str, service: Config, tmp_path: Path) -> None:
    assert ONLINE[name] in said_by(name, tmp_path, service.router.endpoint)


def test_rest(service: Config, tmp_path: Path) -> None:
    said = said_by("rest_status", tmp_path, f"http://127.0.0.1:{service.api.port}")
    assert "rig1: disarmed, 20000 Hz" in said
    assert "(a placeholder)" in said


def test_over_the_websocket(service: Config, tmp_path: Path) -> None:
    said = said_by("over_websocket", tmp_path, f"ws://127.0.0.1:{service.api.port}")
    assert "mm/s" in said
    assert " 0 samples lost" in said


LONG = {"own_importer": pytest.mark.long}


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=LONG.get(name, ())) for name in OFFLINE]
)
def test_without_a_rig(name: str, tmp_path: Path) -> None:
    assert OFFLINE[name] in said_by(name, tmp_path)


def test_all_are_listed_and_run() -> None:
    files = {path.stem for path in FOLDER.glob("*.py")}
    assert files == {*ONLINE, *OFFLINE, "rest_status", "over_websocket"}
    table = (FOLDER / "README.md").read_text(encoding="utf-8")
    assert all(f"({name}.py)" in table for name in files)

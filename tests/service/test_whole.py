"""The whole service as a newcomer meets it: `play`, the quick start of the docs, the demo."""

import json
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from tests.patience import PATIENT
from typer.testing import CliRunner

from frictus_hardware import SimulatedConfig
from frictus_service.cli.app import app
from frictus_service.config import Config, RouterConfig
from frictus_service.daemon.processes.supervisor import Supervisor
from frictus_service.library import SHIPPED
from frictus_service.processes import free_endpoint

ROOT = Path(__file__).parents[2]
RECORDINGS = ROOT.parent / "shared" / "data" / "makesense_textures"
RECORDED = sorted(RECORDINGS.glob("*_filt.csv"))


@pytest.fixture(scope="module")
def endpoint() -> Iterator[str]:
    """A rig that runs for all tests of this file."""
    router = RouterConfig(endpoint=free_endpoint())
    config = Config(router=router, backend=SimulatedConfig(), block_ms=20.0, limits=PATIENT)
    said: list[str] = []
    with Supervisor(config, parts=("rig",), say=said.append) as supervisor:
        supervisor.wait_ready(100.0)
        yield config.router.endpoint


def played(arguments: list[str], endpoint: str) -> None:
    """Play something for a second; it must be applied, and felt."""
    options = ["--router", endpoint, "--seconds", "1", "--json"]
    done = CliRunner().invoke(app, ["play", *arguments, *options])
    assert done.exit_code == 0, done.stderr
    events = [json.loads(line) for line in done.stdout.splitlines()]
    applied = next(event for event in events if event["event"] == "applied")
    assert 0.0 < applied["gain"] <= 1.0
    felt = [event for event in events if event["event"] == "felt"]
    assert felt[-1]["state"] == "armed"
    assert max(event["friction_rms_n"] or 0.0 for event in felt) > 1e-3
    assert not any(felt[-1]["blocks_lost"].values())
    assert felt[-1]["counters"]["clipped_samples"] == 0


@pytest.mark.skipif(not RECORDED, reason="the recordings are not at ../shared/data")
@pytest.mark.parametrize("path", RECORDED, ids=lambda path: path.stem)
def test_a_recording_is_felt(path: Path, endpoint: str) -> None:
    played([str(path), "--speed", "40", "--rate", "20000"], endpoint)


@pytest.mark.parametrize("path", sorted(SHIPPED.glob("*.json")), ids=lambda path: path.stem)
def test_a_shipped_texture_is_felt(path: Path, endpoint: str) -> None:
    played([path.stem], endpoint)


@pytest.mark.parametrize(("number", "printed"), [(0, "Block("), (1, " mm")])
def test_the_quick_start_of_the_docs_runs(endpoint: str, number: int, printed: str) -> None:
    text = (ROOT / "docs" / "run.md").read_text(encoding="utf-8")
    code = re.findall(r"```python\n(.*?)```", text, re.DOTALL)[number]
    assert "tcp/127.0.0.1:7447" in code
    code = code.replace("tcp/127.0.0.1:7447", endpoint)
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 0, done.stderr
    assert printed in done.stdout


def test_the_program_in_the_readme_runs(endpoint: str) -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    assert "frictus.connect()" in code
    code = code.replace("frictus.connect()", f"frictus.connect({endpoint!r})")
    command = [sys.executable, "-u", "-c", code]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as program:
        assert program.stdout is not None
        values = [float(value) for value in program.stdout.readline().split()]
        program.kill()  # it goes on until its lease is lost
    assert len(values) == 3


@pytest.mark.long
def test_the_demo_runs_and_compensates(tmp_path: Path) -> None:
    picture = tmp_path / "demo.png"
    command = [sys.executable, "-c", "from frictus_service.cli import main; main()"]
    done = subprocess.run(
        [*command, "demo", "--json", "--seconds", "8", "--seed", "7", "--plot", str(picture)],
        capture_output=True,
        text=True,
        timeout=110,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)  # one object and nothing else
    assert len(result["band_hz"]) == 16
    assert result["seed"] == 7
    overall = result["overall_error_db"]
    assert 0.0 < overall["compensated"] < overall["uncompensated"]
    assert result["clipped_samples"] == 0
    assert result["texture_update_latency_ms"]["updates"] > 0
    assert (
        result["texture_update_latency_ms"]["median"]
        > result["texture_update_latency_ms"]["of_which_lead"]
    )
    assert all(count > 0 for count in result["blocks_received"].values())
    assert picture.stat().st_size > 10_000

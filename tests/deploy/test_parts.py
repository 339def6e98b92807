"""The commands that only an installation needs: a router alone, and a device set to zero."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import frictus
from frictus_hardware import SimulatedConfig, SimulatedDeviceConfig
from frictus_hardware.simulated.device_rig import SimulatedDeviceRig, launched, recent_output
from frictus_hardware.simulated.strokes import SteadyStrokes
from frictus_service.cli.app import app
from frictus_service.cli.options import Exit
from frictus_service.config import Config, RouterConfig
from frictus_service.daemon.processes.serve import serve
from frictus_service.daemon.processes.supervisor import Supervisor
from frictus_service.processes import free_endpoint


def test_router_runs_without_any_part() -> None:
    config = Config(router=RouterConfig(endpoint=free_endpoint(), host=False))
    said: list[str] = []
    with Supervisor(config, (), host_router=True, say=said.append) as supervisor:
        supervisor.wait_ready()
        with frictus.connect(config.router.endpoint) as client:
            assert client.rigs() == []
    assert said == [f"router listens at {config.router.endpoint}", "stopped"]


def test_where_no_rig_runs_no_output_is_said_to_ramp() -> None:
    config = Config(router=RouterConfig(endpoint=free_endpoint(), host=False))
    said: list[str] = []
    serve(config, (), host_router=True, say=said.append, is_over=lambda: True)
    assert said[-2:] == ["stopping", "stopped"]


@pytest.fixture
def device() -> Iterator[SimulatedDeviceConfig]:
    with launched(SimulatedConfig(finger=SteadyStrokes())) as config:
        yield config


def test_zero_ends_what_a_device_holds(device: SimulatedDeviceConfig, tmp_path: Path) -> None:
    file = tmp_path / "frictus.toml"
    file.write_text(
        f'backend = {{ kind = "simulated_device", address = "{device.address}" }}\n'
    )
    rig = SimulatedDeviceRig(device)
    rig.open()
    rig.arm()
    rig.exchange(np.full(100, 20.0))
    while not recent_output(device, 0.1).holding:
        pass  # the block is still to be played; nothing follows it
    done = CliRunner().invoke(app, ["zero", "--config", str(file)])
    assert done.exit_code == Exit.OK, done.output
    output = recent_output(device, 0.1)
    assert not output.holding
    assert not output.armed
    assert output.voltage_v[-1] == 0.0
    rig.close()

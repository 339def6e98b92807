"""`frictus selftest`: output, report, exit codes, and when it refuses."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.hardware.nidaq.fake_device import FakeDevice
from tests.hardware.nidaq.fake_server import FakeServer
from tests.hardware.nidaq.wired import section, sensor_volts
from typer.testing import CliRunner

from frictus_hardware.arrays import FloatArray
from frictus_service.cli.app import app
from frictus_service.cli.checks import selftest
from frictus_service.cli.options import Exit
from frictus_service.selftest.playing import PEAK_V
from frictus_service.selftest.report import Measure, Outcome

VIRTUAL = 'kind = "simulated"\nclock = "virtual"\nsample_rate_hz = 10_000.0\n'
DEVICE = 'kind = "simulated_device"\naddress = "{address}"\n'


def run(*args: object) -> Any:
    return CliRunner().invoke(app, ["selftest", *map(str, args)])


def lines(result: Any) -> list[dict[str, Any]]:
    return [json.loads(line) for line in result.stdout.splitlines()]


def configured(folder: Path, backend: str, router: str = "tcp/127.0.0.1:1") -> Path:
    file = folder / "frictus.toml"
    file.write_text(f'block_ms = 20.0\n[backend]\n{backend}\n[router]\nendpoint = "{router}"\n')
    return file


@pytest.mark.long
def test_the_simulated_rig_passes_and_is_reported(tmp_path: Path) -> None:
    report = tmp_path / "report.json"
    config = configured(tmp_path, VIRTUAL)
    result = run(config, "--json", "--out", report)
    assert result.exit_code == Exit.OK
    told = {line["test"]: line for line in lines(result)}
    assert [line["verdict"] for line in told.values()] == [
        "ok",
        "ok",
        "ok",
        "skip",
        "skip",
        "ok",
    ]
    written = json.loads(report.read_text())
    assert written["format"] == "selftest/1"
    assert (written["rig"], written["verdict"]) == ("rig1", "ok")
    assert written["tests"] == [
        {name: value for name, value in line.items() if name != "event"}
        for line in told.values()
    ]
    figures = [each for line in told.values() for each in line["figures"]]
    assert {"N", "m/s²", "V", "samples", "ms"} <= {each["unit"] for each in figures}


@pytest.mark.long
def test_a_monitor_that_is_wrong_fails_with_6(tmp_path: Path) -> None:
    fault = '{ kind = "monitor", at_sample = 0, factor = -0.5 }'
    result = run(configured(tmp_path, f"{VIRTUAL}faults = [{fault}]\n"))
    assert result.exit_code == Exit.CHECK_FAILED
    found = {line["test"]: line for line in lines(result)}["loop-back"]
    assert "polarity" in found["found"]
    assert "0.5 ±" in found["found"]


def test_a_rig_that_runs_is_left_alone(tmp_path: Path, rig: Any, config: Path) -> None:
    router = next(line for line in config.read_text().splitlines() if "endpoint" in line)
    file = tmp_path / "device.toml"
    file.write_text(
        f'rig = "fake"\n[router]\n{router}\n[backend]\n{DEVICE.format(address="127.0.0.1:1")}'
    )
    result = run(file, "--yes", "--json")
    assert result.exit_code == Exit.CHECK_FAILED
    (told,) = lines(result)
    assert "is running" in told["found"]
    assert "frictus serve" in told["to_do"]


@pytest.mark.long
def test_a_configured_ni_device_passes(tmp_path: Path, rng: np.random.Generator) -> None:
    def at_rest(output_v: FloatArray, _first: int) -> FloatArray:
        force_n = rng.normal(0.0, 0.002, (output_v.size, 3))
        heard_v = output_v + rng.normal(0.0, 0.0003, output_v.size)
        return sensor_volts(force_n, 10.0 * force_n + [0.0, 0.0, 9.81], heard_v)

    with FakeServer(FakeDevice(at_rest, record=True)) as server:
        fast = "deadline_s = 20.0\ntransfer_ms = 50.0\nlead_ms = 120.0"
        backend = section(tmp_path, server.address).replace("deadline_s = 20.0", fast)
        file = tmp_path / "frictus.toml"
        file.write_text(f'block_ms = 50.0\n[router]\nendpoint = "tcp/127.0.0.1:1"\n{backend}')
        result = run(file, "--json", "--yes")
        assert result.exit_code == Exit.OK, result.stdout
        assert np.abs(server.device.played_v).max() <= PEAK_V / 50.0
        assert server.device.output_v == 0.0
    told = {line["test"]: line for line in lines(result)}
    assert [line["verdict"] for line in told.values()] == [
        "ok",
        "ok",
        "ok",
        "skip",
        "skip",
        "skip",
    ]
    (delay,) = (each for each in told["loop-back"]["figures"] if "delay" in each["name"])
    # The tenth of ten channels is converted 0.9 samples after the edge that plays a sample,
    # and is moved back by as much.
    assert delay["value"] == pytest.approx(0.9, abs=0.02)


def test_nobody_is_asked_without_a_terminal(tmp_path: Path) -> None:
    file = configured(tmp_path, DEVICE.format(address="127.0.0.1:1"))
    result = run(file, "--json")
    assert result.exit_code == Exit.USAGE
    assert "--yes" in result.output


def test_a_device_that_does_not_answer_fails(tmp_path: Path) -> None:
    file = configured(tmp_path, DEVICE.format(address="127.0.0.1:1"))
    result = run(file, "--json", "--yes")
    assert result.exit_code == Exit.CHECK_FAILED
    told = lines(result)
    assert "no simulated device at 127.0.0.1:1" in told[0]["found"]
    assert {line["verdict"] for line in told[1:]} == {"skip"}


def test_the_configuration_is_named_as_of_every_other_command(tmp_path: Path) -> None:
    file = configured(tmp_path, DEVICE.format(address="127.0.0.1:1"))
    for words in (("--config", file), ("-c", file), (file,)):
        assert "no simulated device at 127.0.0.1:1" in run(*words, "--json", "--yes").stdout
    assert run(file, "-c", file, "--json", "--yes").exit_code == Exit.USAGE


def test_a_report_that_cannot_be_written_is_told_before(tmp_path: Path) -> None:
    result = run(configured(tmp_path, VIRTUAL), "--out", tmp_path / "no" / "report.json")
    assert result.exit_code == Exit.USAGE
    assert not result.stdout


def test_people_read_figures_with_units(capsys: pytest.CaptureFixture[str]) -> None:
    figure = Measure("delay", 1.25, "samples", 0.012)
    selftest.show(Outcome("loop-back", "warn", "late", "look", (figure,)), lines=False)
    assert capsys.readouterr().out.splitlines() == [
        "warn loop-back: late",
        "     look",
        "     delay 1.25 ± 0.012 samples",
    ]

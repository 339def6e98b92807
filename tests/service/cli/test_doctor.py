"""The checks of `frictus doctor`: device, disk, priority, clock."""

import itertools
import json
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numba import njit
from tests.hardware.nidaq.fake_device import FakeDevice
from tests.hardware.nidaq.fake_server import FakeServer, Fault
from tests.hardware.nidaq.wired import section
from typer.testing import CliRunner

from frictus_hardware import NiRigConfig, SimulatedConfig
from frictus_hardware.nidaq.settings import NeonodeSettings
from frictus_hardware.sensors import hid
from frictus_service.cli.app import app
from frictus_service.cli.checks import doctor, machine_checks, storage_checks
from frictus_service.cli.checks.machine_checks import Kept, leap_of
from frictus_service.cli.checks.service_checks import device_checks, ni_device
from frictus_service.config_file import parse
from frictus_service.daemon import preparation


@pytest.fixture
def server() -> Iterator[FakeServer]:
    with FakeServer(FakeDevice(lambda output_v, _: np.zeros((32, output_v.size)))) as server:
        yield server


@pytest.fixture
def backend(server: FakeServer, tmp_path: Path) -> NiRigConfig:
    config = parse(section(tmp_path, server.address), tmp_path / "frictus.toml")
    assert isinstance(config.backend, NiRigConfig)
    return config.backend


def found(backend: NiRigConfig) -> dict[str, machine_checks.DoctorCheck]:
    return {check.name: check for check in device_checks(backend)}


def test_a_simulated_rig_has_no_device() -> None:
    assert list(device_checks(SimulatedConfig())) == []


def test_driver_device_and_wiring_are_told(backend: NiRigConfig) -> None:
    checked = found(backend)
    assert list(checked) == ["driver", "device", "wiring", "sensors"]
    assert {check.verdict for check in checked.values()} == {"ok"}
    assert "NI-DAQmx 25" in checked["driver"].found
    assert "Dev1 is a PCIe-6323" in checked["device"].found
    assert "FT01234.cal" in checked["sensors"].found


def test_a_mismatch_names_its_line(backend: NiRigConfig) -> None:
    monitor = backend.monitor.model_copy(update={"channel": "ai40"})
    wrong = backend.model_copy(update={"monitor": monitor, "output": "ao7"})
    wiring = found(wrong)["wiring"]
    assert wiring.verdict == "fail"
    assert "backend.monitor.channel = ['ai40']" in wiring.found
    assert "backend.output = 'ao7'" in wiring.found


def test_a_device_that_is_not_there_fails(backend: NiRigConfig) -> None:
    device = found(backend.model_copy(update={"device": "Dev7"}))["device"]
    assert device.verdict == "fail"
    assert "backend.device = 'Dev7' is not there; present: Dev1" in device.found


def test_a_calibration_that_is_not_there_fails(backend: NiRigConfig) -> None:
    backend.force.calibration.unlink()
    sensors = found(backend)["sensors"]
    assert sensors.verdict == "fail"
    assert "FT01234.cal" in sensors.found


def test_a_server_that_refuses_fails(server: FakeServer, backend: NiRigConfig) -> None:
    server.plan(Fault(-50103, "GetDeviceAttributeString"))
    (driver,) = ni_device(backend)
    assert driver.verdict == "fail"
    assert "another program uses the device" in driver.found


def test_the_command_tells_of_the_device(server: FakeServer, tmp_path: Path) -> None:
    file = tmp_path / "frictus.toml"
    file.write_text(section(tmp_path, server.address).replace("ai17", "ai9"))
    result = CliRunner().invoke(
        app, ["doctor", "-c", str(file), "--router", "tcp/127.0.0.1:1", "--json"]
    )
    told = {line["name"]: line for line in map(json.loads, result.stdout.splitlines())}
    assert told["wiring"]["verdict"] == "fail"
    assert "backend.monitor.channel: ai9 is the second lead" in told["wiring"]["found"]
    assert {"driver", "device", "disk", "priority", "utc"} <= set(told)


def test_warm_tells_what_it_compiles(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    @njit
    def twice(value):  # type: ignore[no-untyped-def]
        return 2.0 * value

    monkeypatch.setattr(preparation, "warm_up", lambda *_: twice(1.0))
    monkeypatch.setattr(doctor, "keep_bytecode", lambda modules: len([*modules][:3]))
    arguments = ["doctor", "--warm", "-c", str(tmp_path / "none.toml")]
    arguments += ["--router", "tcp/127.0.0.1:1"]
    told = CliRunner().invoke(app, [*arguments, "--json"]).stdout.splitlines()
    assert json.loads(told[0]) == {"event": "compiling", "function": "twice"}
    text = "bytecode of 3 more modules is kept"
    assert json.loads(told[1]) == {"event": "bytecode", "text": text}
    assert json.loads(told[2])["event"] == "check"
    again = CliRunner().invoke(app, arguments).stdout
    assert "compiling" not in again  # it is there


class Hid:
    """A HID library on which one sensor is plugged in, or none."""

    def __init__(self, paths: list[bytes]) -> None:
        self._paths = paths
        self.closed = 0

    def enumerate(self, _vendor: int, _product: int) -> list[dict[str, Any]]:
        return [{"path": path, "serial_number": "", "usage_page": 0} for path in self._paths]

    def device(self) -> "Hid":
        return self

    def open_path(self, path: bytes) -> None:
        assert path in self._paths

    def close(self) -> None:
        self.closed += 1


@pytest.mark.parametrize(("paths", "verdict"), [([b"/dev/hidraw0"], "ok"), ([], "fail")])
def test_the_touch_sensor_is_looked_for(
    backend: NiRigConfig, monkeypatch: pytest.MonkeyPatch, paths: list[bytes], verdict: str
) -> None:
    library = Hid(paths)
    monkeypatch.setitem(sys.modules, "hid", library)
    sensed = backend.model_copy(update={"touch": NeonodeSettings()})
    sensor = found(sensed)["touch sensor"]
    assert sensor.verdict == verdict
    assert library.closed == len(paths)


def test_without_the_package_of_the_touch_sensor_the_check_fails(
    backend: NiRigConfig, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "hid", None)
    sensed = backend.model_copy(update={"touch": NeonodeSettings()})
    sensor = found(sensed)["touch sensor"]
    assert sensor.verdict == "fail"
    assert hid.INSTALL in sensor.found


@pytest.mark.parametrize(
    ("piece_s", "hours", "verdict"),
    [
        (0.01, 100.0, "ok"),
        (0.2, 100.0, "warn"),
        (0.6, 100.0, "fail"),
        (0.01, 4.0, "warn"),
        (0.01, 0.5, "fail"),
        (0.2, 0.5, "fail"),
    ],
)
def test_the_disk_is_judged_by_what_a_rig_makes(
    tmp_path: Path, piece_s: float, hours: float, verdict: str
) -> None:
    ticks = iter(piece_s / 2.0 * np.array([0, 2] * 100) + np.arange(200) // 2 * piece_s)
    free = round(52 * 20_000 * 3_600 * hours)
    check = machine_checks.disk_rate(
        tmp_path / "not" / "yet", 20_000.0, lambda: float(next(ticks)), lambda _place: free
    )
    assert check.verdict == verdict
    assert f"{hours:.3g} h of recording" in check.found
    assert f"{0.5 / piece_s:.3g} times" in check.found
    assert bool(check.to_do) == (verdict != "ok")
    assert list(tmp_path.iterdir()) == []


def test_a_fast_disk_is_told_without_powers_of_ten(tmp_path: Path) -> None:
    ticks = itertools.count(step=0.0004)
    check = machine_checks.disk_rate(
        tmp_path, 20_000.0, lambda: next(ticks), lambda _place: 10**12
    )
    assert "1,300 MB/s synced, 1,250 times" in check.found
    assert "1,000 GB" in check.found


def test_a_disk_that_cannot_be_written_fails(tmp_path: Path) -> None:
    def gone(_place: Path) -> int:
        raise OSError("gone")

    check = machine_checks.disk_rate(tmp_path, 20_000.0, free_bytes=gone)
    assert check.verdict == "fail"
    assert "gone" in check.found


def test_asking_for_real_time_changes_nothing() -> None:
    if not hasattr(os, "sched_getscheduler"):
        assert machine_checks.real_time_priority().verdict == "ok"
        return
    before = os.sched_getscheduler(0), os.sched_getparam(0)
    check = machine_checks.real_time_priority()
    assert check.verdict in {"ok", "warn"}
    assert "SCHED_FIFO 20" in check.found
    assert (os.sched_getscheduler(0), os.sched_getparam(0)) == before


def test_without_the_right_to_real_time_it_says_where_to_allow_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def refuse(*_args: object) -> None:
        raise PermissionError(1, "Operation not permitted")

    if not hasattr(os, "sched_setscheduler"):
        pytest.skip("this system has no SCHED_FIFO")
    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    check = machine_checks.real_time_priority()
    assert check.verdict == "warn"
    assert "LimitRTPRIO=20" in check.to_do


@pytest.mark.parametrize(
    ("kept", "verdict", "said"),
    [
        ((True, 3.0), "ok", "off by at most 3 ms"),
        ((True, None), "ok", "is synchronised"),
        ((True, 400.0), "warn", "off by at most 400 ms"),
        ((False, None), "warn", "is not synchronised"),
        (None, "warn", "not known"),
    ],
)
def test_the_clock_is_judged(kept: Kept | None, verdict: str, said: str) -> None:
    check = machine_checks.clock_synchronised(lambda: kept)
    assert check.verdict == verdict
    assert said in check.found
    assert bool(check.to_do) == (verdict != "ok")


def test_this_system_s_clock_can_be_asked() -> None:
    assert machine_checks.clock_synchronised().found


@pytest.mark.parametrize(
    ("status", "kept"),
    [
        ("Leap Indicator: 0(no warning)\nStratum: 4 (secondary)", (True, None)),
        ("Sprungindikator: 3(nicht synchronisiert)\nStratum: 0", (False, None)),
        ("", None),
    ],
)
def test_windows_is_understood_in_any_language(status: str, kept: Kept | None) -> None:
    assert leap_of(status) == kept


def test_folders_and_a_registry_that_cannot_be_used_are_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("songs")
    text = 'recordings = "file"\nstudies = "file/deeper"\n[registry]\nurl = "sqlite:///file"'
    config = parse(text, tmp_path / "frictus.toml")
    told = [*storage_checks.folders(config), *storage_checks.registry(config)]
    assert {check.verdict for check in told} == {"fail"}
    assert [check.found.split(":")[0] for check in told[:2]] == ["recordings", "studies"]
    assert all(f"{tmp_path / 'file'} is no folder" in check.found for check in told[:2])
    assert "is not a database of SQLite" in told[2].found
    assert len(told) == 3


def test_folders_and_a_registry_that_are_not_there_yet_can_be_made(tmp_path: Path) -> None:
    config = parse('studies = "a/b"', tmp_path / "frictus.toml")
    assert not [*storage_checks.folders(config), *storage_checks.registry(config)]
    assert not list(tmp_path.iterdir())

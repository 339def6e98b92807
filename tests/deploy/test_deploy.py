"""What `deploy/` and its page say fits: files load, commands parse, units verify."""

import re
import shutil
import subprocess
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import pytest
import typer
import yaml  # comes with distributed

from frictus_hardware.nidaq.driver import RESET_S
from frictus_service.cli.app import app
from frictus_service.config import Config
from frictus_service.config_file import load
from frictus_service.daemon.processes.supervisor import STOP_S
from frictus_service.processes import LOOP_PRIORITY, PUBLISHER_PRIORITY

ROOT: Final = Path(__file__).parents[2]
DEPLOY: Final = ROOT / "deploy"
COMPOSE: Final = DEPLOY / "compose" / "compose.yaml"
PAGE: Final = ROOT / "docs" / "deploy.md"
UNITS: Final = sorted((DEPLOY / "systemd").glob("*.service"))
INSTALLED: Final = "/opt/frictus/.venv/bin/frictus"
REMOTE_S: Final = 1.0
"""Deadline of a call to a remote device, unless configured."""
NAMED: Final = re.compile(r"(?:^    |bin/|Scripts\\)frictus(?:\.exe)? ([a-z]+(?: [^#\"]*)?)")


def quoted_commands(text: str) -> Iterator[str]:
    """Yield what stands between backticks and begins with `frictus`."""
    yield from re.findall(r"`frictus ([a-z][^`]*)`", text)


def commands() -> Iterator[str]:
    """Yield every command line of frictus in `deploy/` and its page, without the name."""
    files = [path for path in DEPLOY.rglob("*") if path.is_file()]
    for path in (PAGE, *files):
        yield from quoted_commands(path.read_text(encoding="utf-8"))
    for line in PAGE.read_text(encoding="utf-8").splitlines():
        if line.startswith("    "):
            yield from NAMED.findall(line)
    for unit in UNITS:
        yield from re.findall(rf"={INSTALLED} (.*)", unit.read_text(encoding="utf-8"))
    yield from (service["command"] for service in services().values())


def services() -> dict[str, Any]:
    """Return the services of the compose file."""
    found: dict[str, Any] = yaml.safe_load(COMPOSE.read_text(encoding="utf-8"))["services"]
    return found


def settings(unit: Path) -> dict[str, str]:
    """Return the settings of a unit; none of ours is given twice."""
    lines = re.findall(r"^(\w+)=(.*)$", unit.read_text(encoding="utf-8"), re.MULTILINE)
    assert len(dict(lines)) == len(lines)
    return dict(lines)


@pytest.mark.parametrize("line", sorted({line.strip() for line in commands()}))
def test_command_is_one_of_frictus(line: str) -> None:
    command: Any = typer.main.get_command(app)
    words = line.split()
    while hasattr(command, "commands"):
        assert words[0] in command.commands
        command = command.commands[words.pop(0)]
    with command.make_context(line, words):
        pass


def test_commands_were_found() -> None:
    found = list(commands())
    for command in ("serve", "rig", "router", "recorder", "api", "zero", "doctor", "pki"):
        assert any(line.split()[0] == command for line in found), command
    assert len(found) > 30


@pytest.mark.parametrize(
    "path", sorted(DEPLOY.rglob("*.toml")), ids=lambda path: path.relative_to(DEPLOY).as_posix()
)
def test_configuration_loads(path: Path) -> None:
    assert isinstance(load(path), Config)


def test_examples_of_one_site_fit_together() -> None:
    router, *others = (
        load(DEPLOY / "examples" / f"{name}.toml") for name in ("router", "rig1", "api", "desk")
    )
    assert router.router.host
    for other in others:
        assert not other.router.host
        assert other.router.endpoint == router.router.endpoint
        assert other.site == router.site
    assert router.tls("router") is not None
    assert others[0].tls("rig") is not None
    assert all(other.tls("client") is not None for other in others)


@pytest.mark.parametrize("unit", UNITS, ids=lambda unit: unit.name)
def test_unit_is_accepted_by_systemd(unit: Path, tmp_path: Path) -> None:
    analyze, stand_in = shutil.which("systemd-analyze"), shutil.which("true")
    if analyze is None or stand_in is None:
        pytest.skip("systemd-analyze is not installed")
    copy = tmp_path / unit.name
    copy.write_text(unit.read_text(encoding="utf-8").replace(INSTALLED, stand_in))
    done = subprocess.run([analyze, "verify", "--man=no", copy], capture_output=True, text=True)
    about_it = [line for line in done.stderr.splitlines() if "frictus" in line]
    assert not about_it
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("unit", UNITS, ids=lambda unit: unit.name)
def test_unit_leaves_time_to_start_and_to_stop(unit: Path) -> None:
    told = settings(unit)
    assert told["Type"] == "notify"
    assert told["KillMode"] == "mixed", "the supervisor ends its parts in order"
    assert float(told["TimeoutStopSec"]) > 3.0 * STOP_S
    longest_freeze_s = 10.0  # of limits.freeze_ms
    assert float(told["WatchdogSec"]) > longest_freeze_s + RESET_S + REMOTE_S
    assert "MemoryDenyWriteExecute" not in told


@pytest.mark.parametrize("name", ["frictus", "frictus-rig"])
def test_units_with_a_rig_let_it_have_real_time_and_devices(name: str) -> None:
    told = settings(DEPLOY / "systemd" / f"{name}.service")
    assert int(told["LimitRTPRIO"]) >= max(LOOP_PRIORITY, PUBLISHER_PRIORITY)
    assert told["ExecStopPost"].split()[1] == "zero"
    for broken in ("PrivateDevices", "RestrictRealtime", "CPUSchedulingPolicy"):
        assert broken not in told


def test_compose_runs_each_part_on_the_configuration_beside_it() -> None:
    parts = services()
    assert set(parts) == {"router", "rig", "recorder", "tracker", "api"}
    for name, service in parts.items():
        assert service["command"].split()[0] == name
        mounted = dict(volume.split(":")[:2] for volume in service["volumes"])
        assert mounted["./frictus.toml"] == service["command"].split()[-1]
    assert parts["rig"]["ulimits"]["rtprio"] >= LOOP_PRIORITY
    build = parts["router"]["build"]
    assert (COMPOSE.parent / build["context"]).resolve() == ROOT
    assert (ROOT / build["dockerfile"]).exists()
    config = load(COMPOSE.parent / "frictus.toml")
    assert config.api.loopback
    assert f"{config.api.host}:{config.api.port}/" in parts["api"]["healthcheck"]["test"][-1]


def test_image_is_made_of_files_that_are_there() -> None:
    text = (COMPOSE.parent / "Dockerfile").read_text(encoding="utf-8")
    admitted = (COMPOSE.parent / "Dockerfile.dockerignore").read_text(encoding="utf-8")
    assert 'ENTRYPOINT ["frictus"]' in text
    for line in re.findall(r"^COPY (.*)$", text, re.MULTILINE):
        for source in line.split()[:-1]:
            assert (ROOT / source).exists()
            assert f"!{source}\n" in admitted


def test_the_image_is_built_from_every_package() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    packages = project["tool"]["hatch"]["build"]["targets"]["wheel"]["packages"]
    image = (ROOT / "deploy" / "compose" / "Dockerfile").read_text(encoding="utf-8")
    copied = set(re.findall(r"^COPY (\w+) \1$", image, re.MULTILINE))
    assert {package.split("/")[0] for package in packages} <= copied

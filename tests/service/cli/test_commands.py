"""The commands against a rig on a real router: output, exit codes, clean ends."""

import json
import os
import re
import shlex
import signal
import subprocess
import sys
import wave
from collections.abc import Callable, Iterator
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import typer
from tests.clients.effect_files.made import ahap, continuous, event
from typer.testing import CliRunner

from frictus_service.cli.app import app
from frictus_service.cli.options import Exit
from frictus_service.config import Config

SINE = {"kind": "spectrum", "components": [{"amplitude_n": 0.1, "cycles_per_mm": 2.0}]}
NAMES = ("serve", "rig", "api", "play", "watch", "doctor", "demo", "bench")
NOWHERE = "tcp/127.0.0.1:1"


def run(*args: object) -> Any:
    return CliRunner().invoke(app, [str(arg) for arg in args])


def lines(result: Any) -> list[dict[str, Any]]:
    return [json.loads(line) for line in result.stdout.splitlines()]


def command(*args: object) -> list[str]:
    main = "from frictus_service.cli import main; main()"
    return [sys.executable, "-P", "-c", main, *map(str, args)]  # as the script: not from here


def test_a_rig_at_another_site_is_named_as_options_name_it(rig: Any, router: str) -> None:
    result = run("watch", "--router", router, "--site", "elsewhere")
    assert result.exit_code == Exit.NO_LINK
    assert f"--site {rig.keys.site} --rig {rig.keys.rig}" in result.stderr


@pytest.mark.parametrize("name", ["identify", "discover", "verify", "recover"])
def test_a_missing_file_is_named_in_words(name: str, tmp_path: Path) -> None:
    absent = tmp_path / "absent.h5"
    result = run(name, absent)
    assert result.exit_code == Exit.USAGE
    assert "there is no file" in result.stderr
    assert str(absent) in result.stderr
    assert "Errno" not in result.stderr


@pytest.mark.skipif(sys.platform == "win32", reason="a folder is refused as not permitted")
@pytest.mark.parametrize("name", ["verify", "recover", "track"])
def test_a_folder_in_place_of_a_file_is_named_in_words(name: str, tmp_path: Path) -> None:
    result = run(name, tmp_path)
    assert result.exit_code == Exit.USAGE
    assert result.stderr == f"frictus: {tmp_path} is a folder; give a file\n"


def commands(
    group: Any, names: tuple[str, ...] = ()
) -> Iterator[tuple[tuple[str, ...], list[Any]]]:
    """Yield each command's names and parameters."""
    for name, each in group.commands.items():
        if hasattr(each, "commands"):
            yield from commands(each, (*names, name))
        else:
            yield (*names, name), each.params


COMMANDS = list(commands(typer.main.get_command(app)))


@pytest.mark.parametrize(("names", "params"), COMMANDS, ids=[" ".join(c) for c, _ in COMMANDS])
def test_help_explains_each_parameter_and_shows_its_default(
    names: tuple[str, ...], params: list[Any]
) -> None:
    helps = {param.name: param.help or "" for param in params if param.name != "help"}
    assert all(helps.values()), helps
    shown = CliRunner().invoke(app, [*names, "--help"], env={"COLUMNS": "240"}).stdout
    defaults = re.findall(r"\[default: [^\]]*\]", " ".join(helps.values()))
    assert [default for default in defaults if default not in shown] == []


def test_a_paragraph_of_help_is_one_line() -> None:
    study = typer.main.get_command(app).commands["study"]  # type: ignore[attr-defined]
    said = study.commands["import"].help
    assert "one is proposed from names, units" in said
    assert all("\n" not in paragraph for paragraph in said.split("\n\n"))


@pytest.fixture
def sine(tmp_path: Path) -> Path:
    file = tmp_path / "sine.json"
    file.write_text(json.dumps(SINE))
    return file


def test_it_says_which_version_it_is() -> None:
    told = run("--version")
    assert (told.exit_code, told.stdout) == (0, f"frictus {version('frictus')}\n")


def test_help_lists_the_commands_and_loads_nothing_heavy() -> None:
    said = run("--help").stdout
    assert all(name in said for name in NAMES)
    heavy = {"fastapi", "numba", "scipy", "matplotlib", "zenoh", "numpy", "pydantic"}
    code = (
        "import sys; sys.argv = ['frictus', '--help']\n"
        "from frictus_service.cli import main\n"
        "try: main()\n"
        "except SystemExit: pass\n"
        f"found = {heavy!r} & set(sys.modules)\n"
        "sys.exit(f'loaded {found}' if found else 0)"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60, capture_output=True)


@pytest.mark.parametrize("name", NAMES)
def test_every_command_takes_json(name: str) -> None:
    result = run(name, "--help")
    assert result.exit_code == Exit.OK
    assert "--json" in result.stdout


def test_play_arms_sets_the_scene_reports_and_disarms(
    rig: Any, config: Path, sine: Path
) -> None:
    result = run("play", sine, "-c", config, "--gain", 0.5, "--seconds", 0.8)
    assert result.exit_code == Exit.OK, result.stderr
    calls = [call for call, _ in rig.calls]
    assert calls == ["arm", "scene", "disarm"]
    scene = rig.calls[1][1].scene
    assert scene.name == "sine"
    assert scene.regions[0].gain == 0.5
    said = lines(result)
    assert said[0]["event"] == "applied"
    assert said[0]["gain"] == 0.8
    assert said[-1]["event"] == "end"
    felt = [line for line in said if line["event"] == "felt"]
    assert len(felt) >= 2
    assert felt[-1]["finger"]["vx_mm_s"] == 60.0
    assert felt[-1]["state"] == "armed"
    assert felt[-1]["applied_gain"] == 0.8
    assert felt[-1]["friction_from"] == "truth"
    assert felt[-1]["friction_rms_n"] == pytest.approx(0.1 / np.sqrt(2.0), rel=0.02)
    assert felt[-1]["gaps"] == {}


@pytest.mark.parametrize("mode", ["none", "fixed:60", "fixed:37.5"])
def test_play_in_another_compensation_mode(
    rig: Any, config: Path, sine: Path, mode: str
) -> None:
    result = run("play", sine, "-c", config, "--compensation", mode, "--seconds", 0.8)
    assert result.exit_code == Exit.OK, result.stderr
    assert [call for call, _ in rig.calls] == ["arm", "scene", "compensation", "disarm"]
    assert str(rig.calls[2][1].compensation) == mode
    said = lines(result)
    assert said[0]["compensation"] == mode
    assert [line for line in said if line["event"] == "felt"][-1]["compensation"] == mode


@pytest.mark.parametrize(
    "mode", ["", "off", "fixed", "fixed:", "fixed:nan", "none:60", "fixed:0"]
)
def test_what_is_no_compensation_mode_is_a_usage_error(
    rig: Any, config: Path, sine: Path, mode: str
) -> None:
    result = run("play", sine, "-c", config, "--compensation", mode, "--seconds", 0.1)
    assert result.exit_code == Exit.USAGE
    assert "such as fixed:60" in result.stderr
    assert not rig.calls, "nothing is armed for it"


def test_play_takes_recordings_scenes_and_library_names(
    rig: Any, config: Path, tmp_path: Path, rng: np.random.Generator
) -> None:
    samples = rng.normal(0.0, 0.05, 400)
    csv, wav, scene = tmp_path / "a.csv", tmp_path / "b.wav", tmp_path / "c.json"
    csv.write_text("\n".join(f"{value:.6g}" for value in samples))
    with wave.open(str(wav), "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(20_000)
        file.writeframes((1e4 * samples).astype("<i2").tobytes())
    scene.write_text(json.dumps({"regions": [{"texture": SINE, "gain": 3.0}]}))
    library = tmp_path / "textures"
    library.mkdir()
    (library / "mine.json").write_text(json.dumps(SINE))
    effect = tmp_path / "d.ahap"
    effect.write_text(ahap(continuous(0.0, 12.0), event("AudioCustom", 0.0)))
    options = ("-c", config, "--seconds", 0.1)
    for args in (
        (csv, "--speed", 40, "--rate", 20_000),
        (wav, "--speed", 40, "--scale", 0.2),
        (scene,),
        ("mine",),
        (effect, "--part", "2:7", "--scale", 0.1),
    ):
        result = run("play", *args, *options)
        assert result.exit_code == Exit.OK, result.stderr
    scenes = [request.scene for call, request in rig.calls if call == "scene"]
    assert [s.regions[0].texture.kind for s in scenes] == [
        "profile",
        "profile",
        "spectrum",
        "spectrum",
        "profile",
    ]
    assert scenes[0].regions[0].texture.period_mm == pytest.approx(0.8)
    assert scenes[2].regions[0].gain == 3.0
    assert scenes[3].name == "mine"
    assert scenes[4].regions[0].texture.period_s == pytest.approx(5.0)


def test_what_cannot_be_played_is_a_usage_error(rig: Any, config: Path, tmp_path: Path) -> None:
    bad = tmp_path / "bad.json"
    bad.write_text('{"kind": "spectrum", "components": [{"amplitude_n": 1e999, "hz": 1}]}')
    column = tmp_path / "column.csv"
    column.write_text("1\n2\n")
    long = tmp_path / "long.csv"
    long.write_text("1\n2\n" * 200)
    scene = tmp_path / "scene.json"
    slope = {"kind": "slope", "peak_hz": 100, "low_order": 2, "high_order": 2, "rms_n": 0.1}
    scene.write_text(json.dumps({"regions": [{"texture": slope, "x": [0, 10]}]}))
    effect = tmp_path / "long.ahap"
    effect.write_text(ahap(continuous(0.0, 12.0)))
    for args, said in (
        (("missing.csv",), "missing.csv"),
        (("not-in-the-library",), "not-in-the-library"),
        ((bad,), "amplitude_n"),
        ((column, "--speed", 40), "rate"),
        ((column, "--speed", 40), "has one column: give its --rate"),
        ((long, "--rate", 10, "--speed", 40), "give as --part 25 s of it"),
        ((column, "--speed", -1, "--rate", 100), "--speed -1.0: must be positive"),
        ((scene,), "regions.0.x: Extra inputs are not permitted"),
        ((column, "--rate", 100, "--part", "1-2"), "--part 1-2: two times in s, such as 2:7.5"),
        ((effect, "--scale", 0.1), "give a part of it"),
    ):
        result = run("play", *args, "-c", config)
        assert result.exit_code == Exit.USAGE
        assert said in result.stderr
        assert result.stderr.startswith("frictus: ")
        assert "Traceback" not in result.stderr
    assert not rig.calls


def test_a_refusal_is_5(rig: Any, config: Path, sine: Path) -> None:
    rig.refusal = ("not_owner", "held by alice")
    result = run("play", sine, "-c", config)
    assert (result.exit_code, result.stderr) == (Exit.REFUSED, "frictus: held by alice\n")


def test_a_lost_lease_is_5(rig: Any, config: Path, sine: Path) -> None:
    rig.trip_after_scene = True
    result = run("play", sine, "-c", config, "--seconds", 20)
    assert result.exit_code == Exit.REFUSED
    assert "tripped" in result.stderr


def test_no_router_and_no_rig_are_4(router: str) -> None:
    for args in (
        ("watch", "--router", NOWHERE),
        ("watch", "--router", router, "--rig", "nobody"),
    ):
        result = run(*args)
        assert result.exit_code == Exit.NO_LINK
        assert result.stderr.count("\n") == 1


def test_a_bad_configuration_is_3_and_names_the_line(tmp_path: Path) -> None:
    file = tmp_path / "bad.toml"
    file.write_text('site = "lab"\n[api]\nprot = 1\n')
    for name in ("serve", "rig", "api", "watch"):
        result = run(name, "-c", file)
        assert result.exit_code == Exit.CONFIG
        assert "bad.toml:3" in result.stderr


@pytest.mark.parametrize(
    ("name", "parts", "host_router"),
    [
        ("serve", ("rig", "api", "recorder", "tracker"), None),
        ("rig", ("rig",), False),
        ("api", ("api",), False),
        ("recorder", ("recorder",), False),
        ("tracker", ("tracker",), False),
    ],
)
def test_services_start_their_parts(
    monkeypatch: pytest.MonkeyPatch,
    config: Path,
    name: str,
    parts: tuple[str, ...],
    host_router: bool | None,
) -> None:
    started = []

    def serve(
        settings: Config,
        parts: tuple[str, ...] = ("rig", "api"),
        host_router: bool | None = None,
        say: Callable[[str], None] = print,
    ) -> None:
        started.append((settings.rig, parts, host_router))
        say("ready")

    monkeypatch.setattr("frictus_service.daemon.processes.serve.serve", serve)
    result = run(name, "-c", config, "--json")
    assert result.exit_code == Exit.OK
    assert started == [("fake", parts, host_router)]
    assert lines(result)[-1]["text"] == "ready"
    assert "ready\n" in run(name, "-c", config).stderr


@pytest.mark.parametrize("name", ["serve", "api"])
def test_any_free_port_is_chosen_once_and_told(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, name: str
) -> None:
    file = tmp_path / "frictus.toml"
    file.write_text("[api]\nport = 0\n")
    ports = []

    def serve(settings: Config, *_: object, **_given: object) -> None:
        ports.append(settings.api.port)

    monkeypatch.setattr("frictus_service.daemon.processes.serve.serve", serve)
    told = run(name, "-c", file).stderr
    assert ports[0] > 0
    assert f"http://127.0.0.1:{ports[0]}/ " in told


def test_parts_that_are_not_wanted_are_not_started(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    file = tmp_path / "frictus.toml"
    file.write_text("[api]\nenabled = false\n[tracker]\nenabled = false\n")
    started = []

    def serve(_settings: Config, parts: tuple[str, ...], say: object) -> None:
        started.append(parts)

    monkeypatch.setattr("frictus_service.daemon.processes.serve.serve", serve)
    assert run("serve", "-c", file, "--json").exit_code == Exit.OK
    assert started == [("rig", "recorder")]


@pytest.mark.skipif(sys.platform == "win32", reason="no shell that closes streams there")
def test_a_standard_stream_that_is_closed_is_no_fault(tmp_path: Path) -> None:
    """And its number is not that of the database, into which parts would print."""
    quoted = shlex.join(command("models", "list"))
    for closed in (">&-", "2>&-", "<&-", "<&- >&- 2>&-"):
        shell = f"{quoted} {closed}"
        done = subprocess.run(shell, shell=True, cwd=tmp_path, capture_output=True, check=False)
        assert (done.returncode, done.stderr) == (Exit.OK, b"")


@pytest.mark.skipif(sys.platform == "win32", reason="a folder in use stays there")
def test_a_folder_that_is_gone_is_said_to_be(tmp_path: Path) -> None:
    gone = tmp_path / "gone"
    gone.mkdir()
    shell = f"rmdir {gone}; {shlex.join(command('models', 'list'))}"
    done = subprocess.run(shell, shell=True, cwd=gone, capture_output=True, check=False)
    assert done.returncode == Exit.USAGE
    assert b"change to another" in done.stderr


def test_usage_errors_are_2() -> None:
    for args in (("plya",), ("play",), ("watch", "--seconds", "soon"), ("watch", "--nope")):
        assert run(*args).exit_code == Exit.USAGE


def test_the_unexpected_is_1_and_debug_shows_it(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(_: object) -> None:
        raise ZeroDivisionError("by chance")

    monkeypatch.setattr("frictus_service.config_file.load", broken)
    result = run("watch")
    assert result.exit_code == Exit.UNEXPECTED
    assert "ZeroDivisionError: by chance" in result.stderr
    assert isinstance(run("--debug", "watch").exception, ZeroDivisionError)


def test_watch_counts_blocks_and_gaps(rig: Any, config: Path) -> None:
    rig.skips = True
    result = run("watch", "-c", config, "--seconds", 1.2)
    assert result.exit_code == Exit.OK
    last = lines(result)[-1]
    assert min(last["blocks_received"].values()) > 10
    assert last["state"] == "disarmed"
    assert set(last["gaps"]) == {"lost"}
    assert last["gaps"]["lost"] == sum(last["blocks_lost"].values())
    assert min(last["blocks_lost"].values()) >= 1
    assert not rig.calls


def test_several_rigs_need_a_name(rig: Any, config: Path) -> None:
    token = rig.session.liveliness().declare_token(rig.keys.alive.replace("fake", "other"))
    result = run("watch", "-c", config, "--seconds", 0.1)
    assert result.exit_code == Exit.NO_LINK
    assert "fake, other" in result.stderr
    assert run("watch", "-c", config, "--seconds", 0.1, "--rig", "fake").exit_code == Exit.OK
    token.undeclare()


@pytest.mark.skipif(os.name == "nt", reason="Windows has no SIGINT for one process")
@pytest.mark.usefixtures("interruptible")
def test_ctrl_c_disarms_and_is_130(rig: Any, config: Path, sine: Path) -> None:
    process = subprocess.Popen(
        command("play", sine, "-c", config), stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    try:
        assert rig.wait_for("scene")
        assert process.stdout is not None
        process.stdout.readline()
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=20)
    finally:
        process.kill()
        process.wait()
    assert process.returncode == Exit.INTERRUPTED
    assert said == b""
    assert rig.calls[-1][0] == "disarm"


def test_doctor_finds_the_rig(rig: Any, config: Path) -> None:
    result = run("doctor", "-c", config, "--json")
    found = {line["name"]: line for line in lines(result)}
    names = {"python", "packages", "compiled code", "configuration", "router", "clock", "timer"}
    assert names <= set(found)
    assert found["rig fake at lab"]["verdict"] == "ok"
    assert all(line["to_do"] for line in found.values() if line["verdict"] != "ok")
    plain = run("doctor", "-c", config).stdout
    assert "router: answers" in plain


def test_doctor_fails_with_6(tmp_path: Path) -> None:
    file = tmp_path / "bad.toml"
    file.write_text("site = 3\n")
    result = run("doctor", "-c", file, "--router", NOWHERE, "--json")
    found = {line["name"]: line["verdict"] for line in lines(result)}
    assert result.exit_code == Exit.CHECK_FAILED
    assert found["configuration"] == "fail"
    assert found["router"] == "warn"

"""Files that a command is given and that are none: each ends in a sentence and a code, soon."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from frictus.errors import ArgumentError
from frictus_service.cli.options import Exit, write_out

MAIN = "from frictus_service.cli import main; main()"
MEMORY = "import resource; resource.setrlimit(resource.RLIMIT_AS, (6 << 30, 6 << 30)); " + MAIN
LONG = "a" + ".a" * 50_000 + " = 1\n"
RECORDING = "time [s],Fx [N],Fz [N],x [mm]\n" + "".join(
    f"{k / 2000:.4f},0.1,0.4,{10 + k / 25:.2f}\n" for k in range(2000)
)
DESIGN = (
    """{"participants": 4, "tones_hz": [40, 120], "speeds_mm_s": [40, 80], "forces_n": [0.4]}"""
)

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="no pipes with names there")


def run(*args: object) -> tuple[int, str]:
    """Run a command that has 6 GB of addresses and 60 s."""
    done = subprocess.run(
        [sys.executable, "-c", MEMORY, *map(str, args)],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    return done.returncode, done.stderr


def pipe(path: Path) -> Path:
    os.mkfifo(path)
    return path


def of_20_gb(path: Path) -> Path:
    with path.open("wb") as file:
        file.truncate(20 << 30)
    return path


def link_to_itself(path: Path) -> Path:
    path.symlink_to(path)
    return path


COMMANDS = (
    ("study show", "x.h5"),
    ("study show --friction", "x.h5"),
    ("identify", "x.csv"),
    ("discover", "x.h5"),
    ("plan", "x.json"),
    ("export", "x.mcap"),
    ("verify", "x.mcap"),
    ("recover", "x.mcap"),
    ("replay", "x.mcap"),
    ("mount", "x.npy"),
    ("mount", "x.mat"),
    ("pki show", "x.pem"),
    ("models publish", "x.json"),
    ("play", "x.json"),
    ("experiment", "x.toml"),
    ("experiment detection --results --log", "x.jsonl"),
    ("study import rec.csv out.h5 --map", "x.toml"),
    ("study import rec.csv out.h5 --yes --mount", "x.json"),
    ("play linen --config", "x.toml"),
)


@pytest.mark.parametrize(("command", "name"), COMMANDS)
def test_a_pipe_is_refused_and_not_waited_for(
    command: str, name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "rec.csv").write_text(RECORDING)
    code, said = run(*command.split(), pipe(tmp_path / name))
    assert code == (Exit.CONFIG if "--config" in command else Exit.USAGE)
    assert name in said
    assert "file" in said
    assert "unexpected" not in said


@pytest.mark.parametrize(
    ("command", "name"),
    [
        ("play", "x.json"),
        ("plan", "x.json"),
        ("models publish", "x.json"),
        ("plan --base", "x.json"),
        ("pki show", "x.pem"),
        ("play linen --config", "x.toml"),
    ],
)
def test_of_a_file_without_end_a_bounded_part_is_read(
    command: str, name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "design.json").write_text(
        '{"schema": "design/1", "participants": 8, "tones_hz": [50], "speeds_mm_s": [20],'
        ' "forces_n": [0.2]}'
    )
    given = ["design.json"] if "--base" in command else []
    first, *others = command.split()
    code, said = run(first, *given, *others, of_20_gb(tmp_path / name))
    assert code == (Exit.CONFIG if "--config" in command else Exit.USAGE)
    assert "bytes" in said


@pytest.mark.parametrize(
    "command", ["play linen --config", "study import rec.csv out.h5 --map", "experiment"]
)
def test_a_key_of_many_parts_is_refused_at_once(
    command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "rec.csv").write_text(RECORDING)
    (tmp_path / "long.toml").write_text(LONG)
    code, said = run(*command.split(), "long.toml")
    assert code == (Exit.CONFIG if "--config" in command else Exit.USAGE)
    assert "more than 20 parts" in said


@pytest.mark.parametrize(
    ("command", "name"),
    [("identify", "x.csv"), ("verify", "x.mcap"), ("models publish", "x.json")],
)
def test_a_link_to_itself_is_named_in_words(command: str, name: str, tmp_path: Path) -> None:
    code, said = run(*command.split(), link_to_itself(tmp_path / name))
    assert code == Exit.USAGE
    assert said == f"frictus: {tmp_path / name}: a symbolic link that leads to itself\n"


@pytest.mark.parametrize("content", [b"", b"\0" * 200, b"NaN"])
@pytest.mark.parametrize("name", ["x.mat", "x.npy"])
def test_blows_that_are_none_are_refused(name: str, content: bytes, tmp_path: Path) -> None:
    (tmp_path / name).write_bytes(content)
    code, said = run("mount", tmp_path / name)
    assert code == Exit.USAGE
    assert "cannot be read" in said


def test_a_mount_that_is_no_text_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "rec.csv").write_text(RECORDING)
    (tmp_path / "mount.json").write_bytes("{}".encode("utf-16"))
    code, said = run("study", "import", "rec.csv", "out.h5", "--yes", "--mount", "mount.json")
    assert code == Exit.USAGE
    assert "no text in UTF-8" in said


CLEARS = "\\u001b[2J\\u202e"  # clears a terminal and turns the direction of writing


@pytest.mark.parametrize(
    ("command", "name", "content"),
    [
        ("play", "x.json", f'{{"kind": "{CLEARS}"}}'),
        ("play", "x.json", f'{{"kind": "spectrum", "{CLEARS}": 1, "components": []}}'),
        ("play", "x.ahap", f'{{"Pattern": [{{"Event": {{"EventType": "{CLEARS}"}}}}]}}'),
        ("experiment", "x.toml", f'name = "{CLEARS}"\n'),
        ("play linen --config", "x.toml", f'"{CLEARS}" = 1\n'),
    ],
)
def test_what_a_file_calls_itself_does_not_reach_the_terminal(
    command: str, name: str, content: str, tmp_path: Path
) -> None:
    (tmp_path / name).write_text(content)
    code, said = run(*command.split(), tmp_path / name)
    assert code in (Exit.USAGE, Exit.CONFIG)
    assert "\x1b" not in said
    assert "\u202e" not in said
    assert r"\x1b[2J\u202e" in said


@pytest.mark.parametrize(
    ("command", "name", "content"),
    [
        pytest.param("plan", "design.json", DESIGN, marks=pytest.mark.long),
        ("mount", "blows.npy", "no blows"),
        ("track", "pilot.mcap", "no recording"),
    ],
)
def test_what_is_read_is_not_written_over(
    command: str, name: str, content: str, tmp_path: Path
) -> None:
    file = tmp_path / name
    file.write_text(content)
    (tmp_path / "other").symlink_to(file)
    for out, why in (
        (file, "it is what is read"),
        (tmp_path / "other", "it is what is read"),
        (tmp_path, "that is a folder"),
        (tmp_path / "none" / "x", "there is no folder"),
    ):
        code, said = run(command, file, "--out", out)
        assert code == Exit.USAGE
        assert why in said
    assert file.read_text() == content


def test_a_folder_for_a_result_that_has_gone_meanwhile_is_named(tmp_path: Path) -> None:
    with pytest.raises(ArgumentError, match=r"--out .*x\.json: there is no folder .*gone"):
        write_out(tmp_path / "gone" / "x.json", b"{}")

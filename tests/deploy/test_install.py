"""Every line of `docs/install.md` installs what it says on a machine that has none of it."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Final

import pytest

ROOT: Final = Path(__file__).parents[2]
PAGE: Final = ROOT / "docs" / "install.md"
ROWS: Final = re.findall(
    r"^\| (\[.*\)) \| `(.*)` \| `(.*)` \|$", PAGE.read_text(encoding="utf-8"), re.MULTILINE
)
"""What, the line that installs it, a command that needs it."""
NEEDS: Final = {"npm": ("node", "npm"), "octave-cli": ("octave-cli",), "cc": ("cc",)}


def shell(line: str, folder: Path) -> "subprocess.CompletedProcess[str]":
    """Run a line of the page, with the environment of `folder` first on the path."""
    own = os.environ | {"PATH": f"{folder / 'own' / 'bin'}{os.pathsep}{os.environ['PATH']}"}
    own.pop("PYTHONPATH", None)
    return subprocess.run(
        ["sh", "-c", line],
        cwd=folder,
        env=own,
        capture_output=True,
        text=True,
        encoding="utf-8",
        timeout=580,
        check=False,
    )


def test_all_rows_are_read() -> None:
    lines = PAGE.read_text(encoding="utf-8").splitlines()
    assert len(ROWS) == sum(line.startswith("| [") for line in lines) > 0


@pytest.mark.long
@pytest.mark.timeout(600)
@pytest.mark.skipif(os.name == "nt", reason="the lines are run by a POSIX shell")
@pytest.mark.parametrize(("what", "install", "look"), ROWS, ids=[row[0] for row in ROWS])
def test_one_line_installs_it(what: str, install: str, look: str, tmp_path: Path) -> None:
    if not (ROOT / ".git").exists():
        pytest.skip("only a clone can be installed from")
    line = f"{install} && {look}"
    for word, programs in NEEDS.items():
        if word in line.split() and not all(map(shutil.which, programs)):
            pytest.skip(f"there is no {' or no '.join(programs)} here")
    subprocess.run([sys.executable, "-m", "venv", str(tmp_path / "own")], check=True)
    installed = shell(install.replace("ADDRESS", f"file://localhost{ROOT}"), tmp_path)
    assert installed.returncode == 0, installed.stdout + installed.stderr
    seen = shell(look, tmp_path)
    assert seen.returncode == 0 or "usage: " in seen.stderr, seen.stdout + seen.stderr
    assert seen.stdout or "usage: " in seen.stderr

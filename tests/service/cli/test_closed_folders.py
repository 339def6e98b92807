"""Folders and files of somebody else: one sentence that names them, before any work is done."""

import errno
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from frictus_service.cli.options import Exit, code_of, sentence_of

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="Windows has other rights")
RIGHTS = "-dac_override,-dac_read_search"


@pytest.fixture
def closed(tmp_path: Path) -> Iterator[Path]:
    folder = tmp_path / "closed"
    folder.mkdir()
    folder.chmod(0o555)
    yield folder
    folder.chmod(0o755)


def run(*args: object) -> tuple[int, str]:
    """Run a command as one whom the rights of files hold off, as they do not hold off root."""
    before = []
    if os.geteuid() == 0:
        if (setpriv := shutil.which("setpriv")) is None:
            pytest.skip("root may write what is read-only")
        before = [setpriv, "--bounding-set", RIGHTS]
    main = "from frictus_service.cli import main; main()"
    done = subprocess.run(
        [*before, sys.executable, "-c", main, *map(str, args)],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    return done.returncode, done.stdout + done.stderr


@pytest.mark.parametrize(
    ("command", "out"),
    [
        ("identify", "found"),
        ("discover", "found"),
        ("plan", "plan.json"),
        ("mount", "mount.json"),
        ("track", "model.json"),
        ("recover", "whole.mcap"),
        ("export", "study.h5"),
        ("export --to nwb", "archive"),
        ("export --to replay", "tape.npz"),
    ],
)
def test_a_folder_for_results_that_is_closed_is_named_before_anything_is_read(
    closed: Path, tmp_path: Path, command: str, out: str
) -> None:
    """A study was analysed first, or a rig tested; then came ``[Errno 13]``."""
    file = tmp_path / "x.h5"
    file.write_bytes(b"not even a study")
    code, told = run(*command.split(), file, "--out", closed / out)
    assert code == Exit.USAGE
    assert f"{closed / out if out == 'found' else closed}" in told
    assert f"nothing may be written in {closed}; " in told
    assert len(told.splitlines()) == 1


def test_what_may_not_be_looked_into_is_named_with_what_to_do(closed: Path) -> None:
    closed.chmod(0o000)
    file = closed / "x.mcap"
    code, told = run("verify", file)
    assert code == Exit.USAGE
    assert told.startswith(f"frictus: {file}: Permission denied; name what this user may read")


def test_a_full_disk_is_told_with_the_file_that_was_asked_for(tmp_path: Path) -> None:
    error = OSError(errno.ENOSPC, "No space left on device", str(tmp_path / "plan.json"))
    assert code_of(error) == Exit.USAGE
    told = sentence_of(error)
    assert (
        told
        == f"{error.filename}: No space left on device; make room there, or name another disk"
    )


def test_a_folder_below_one_that_may_not_be_looked_into_is_told(tmp_path: Path) -> None:
    """`doctor` and `serve` ended by it."""
    (tmp_path / "closed" / "in").mkdir(parents=True)
    (tmp_path / "closed").chmod(0o000)
    config = tmp_path / "frictus.toml"
    config.write_text('recordings = "closed/in/recordings"\n')
    code, told = run("doctor", "--config", config, "--json")
    (tmp_path / "closed").chmod(0o755)
    assert code == Exit.CHECK_FAILED, told
    found = [json.loads(line)["found"] for line in told.splitlines()]
    assert f"recordings: nothing may be written in {tmp_path / 'closed'}" in found

"""The TypeScript package, installed and compiled once for a test process."""

import atexit
import functools
import os
import shutil
import subprocess
import tempfile
from pathlib import Path

import pytest

SOURCE = Path(__file__).parents[2] / "clients" / "typescript"


def run(*command: str, folder: Path, **env: str) -> str:
    """Run a command of Node; what it prints is the fault where it fails."""
    executable = shutil.which(command[0])
    assert executable is not None
    done = subprocess.run(
        [executable, *command[1:]],
        cwd=folder,
        env=os.environ | env,
        capture_output=True,
        text=True,
        encoding="utf-8",
        timeout=200.0,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@functools.cache
def package() -> Path:
    """Return a folder with the package, what it is built with, and what was built.

    The registry is asked for the few packages of `devDependencies`; where there is none, or no
    Node, the test is skipped.
    """
    for name in ("node", "npm"):
        if shutil.which(name) is None:
            pytest.skip(f"there is no {name} here: Node 20 or newer brings it")
    folder = Path(tempfile.mkdtemp(prefix="frictus-typescript-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    left_out = shutil.ignore_patterns("node_modules", "build", "*.tgz", "package-lock.json")
    shutil.copytree(SOURCE, folder, dirs_exist_ok=True, ignore=left_out)
    try:
        run("npm", "ping", folder=folder)
    except (AssertionError, subprocess.TimeoutExpired):
        pytest.skip("the registry of npm cannot be reached")
    quiet = ("--no-audit", "--no-fund", "--no-package-lock", "--ignore-scripts")
    run("npm", "install", *quiet, folder=folder)
    run("npm", "run", "build", folder=folder)
    return folder


def node_modules() -> Path:
    """Return what the package is built with."""
    return package() / "node_modules"

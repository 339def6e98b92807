"""A private PostgreSQL server on this machine, for as long as it is entered."""

import contextlib
import os
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from frictus_service.processes import free_port

INSTALL_S = 100.0
USER = "postgres"


class NoServerError(RuntimeError):
    """Why there is no server."""


def binaries() -> Path | None:
    """Return the folder of `initdb` and `pg_ctl`, the newest version's; None if absent."""
    installed = Path("/usr/lib/postgresql").glob("*/bin/initdb")
    if found := max(installed, key=lambda path: path.parts[-3].zfill(4), default=None):
        return found.parent
    on_path = shutil.which("initdb")
    return Path(on_path).resolve().parent if on_path else None


def install() -> None:
    """Install the server where that is one quiet command."""
    if sys.platform == "win32" or not shutil.which("apt-get"):
        raise NoServerError("initdb is not on the PATH: install PostgreSQL")
    if os.geteuid() != 0:
        raise NoServerError("initdb is not on the PATH: sudo apt-get install postgresql")
    # Another process of the same test run may be at it.
    wait = ["-o", f"DPkg::Lock::Timeout={INSTALL_S / 2.0:.0f}"]
    quietly = ["-y", "-qq", "--no-install-recommends"]
    command = ["apt-get", *wait, "install", *quietly, "postgresql"]
    try:
        done = subprocess.run(
            command,
            env={**os.environ, "DEBIAN_FRONTEND": "noninteractive"},
            capture_output=True,
            text=True,
            timeout=INSTALL_S,
        )
    except subprocess.TimeoutExpired as error:
        raise NoServerError(f"apt-get did not end within {INSTALL_S:g} s") from error
    if done.returncode != 0:
        said = (done.stderr or done.stdout).strip().splitlines() or ["no reason"]
        raise NoServerError(f"apt-get could not install it: {said[-1]}")


def unprivileged(folder: Path) -> list[str]:
    """Return what runs a command as somebody for whom PostgreSQL runs: never root.

    What it runs ends with the tests, even where they are killed.
    """
    setpriv = shutil.which("setpriv")
    if sys.platform == "win32" or (os.geteuid() != 0 and setpriv is None):
        return []
    if setpriv is None:
        raise NoServerError("PostgreSQL does not run for root, and there is no setpriv")
    mortal = [setpriv, "--pdeathsig", "QUIT"]
    if os.geteuid() != 0:
        return mortal
    shutil.chown(folder, USER)
    return [*mortal, "--reuid", USER, "--regid", USER, "--init-groups"]


def wait_until_ready(found: Path, port: int, process: "subprocess.Popen[bytes]") -> None:
    ask = [str(found / "pg_isready"), "-q", "-h", "127.0.0.1", "-p", str(port)]
    while subprocess.run(ask).returncode != 0:
        if process.poll() is not None:
            raise NoServerError(f"PostgreSQL ended with {process.returncode} as it started")


@contextlib.contextmanager
def server() -> Iterator[str]:
    """Run a cluster of our own; give the URL of its databases."""
    if binaries() is None:
        install()
    found = binaries()
    if found is None:
        raise NoServerError("apt-get installed it, but there is no initdb")
    with tempfile.TemporaryDirectory(prefix="frictus-pg-") as name:
        as_user = unprivileged(Path(name))
        data, null = str(Path(name) / "data"), subprocess.DEVNULL
        made = [*as_user, str(found / "initdb"), "-D", data, "-U", USER, "-A", "trust", "-N"]
        if (ended := subprocess.run(made, stdout=null, stderr=null, cwd=name).returncode) != 0:
            raise NoServerError(f"initdb ended with {ended}")
        # Clients crash in these tests, the server does not: it need not sync.
        begun = [*as_user, str(found / "postgres"), "-D", data, "-k", "", "-c", "fsync=off"]
        process, port = started(found, begun, name)
        try:
            yield f"postgresql+psycopg://{USER}@127.0.0.1:{port}/"
        finally:
            process.send_signal(signal.SIGINT)
            process.wait()


def started(
    found: Path, command: list[str], folder: str, attempts: int = 3
) -> tuple["subprocess.Popen[bytes]", int]:
    """Start a server, and return it and its port, once it answers."""
    port, null = free_port(), subprocess.DEVNULL
    where = ["-h", "127.0.0.1", "-p", str(port)]
    process = subprocess.Popen([*command, *where], stdout=null, stderr=null, cwd=folder)
    try:
        wait_until_ready(found, port, process)
    except NoServerError:
        if attempts == 1:
            raise
        return started(found, command, folder, attempts - 1)  # the port may be another's now
    return process, port

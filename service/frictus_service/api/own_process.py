"""A command of frictus in a process of its own: for files that may take a process down."""

import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from frictus_service.api.problems import InvalidError

_MAIN: Final = "from frictus_service.cli import main; main()"


def run_command(arguments: Sequence[str], timeout_s: float, file: Path, name: str) -> bytes:
    """Run a command on a file and return what it says on its standard output.

    Parameters
    ----------
    arguments : sequence of str
        Of the command line.
    timeout_s : float
        After which it is ended.
    file : Path
        That it reads.
    name : str
        What the file is called where somebody is told of it.

    Raises
    ------
    InvalidError
        If the command refuses, in its words; if it takes too long, or ends by a signal.
    """
    try:
        done = subprocess.run(
            [sys.executable, "-P", "-c", _MAIN, *arguments],
            stdin=subprocess.DEVNULL,
            capture_output=True,
            timeout=timeout_s,
            check=False,
        )
    except subprocess.TimeoutExpired:
        raise InvalidError(
            f"{name}: to read it takes more than {timeout_s:g} s; use `frictus {arguments[0]}` "
            "on the machine of the service, which may take as long as it likes"
        ) from None
    if done.returncode != 0:
        said = done.stderr.decode("utf-8", "replace").strip().removeprefix("frictus: ")
        raise InvalidError(
            said.replace(str(file), name) or f"{name} cannot be read: it may be damaged"
        )
    return done.stdout

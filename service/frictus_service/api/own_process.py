"""Commands of frictus in processes of their own: for files that may take a process down."""

import subprocess
import sys
import threading
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import IO, Any, Final

from frictus_service.api.problems import BusyError, InvalidError

_MAIN: Final = "from frictus_service.cli import main; main()"
MOST_BYTES: Final = 16_000_000
"""Of what a command says: a file may hold more text than this machine has memory."""
MOST_TOLD: Final = 4_000
"""Characters of a complaint."""
_ENDS_WITH_ITS_INPUT: Final = """
import contextlib, os, threading

with contextlib.suppress(OSError), open("/proc/self/oom_score_adj", "w") as score:
    score.write("1000")

def end():
    while os.read(0, 1):
        pass
    os._exit(1)

threading.Thread(target=end, daemon=True).start()
"""
"""The system closes the input of a process whose service was killed; and where a file takes all
memory, Linux ends the process that reads it, and no rig."""


class OwnProcesses:
    """Runs commands; none of them outlives the service that asked for it."""

    def __init__(self) -> None:
        self._changing = threading.Lock()
        self._running: set[subprocess.Popen[bytes]] = set()
        self._closed = False

    def run(self, arguments: Sequence[str], timeout_s: float, file: Path, name: str) -> bytes:
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
        BusyError
            If the service is stopping.
        """
        with self._begun(arguments) as process, ThreadPoolExecutor(2) as reading:
            try:
                said, complaint = (
                    reading.submit(_said, process, pipe)
                    for pipe in (process.stdout, process.stderr)
                )
                process.wait(timeout_s)
            except subprocess.TimeoutExpired:
                raise InvalidError(
                    f"{name}: to read it takes more than {timeout_s:g} s; use `frictus "
                    f"{arguments[0]}` on the machine of the service, which may take longer"
                ) from None
            finally:
                process.kill()
                with self._changing:
                    self._running.discard(process)
        if self._closed:
            raise _stopping()
        if process.returncode != 0:
            told = complaint.result().decode("utf-8", "replace").strip()
            told = told.removeprefix("frictus: ").replace(str(file), name)
            raise InvalidError(told[:MOST_TOLD] or f"{name} cannot be read: it may be damaged")
        return said.result()

    def close(self) -> None:
        """End what runs; nothing begins any more."""
        with self._changing:
            self._closed = True
            for process in self._running:
                process.kill()

    def _begun(self, arguments: Sequence[str]) -> subprocess.Popen[bytes]:
        pipes: dict[str, Any] = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.PIPE)
        command = [sys.executable, "-P", "-c", _ENDS_WITH_ITS_INPUT + _MAIN, *arguments]
        with self._changing:
            if self._closed:
                raise _stopping()
            process = subprocess.Popen(command, **pipes)
            self._running.add(process)
            return process


def _said(process: subprocess.Popen[bytes], pipe: IO[bytes] | None) -> bytes:
    """Return what a process says on a pipe; one that says too much is ended."""
    assert pipe is not None
    said = pipe.read(MOST_BYTES)
    if len(said) == MOST_BYTES:
        process.kill()
    return said


def _stopping() -> BusyError:
    return BusyError("the service is stopping: ask again when it runs")

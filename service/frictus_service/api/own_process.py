"""Commands of frictus in processes of their own: for files that may take a process down."""

import subprocess
import sys
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

from frictus_service.api.problems import BusyError, InvalidError

_MAIN: Final = "from frictus_service.cli import main; main()"
_ENDS_WITH_ITS_INPUT: Final = """
import os, threading

def end():
    while os.read(0, 1):
        pass
    os._exit(1)

threading.Thread(target=end, daemon=True).start()
"""
"""The system closes the input of a process whose service was killed."""


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
        with self._begun(arguments) as process:
            # Its input is held until the end; `communicate` would close it at once.
            held, process.stdin = process.stdin, None
            assert held is not None
            try:
                said, complaint = process.communicate(timeout=timeout_s)
            except subprocess.TimeoutExpired:
                raise InvalidError(
                    f"{name}: to read it takes more than {timeout_s:g} s; use `frictus "
                    f"{arguments[0]}` on the machine of the service, which may take longer"
                ) from None
            finally:
                process.kill()
                held.close()
                with self._changing:
                    self._running.discard(process)
        if self._closed:
            raise _stopping()
        if process.returncode != 0:
            told = complaint.decode("utf-8", "replace").strip().removeprefix("frictus: ")
            raise InvalidError(
                told.replace(str(file), name) or f"{name} cannot be read: it may be damaged"
            )
        return said

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


def _stopping() -> BusyError:
    return BusyError("the service is stopping: ask again when it runs")

"""The log of an experiment: one JSON object a line, each on the disk before the next trial."""

import json
import os
from pathlib import Path
from typing import Any, Final

from frictus.closing import Closing
from frictus.errors import ArgumentError, NotLoggedError
from frictus.files import read_bounded, require_file, sync_folder

FORMAT: Final = "frictus-experiment/1"
MAX_LOG_BYTES: Final = 200_000_000
MAX_LINE_BYTES: Final = 10_000_000
MAX_ROWS: Final = 200_000


def read_log(path: Path) -> tuple[list[dict[str, Any]], int]:
    """Read the rows of a log.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    rows : list of dict
        The header, then the trials.
    whole_bytes : int
        Where the last whole line ends; a line that a crash tore follows.

    Raises
    ------
    ArgumentError
        If it is not such a log; the text says which line.
    FileNotFoundError
        If there is no such file.
    """
    content = read_bounded(path, MAX_LOG_BYTES)
    whole_bytes = content.rfind(b"\n") + 1
    lines = content[:whole_bytes].split(b"\n")[:-1]
    if len(lines) > MAX_ROWS:
        raise ArgumentError(f"{path}: {len(lines)} lines; at most {MAX_ROWS} are read")
    rows: list[dict[str, Any]] = []
    for number, line in enumerate(lines, 1):
        try:
            row = json.loads(line) if len(line) <= MAX_LINE_BYTES else None
        except (ValueError, RecursionError):
            row = None
        if not isinstance(row, dict):
            raise ArgumentError(
                f"{path}, line {number}: not a JSON object of a log; without it and what "
                "follows, the experiment goes on from there"
            )
        rows.append(row)
    if rows and rows[0].get("format") != FORMAT:
        raise ArgumentError(f"{path}: its first line is no header of {FORMAT}")
    return rows, whole_bytes


class TrialLog(Closing):
    """Appends rows to a log; a context manager.

    A line that a crash tore is cut off when the log is opened: its trial was not finished.

    Parameters
    ----------
    path : Path
        The file; its folder exists.

    Attributes
    ----------
    rows : list of dict
        What the log holds.
    """

    def __init__(self, path: Path) -> None:
        if path.exists():
            require_file(path)
        self._file = path.open("ab", buffering=0)  # creates it
        try:
            self.rows, whole_bytes = read_log(path)
            self._file.truncate(whole_bytes)
            self._whole_bytes = whole_bytes
            sync_folder(path.parent)
        except BaseException:
            self._file.close()
            raise

    def append(self, row: dict[str, Any]) -> None:
        """Write a row; it is on the disk when this returns, and no part of it when it raises.

        Parameters
        ----------
        row : dict
            What JSON can hold; no NaN and no infinity.

        Raises
        ------
        NotLoggedError
            If the disk does not take it, or another file bears the name, or none.
        """
        line = json.dumps(row, allow_nan=False, separators=(",", ":")).encode() + b"\n"
        try:
            self._look_in_place()
            written = self._file.write(line)
            if written != len(line):  # a full disk takes what fits
                raise OSError(f"the disk took {written} of {len(line)} bytes; make room there")
            os.fsync(self._file.fileno())
        except OSError as error:
            self._file.truncate(self._whole_bytes)
            raise NotLoggedError(
                f"this trial is not logged in {self._file.name}: {error}. Begun anew with the "
                "same log, the experiment goes on"
            ) from error
        self._whole_bytes += len(line)
        self.rows.append(row)

    def require_in_place(self) -> None:
        """Raise if what is appended would not be found under the log's name.

        Raises
        ------
        NotLoggedError
            If another file bears the name, or none.
        """
        try:
            self._look_in_place()
        except OSError as error:
            raise NotLoggedError(f"{self._file.name} takes no more trials: {error}") from error

    def _look_in_place(self) -> None:
        try:
            named = os.stat(self._file.name)
        except FileNotFoundError:
            named = None
        if named is None or not os.path.samestat(named, os.fstat(self._file.fileno())):
            raise OSError("the file was deleted, moved or replaced meanwhile; put it back")

    def close(self) -> None:
        """Close the file. Closing twice is harmless."""
        self._file.close()

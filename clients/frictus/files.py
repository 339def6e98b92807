"""Files that anybody may have named, read bounded and whole; names that the disk is to keep."""

import errno
import os
import re
import tomllib
from pathlib import Path
from typing import Any, Final

from frictus.errors import UnreadableFileError

MAX_TOML_BYTES: Final = 10_000_000
_FORMULA: Final = re.compile(r"[=+\-@].")
_LONG_KEY: Final = re.compile(
    r"""(?<![\w-])(?:(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+){20}""", re.ASCII
)


def require_file(path: Path) -> None:
    """Raise if a path stands for a pipe or a device, whose end nobody knows.

    Parameters
    ----------
    path : Path
        Of a file; a folder passes, and is refused by whoever opens it.

    Raises
    ------
    UnreadableFileError
        If it is a pipe, a socket or a device.
    OSError
        If it is not there or cannot be reached.
    """
    path.stat()
    if not (path.is_file() or path.is_dir()):
        raise UnreadableFileError(
            errno.EINVAL, "a pipe or a device; save what it gives, and name that file", path
        )


def read_bounded(path: Path, most_bytes: int) -> bytes:
    """Return the content of a file.

    Parameters
    ----------
    path : Path
        Of the file.
    most_bytes : int
        That are read of it.

    Raises
    ------
    UnreadableFileError
        If it is longer, or `require_file` raises it.
    OSError
        If it cannot be read.
    """
    require_file(path)
    with path.open("rb") as file:
        content = file.read(most_bytes + 1)
    if len(content) > most_bytes:
        raise UnreadableFileError(errno.EFBIG, f"more than {most_bytes} bytes", path)
    return content


def inert_cell(text: str) -> str:
    """Return the cell of a table that a spreadsheet shows, and does not run as a formula.

    Parameters
    ----------
    text : str
        What begins with ``=``, ``+``, ``-`` or ``@``, and is no number, has ``'`` before it.
    """
    if not _FORMULA.match(text):
        return text
    try:
        float(text)
    except ValueError:
        return f"'{text}"
    return text


def read_toml(text: str) -> dict[str, Any]:
    """Return what a TOML document holds.

    Parameters
    ----------
    text : str
        Without the mark that editors on Windows put before it.

    Raises
    ------
    ValueError
        If it is no TOML; the text says where.
    """
    if _LONG_KEY.search(text):  # it would be read for minutes
        raise ValueError("a key of more than 20 parts")
    try:
        return tomllib.loads(text)
    except RecursionError as error:
        raise ValueError("lists or tables within each other, too deep") from error


def sync_folder(folder: Path) -> None:
    """Have the disk keep the names in a folder; Windows does so with the files.

    Parameters
    ----------
    folder : Path
        Not below it.
    """
    if os.name != "posix":
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)

"""Files that are replaced whole, also where a crash or a power cut comes in between.

A reader finds the old content or the new one, never a part of either.
"""

import os
import secrets
from pathlib import Path


def replace_file(path: Path, content: bytes) -> None:
    """Write a file over what stands there; it is on the disk when this returns.

    Parameters
    ----------
    path : Path
        Its folder exists.
    content : bytes

    Raises
    ------
    OSError
        If the disk refuses; what stood there stands there still.
    """
    beside = path.with_name(f".{path.stem}-{secrets.token_hex(4)}.tmp")
    try:
        beside.write_bytes(content)
        put_in_place(beside, path)
    except BaseException:
        beside.unlink(missing_ok=True)
        raise


def put_in_place(written: Path, path: Path) -> None:
    """Give a file that was written and closed its name, and have the disk keep both.

    Parameters
    ----------
    written : Path
        In the folder of `path`.
    path : Path
        What it is to be called; what stands there is replaced.
    """
    with written.open("rb+") as file:
        os.fsync(file.fileno())
    os.replace(written, path)
    sync_folder(path.parent)


def sync_folder(folder: Path) -> None:
    """Have the disk keep the names in a folder; Windows does so with the files."""
    if os.name != "posix":
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)

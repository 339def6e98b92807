"""Files and folders that are replaced whole, also where a crash or a power cut comes between.

A reader finds the old content or the new one, never a part of either.
"""

import contextlib
import errno
import glob
import os
import re
import secrets
import shutil
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path, PurePath
from typing import Final

from frictus.files import sync_folder
from frictus_service.errors import StudyError

LEFT_S: Final = 86_400.0
"""What is unfinished and so old was left by a process that was killed."""
MOST_KEPT: Final = 48
"""Letters of a name in that of what is unfinished; in UTF-8 one takes up to four bytes."""
READ_S: Final = 0.5
"""How long a reader may keep a file from being replaced, where a file that is open is kept."""
_NO_LINKS: Final = frozenset({errno.EPERM, errno.ENOSYS, errno.ENOTSUP, errno.EOPNOTSUPP})


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
    replace_files({path: content})


def replace_files(contents: Mapping[Path, bytes]) -> None:
    """Write files that belong together over what stands there; all are on the disk then.

    All of them are written before any bears its name: a full disk, and nearly every kill,
    leaves those of before, and no report beside another one's document.

    Parameters
    ----------
    contents : mapping of Path to bytes
        Of each file; its folder exists.

    Raises
    ------
    OSError
        If the disk refuses.
    """
    written = {path: unfinished_beside(path) for path in contents}
    try:
        for path, content in contents.items():
            with blamed_on(path):
                written[path].write_bytes(content)
                _sync_file(written[path])
        for path, beside in written.items():  # at once: a disk is slow to keep anything
            _rename(beside, path)
        for folder in dict.fromkeys(path.parent for path in contents):
            sync_folder(folder)
        for path in contents:
            remove_left_beside(path)
    except BaseException:
        for beside in written.values():
            beside.unlink(missing_ok=True)
        raise


@contextmanager
def blamed_on(path: Path) -> Iterator[None]:
    """Have errors name the file that was asked for, not the hidden one beside it.

    Parameters
    ----------
    path : Path
        What was asked for.
    """
    try:
        yield
    except OSError as error:
        if error.errno is not None:
            error.filename = str(path)
        raise


def file_of(error: OSError) -> str:
    """Return the name of the file that an error is of, for whom its folder does not concern.

    Parameters
    ----------
    error : OSError
        Of the system; it may name none.
    """
    return PurePath(str(error.filename or "")).name or "a file of its own"


def unfinished_beside(path: Path) -> Path:
    """Return a name for what is not finished yet, which nobody takes for a file.

    Parameters
    ----------
    path : Path
        What it is to be called; one as long as a file system takes leaves no room for more.
    """
    # Not by process id: in a container it comes again, and meets what a kill left behind.
    return path.with_name(f".{path.name[:MOST_KEPT]}.{secrets.token_hex(4)}.part")


def put_in_place(written: Path, path: Path) -> None:
    """Give a file that was written and closed its name, and have the disk keep both.

    Parameters
    ----------
    written : Path
        In the folder of `path`.
    path : Path
        What it is to be called; what stands there is replaced.
    """
    _sync_file(written)
    _rename(written, path)
    sync_folder(path.parent)


def _rename(written: Path, path: Path) -> None:
    until_s = time.monotonic() + READ_S
    while True:
        try:
            os.replace(written, path)
            return
        except PermissionError:  # of Windows, while another thread or process reads the file
            if time.monotonic() >= until_s:
                raise
            time.sleep(0.01)


def put_in_free_place(written: Path, path: Path) -> None:
    """As `put_in_place`, but where something bears the name, it stays, whenever it came.

    Parameters
    ----------
    written : Path
        In the folder of `path`.
    path : Path
        What it is to be called.

    Raises
    ------
    FileExistsError
        If something bears the name; what was written stays where it is.
    """
    _sync_file(written)
    if os.name != "posix":
        os.rename(written, path)  # refuses there, where POSIX would replace
        return
    try:
        os.link(written, path)
    except OSError as error:
        if error.errno not in _NO_LINKS:
            raise
        # No links on this file system. The name is taken exclusively all the same, but it is
        # that of an empty file for a moment, and stays so where the process is killed then.
        path.touch(exist_ok=False)
        try:
            os.replace(written, path)
        except BaseException:
            path.unlink()
            raise
    else:
        written.unlink()
    sync_folder(path.parent)


def _sync_file(written: Path) -> None:
    with written.open("rb+") as file:
        os.fsync(file.fileno())


def left_behind(folder: Path, prefix: str) -> Iterator[Path]:
    """Yield what processes that were killed have left unfinished: nothing else is so old.

    Parameters
    ----------
    folder : Path
        Looked into, not below.
    prefix : str
        Of the names of what is unfinished.
    """
    for left in folder.glob(f"{glob.escape(prefix)}*"):
        with contextlib.suppress(FileNotFoundError):  # it has just been finished
            if time.time() - left.lstat().st_mtime > LEFT_S:
                yield left


def remove_left_beside(path: Path) -> None:
    """Remove what those have left who were killed while they wrote a file or a folder.

    Parameters
    ----------
    path : Path
        What `unfinished_beside` was asked for; its folder exists.
    """
    prefix = f".{path.name[:MOST_KEPT]}."
    for left in left_behind(path.parent, prefix):
        if re.fullmatch(r"[0-9a-f]{8}\.part", left.name.removeprefix(prefix)):
            with contextlib.suppress(OSError):  # somebody else's, or gone already
                shutil.rmtree(left) if left.is_dir() else left.unlink()


def why_closed(folder: Path) -> str | None:
    """Return why nothing can be written in a folder; None where it is open, or can be made.

    Parameters
    ----------
    folder : Path
        It need not be there yet, nor what is above it.
    """
    above = (folder, *folder.absolute().parents)
    there = next(each for each in above if os.path.exists(each))  # False below a closed one
    if not there.is_dir():
        return f"{there} is no folder"
    if not os.access(there, os.W_OK | os.X_OK):
        return f"nothing may be written in {there}"
    return None


@contextmanager
def scratch_beside(path: Path) -> Iterator[Path]:
    """Give a folder for what a result is made from, on the disk of the result.

    That of temporary files may be memory. What a kill leaves of it is removed with what it
    leaves of the result.

    Parameters
    ----------
    path : Path
        What the result is to be called.
    """
    folder = unfinished_beside(path)
    with blamed_on(path):
        folder.mkdir(parents=True)
    try:
        yield folder
    finally:
        shutil.rmtree(folder)


@contextmanager
def new_folder(folder: Path) -> Iterator[Path]:
    """Give a folder to write to, which bears its name once the context ends without an error.

    Parameters
    ----------
    folder : Path
        What it is to be called.

    Raises
    ------
    StudyError
        If something bears the name already.
    """
    if folder.exists():
        raise StudyError(f"{folder} exists; choose another name, or delete it first")
    unfinished = unfinished_beside(folder)
    with blamed_on(folder):
        unfinished.mkdir(parents=True)
    remove_left_beside(folder)
    try:
        yield unfinished
        unfinished.rename(folder)
        sync_folder(folder.parent)
    except BaseException as error:
        shutil.rmtree(unfinished)
        if isinstance(error, OSError) and error.errno == errno.ENOSPC:
            error.filename = str(folder)  # writers name what is gone now, or nothing
        raise

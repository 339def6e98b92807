"""Jobs that one process holds against others, until it lets go or ends, however it ends.

One file beside the folder of all jobs is locked byte by byte, each job at a place of its own:
a thousand jobs that wait take one open file.
"""

import contextlib
import hashlib
import os
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Final

_OPEN: Final[dict[Path, tuple[int, set[str]]]] = {}
"""Of each folder of jobs the descriptor and the jobs that are held: one of a process for all,
since closing any other would let go of everything."""
_HOLDING: Final = threading.Lock()


def hold(root: Path, job: str) -> bool:
    """Return whether a job is this process's now; False where another one holds it.

    Where the folder cannot be written, or its file system knows no locks, nothing is held, and
    every process is told that the job is its own.

    Parameters
    ----------
    root : Path
        Folder of all jobs.
    job : str
        Id.
    """
    with contextlib.suppress(OSError), _locks(root) as (descriptor, held):
        if job not in held:
            try:
                _lock(descriptor, _place(job))
            except (BlockingIOError, PermissionError):  # as systems say that it is locked
                return False
            held.add(job)
    return True


def let_go(root: Path, job: str) -> None:
    """Let go of a job, if this process holds it.

    Parameters
    ----------
    root : Path
        Folder of all jobs.
    job : str
        Id.
    """
    if root not in _OPEN:
        return
    with contextlib.suppress(OSError), _locks(root) as (descriptor, held):
        if job in held:
            held.remove(job)
            _unlock(descriptor, _place(job))


@contextlib.contextmanager
def _locks(root: Path) -> Iterator[tuple[int, set[str]]]:
    """Give the descriptor of a folder's locks, and the jobs that are held; closed with none."""
    with _HOLDING:
        if root not in _OPEN:
            path = root.with_name(f".{root.name}.locks")
            _OPEN[root] = os.open(path, os.O_RDWR | os.O_CREAT, 0o666), set()
        descriptor, held = _OPEN[root]
        try:
            yield descriptor, held
        finally:
            if not held:
                del _OPEN[root]
                os.close(descriptor)


def _place(job: str) -> int:
    """Return where the byte of a job lies: Windows locks none behind the first 2**31."""
    return int.from_bytes(hashlib.sha256(job.encode()).digest()[:4]) >> 1


if sys.platform == "win32":
    import msvcrt

    def _lock(descriptor: int, place: int) -> None:
        os.lseek(descriptor, place, os.SEEK_SET)
        msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)

    def _unlock(descriptor: int, place: int) -> None:
        os.lseek(descriptor, place, os.SEEK_SET)
        msvcrt.locking(descriptor, msvcrt.LK_UNLCK, 1)

else:
    import fcntl

    def _lock(descriptor: int, place: int) -> None:
        fcntl.lockf(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB, 1, place)

    def _unlock(descriptor: int, place: int) -> None:
        fcntl.lockf(descriptor, fcntl.LOCK_UN, 1, place)

"""Jobs that one process holds against others, until it lets go or ends, however it ends.

One file beside the folder of all jobs is locked byte by byte, each job at a place of its own:
a thousand jobs that wait take one open file.
"""

import contextlib
import hashlib
import os
import sys
import threading
from pathlib import Path
from typing import Final

_OPEN: Final[dict[Path, tuple[int, set[str]]]] = {}
"""Of each folder of jobs the descriptor and the jobs that are held: one of a process for all,
since closing any other would let go of everything."""
_HOLDING: Final = threading.Lock()


def hold(root: Path, job: str) -> bool:
    """Return whether a job is this process's now; False where another one holds it.

    Where the folder cannot be written, or its file system knows no locks, and on Windows,
    nothing is held, and every process is told that the job is its own.

    Parameters
    ----------
    root : Path
        Folder of all jobs.
    job : str
        Id.
    """
    if sys.platform == "win32":
        return True
    import fcntl

    with _HOLDING:
        descriptor, held = _OPEN.get(root, (-1, set[str]()))
        if job in held:
            return True
        try:
            if descriptor < 0:
                descriptor = os.open(
                    root.with_name(f".{root.name}.locks"), os.O_RDWR | os.O_CREAT, 0o666
                )
            fcntl.lockf(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB, 1, _place(job))
            held.add(job)
        except (BlockingIOError, PermissionError):
            return descriptor < 0  # it could not be opened
        except OSError:
            return True
        finally:
            if held:
                _OPEN[root] = descriptor, held
            elif descriptor >= 0:
                os.close(descriptor)
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
    if sys.platform == "win32":
        return
    import fcntl

    with _HOLDING:
        descriptor, held = _OPEN.get(root, (-1, set[str]()))
        if job not in held:
            return
        held.remove(job)
        if not held:
            del _OPEN[root]
            os.close(descriptor)
            return
        with contextlib.suppress(OSError):
            fcntl.lockf(descriptor, fcntl.LOCK_UN, 1, _place(job))


def _place(job: str) -> int:
    return int.from_bytes(hashlib.sha256(job.encode()).digest()[:7])

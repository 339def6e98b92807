"""The folder of recordings: what is in it, and which of it is finished."""

from dataclasses import dataclass
from pathlib import Path

from mcap.writer import MCAP0_MAGIC

from frictus_service.recording.recording import SUFFIX


@dataclass(frozen=True, slots=True)
class Shelved:
    """One recording of the folder.

    Attributes
    ----------
    path : Path
        Of the file.
    size : int
        Bytes.
    modified_s : float
        UTC, s since 1970.
    finished : bool
        Ended in order; otherwise it is being written, or was torn.
    """

    path: Path
    size: int
    modified_s: float
    finished: bool


def shelved(folder: Path) -> list[Shelved]:
    """Return the recordings of a folder, the newest first; none where there is no folder."""
    found = []
    for path in folder.glob(f"*{SUFFIX}"):
        try:
            stat = path.stat()
            finished = is_finished(path)
        except FileNotFoundError:
            continue  # somebody has just moved it
        found.append(Shelved(path, stat.st_size, stat.st_mtime, finished))
    return sorted(found, key=lambda one: one.modified_s, reverse=True)


def is_finished(path: Path) -> bool:
    """Return whether a file ends as a finished recording does; its checksums are not looked at.

    Parameters
    ----------
    path : Path
        Of the file.
    """
    length = len(MCAP0_MAGIC)
    with path.open("rb") as file:
        size = file.seek(0, 2)
        file.seek(max(0, size - length))
        return size > length and file.read() == MCAP0_MAGIC


def unfinished(folder: Path) -> Path | None:
    """Return the newest recording of a folder if it was torn, else None."""
    newest = next(iter(shelved(folder)), None)
    return None if newest is None or newest.finished else newest.path

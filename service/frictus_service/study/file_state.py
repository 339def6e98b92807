"""Whether a study is still the one that it was: what is read in parts must be of one study."""

import hashlib
import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from frictus_service.errors import StudyError


def state_of(path: Path) -> str:
    """Return what changes when a study does: a hash of the place, size and time of its files.

    Parameters
    ----------
    path : Path
        Of a file, or of a folder: all files in it count.

    Raises
    ------
    OSError
        If it is not there.
    """
    files = sorted(one for one in path.rglob("*") if one.is_file()) if path.is_dir() else [path]
    found = [(str(file.resolve()), file.stat()) for file in files]
    asked = [[place, stat.st_size, stat.st_mtime_ns] for place, stat in found]
    return hashlib.sha256(json.dumps(asked).encode()).hexdigest()


@contextmanager
def unchanged(path: Path | str) -> Iterator[None]:
    """Refuse what is read of a study that changes meanwhile.

    Workers open it by its name, one later than the other, and its hash is taken apart from
    its trials: of a study that somebody writes or replaces they would see parts of two.

    Parameters
    ----------
    path : Path or str
        Of the study.

    Raises
    ------
    StudyError
        At the end, if it has changed; in place of what reading it ended with, too.
    """
    before = _state_if_there(Path(path))
    try:
        yield
    except (StudyError, OSError) as error:
        _require(before, Path(path), error)
        raise
    _require(before, Path(path))


def _require(before: str | None, path: Path, error: Exception | None = None) -> None:
    after = _state_if_there(path)
    if after == before:
        return
    if after is None:
        raise StudyError(
            f"{path} was deleted or moved while it was read; put it back and start again"
        ) from error
    raise StudyError(
        f"{path} changed while it was read, so that parts of two files may have been; "
        "start again once nobody writes to it"
    ) from error


def _state_if_there(path: Path) -> str | None:
    try:
        return state_of(path)
    except OSError:  # whoever reads it says what is wrong
        return None

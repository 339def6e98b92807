"""What the disk has under the name of a SQLite registry, looked at before SQLite opens it.

SQLite itself says of a folder that it cannot be opened, of a pipe that the disk fails, and asks
of neither what was meant.
"""

import os
import stat
from typing import Final

from frictus_service.errors import RegistryUnavailableError

_MAGIC: Final = b"SQLite format 3\0"
"""What each file of SQLite begins with; one without tables may be empty."""
_TO_DO: Final = (
    "correct registry.url in the configuration, or move it away: a new registry is then made"
)


def require_sqlite_file(path: str) -> None:
    """Raise where something else than a SQLite file bears the name.

    A name that nothing bears, or that may not be looked at, is left to SQLite.

    Parameters
    ----------
    path : str
        Nothing is written to it.

    Raises
    ------
    RegistryUnavailableError
        If it is a folder, a pipe, a device or a file of another kind.
    """
    try:
        mode = os.stat(path).st_mode
        begins = _first_bytes(path) if stat.S_ISREG(mode) else b""
    except OSError:
        return
    if stat.S_ISDIR(mode):
        raise RegistryUnavailableError(
            f"the registry {path} is a folder: have registry.url in the configuration name a "
            f"file in it, such as {path.rstrip('/')}/frictus.db"
        )
    if not stat.S_ISREG(mode):
        raise RegistryUnavailableError(
            f"the registry {path} is a pipe or a device, and no file of SQLite: {_TO_DO}"
        )
    if begins and begins != _MAGIC:
        raise RegistryUnavailableError(
            f"the registry {path} is not a database of SQLite: {_TO_DO}; or put a backup back "
            "(docs/registry.md)"
        )


def _first_bytes(path: str) -> bytes:
    with open(path, "rb") as file:
        return file.read(len(_MAGIC))

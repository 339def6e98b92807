"""Names that may become names of files, on every system."""

import re
from typing import Final

RESERVED: Final = re.compile(r"(con|prn|aux|nul|com[0-9]|lpt[0-9])(\..*)?", re.IGNORECASE)
"""Devices on Windows, whatever extension follows."""


def of_a_file(name: str) -> str:
    """Return a name if a file on Linux and on Windows can bear it.

    Parameters
    ----------
    name : str
        Without folders.

    Raises
    ------
    ValueError
        If it ends with a dot, as ``.`` and ``..`` do, or is a device on Windows.
    """
    if name.endswith("."):
        raise ValueError(
            f"{name!r} ends with a dot, which no file on Windows may: leave it out"
        )
    if RESERVED.fullmatch(name):
        raise ValueError(f"{name!r} is the name of a device on Windows: choose another")
    return name

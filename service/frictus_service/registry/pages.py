"""Cursors of lists: opaque to callers, a key of the last row to us."""

import base64
import binascii
from typing import Final

from frictus_service.registry.errors import CursorError

_LARGEST: Final = 2**31 - 1


def cursor_of(key: str) -> str:
    """Return the cursor that stands for the last row's key."""
    return base64.urlsafe_b64encode(key.encode()).decode().rstrip("=")


def key_of(cursor: str) -> str:
    """Return the key that a cursor stands for.

    Raises
    ------
    CursorError
        If it is no cursor.
    """
    try:
        padded = cursor + "=" * (-len(cursor) % 4)
        return base64.b64decode(padded, altchars=b"-_", validate=True).decode("ascii")
    except (binascii.Error, ValueError) as error:
        raise CursorError(
            f"`after` {cursor[:80]!r} is not a cursor: give `next` of the page before"
        ) from error


def number_of(cursor: str) -> int:
    """Return the number that a cursor stands for.

    Raises
    ------
    CursorError
        If it is none.
    """
    key = key_of(cursor)
    if not key.isdecimal() or int(key[:12]) > _LARGEST:
        raise CursorError(f"`after` {cursor[:80]!r} belongs to another list")
    return int(key)

"""Values of JSON documents that anybody may have written; every refusal says where."""

import json
from typing import Any, Final

from frictus.errors import TextureError

MAX_ENTRIES: Final = 100_000
"""Of one list."""
LARGEST: Final = 1e9
"""Magnitude of a number."""


def parsed(text: str | bytes) -> dict[str, Any]:
    """Parse a document whose outermost value is an object.

    Parameters
    ----------
    text : str or bytes
        JSON.

    Raises
    ------
    TextureError
        If it is none.
    """
    try:
        document = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise TextureError(f"not a JSON document: {error}") from error
    return item(document, "document")


def item(value: Any, where: str) -> dict[str, Any]:
    """Return the value if it is an object.

    Parameters
    ----------
    value : object
        As parsed.
    where : str
        Its place in the document.

    Raises
    ------
    TextureError
    """
    if not isinstance(value, dict):
        raise TextureError(f"{where}: an object was expected")
    return value


def child(parent: dict[str, Any], name: str, where: str) -> dict[str, Any]:
    """Return the object `name` of an object.

    Parameters
    ----------
    parent : dict
        The object that holds it.
    name : str
        What it is called.
    where : str
        Place of the parent.

    Raises
    ------
    TextureError
        If there is none.
    """
    return item(parent.get(name), f"{where}.{name}")


def items(
    parent: dict[str, Any], name: str, where: str, optional: bool = False
) -> list[tuple[str, dict[str, Any]]]:
    """Return the objects of the list `name`, each with its place in the document.

    Parameters
    ----------
    parent, name, where
        See `child`.
    optional : bool
        A list that is missing is empty.

    Raises
    ------
    TextureError
        If there is no list, it is longer than `MAX_ENTRIES`, or holds something else.
    """
    value = parent.get(name, [] if optional else None)
    if not isinstance(value, list):
        raise TextureError(f"{where}: a list {name!r} was expected")
    if len(value) > MAX_ENTRIES:
        raise TextureError(f"{where}.{name}: {len(value)} entries; at most {MAX_ENTRIES}")
    places = (f"{where}.{name}[{number}]" for number in range(len(value)))
    return [(place, item(entry, place)) for place, entry in zip(places, value, strict=True)]


def number(
    parent: dict[str, Any], name: str, where: str, default: float | None = None
) -> float:
    """Return the number `name` of an object, or the default where it is missing.

    Parameters
    ----------
    parent, name, where
        See `child`.
    default : float or None
        None: it must be there.

    Raises
    ------
    TextureError
        If it is missing without a default, not a number, or above 1e9.
    """
    value = parent.get(name, default)
    if value is None and name not in parent:
        raise TextureError(f"{where}: {name} is missing")
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise TextureError(f"{where}: {name} must be a number, not {str(value)[:40]!r}")
    if not abs(value) <= LARGEST:  # refuses NaN and infinity too
        raise TextureError(f"{where}: {name} is not finite, or above {LARGEST:g}")
    return float(value)


def within(
    parent: dict[str, Any],
    name: str,
    where: str,
    low: float,
    high: float,
    default: float | None = None,
) -> float:
    """Return the number `name` if it lies in a range.

    Parameters
    ----------
    parent, name, where, default
        See `number`.
    low, high : float
        The range, both within.

    Raises
    ------
    TextureError
        If it does not, or `number` raises.
    """
    value = number(parent, name, where, default)
    if not low <= value <= high:
        raise TextureError(f"{where}: {name} {value:g}; {low:g} to {high:g} accepted")
    return value


def word(parent: dict[str, Any], name: str, where: str, default: str | None = None) -> str:
    """Return the first 100 characters of the text `name` of an object, or the default.

    Parameters
    ----------
    parent, name, where
        See `child`.
    default : str or None
        Where it is missing; None: it must be there.

    Raises
    ------
    TextureError
        If it is no text.
    """
    value = parent.get(name, default)
    if not isinstance(value, str):
        raise TextureError(f"{where}: {name} must be text, not {str(value)[:40]!r}")
    return value[:100]

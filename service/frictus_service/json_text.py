"""JSON as the service reads and names it: read in slices, hashed as an ETag.

One call of a parser holds the interpreter's lock from the first byte to the last, and the block
loop needs that lock. The standard library's scanner that is written in Python gives way between
two values, but takes ten times as long; so the items of a list, which make a body long, go to
the fast parser in slices.
"""

import codecs
import hashlib
import json
from collections.abc import Callable
from json import decoder, scanner
from pathlib import Path
from typing import Any, Final

from pydantic import BaseModel
from pydantic_core import from_json

from frictus.files import read_bounded


def etag_of(message: BaseModel) -> str:
    """Return a short hash of what a message says, whatever the order of its keys."""
    content = message.model_dump(mode="json", by_alias=True)
    canonical = json.dumps(content, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(canonical.encode()).hexdigest()[:16]


def etag_of_scene(scene: BaseModel) -> str:
    """Return a short hash of a scene or an excitation, which may be megabytes long.

    It hashes the document as it is published, its keys in the order of the fields: a tenth of
    the time of `etag_of`, in which a rig's loop waits for the interpreter.
    """
    return hashlib.sha256(scene.model_dump_json(by_alias=True).encode()).hexdigest()[:16]


def without_mark(text: bytes) -> bytes:
    """Return a text in UTF-8 without the mark that editors on Windows put before it."""
    return text.removeprefix(codecs.BOM_UTF8)


MAX_FILE_BYTES: Final = 50_000_000
"""Of a model, a design or a discovery's report, which has some MB."""


def read_file(path: Path) -> bytes:
    """Return the JSON text of a file that people may have edited.

    Raises
    ------
    OSError
        If it cannot be read; of which `UnreadableFileError` where it is too long or no file.
    """
    return without_mark(read_bounded(path, MAX_FILE_BYTES))


SLICE_CHARACTERS: Final = 16_384
"""About 0.1 ms for the fast parser."""

Scan = Callable[[str, int], tuple[Any, int]]


def read_sliced(payload: bytes) -> Any:
    """Return what a JSON document holds.

    Parameters
    ----------
    payload : bytes
        JSON text in UTF-8.

    Raises
    ------
    ValueError
        If it is not JSON, is nested too deeply, or holds text that UTF-8 does not: half of a
        surrogate pair, which the standard library reads and nobody could write again.
    """
    try:
        return _SlicedDecoder().decode(payload.decode())
    except RecursionError:
        raise ValueError("nested too deeply") from None


class _SlicedDecoder(json.JSONDecoder):
    def __init__(self) -> None:
        super().__init__()
        self.parse_array = _parse_list
        self.parse_object = _parse_object
        self.parse_string = _parse_string
        self.scan_once = scanner.py_make_scanner(self)  # type: ignore[attr-defined]


def _parse_string(text: str, start: int, strict: bool = True) -> tuple[str, int]:
    value, end = decoder.scanstring(text, start, strict)  # type: ignore[attr-defined]
    value.encode()  # raises a ValueError
    return value, end


def _parse_object(*given: Any) -> tuple[dict[str, Any], int]:
    value, end = decoder.JSONObject(*given)  # type: ignore[attr-defined]
    for key in value:
        key.encode()
    return value, end


def _parse_list(text_and_start: tuple[str, int], scan: Scan) -> tuple[list[Any], int]:
    """Return a list, and where the text goes on.

    What is JSON up to a comma is JSON however it goes on, so each slice that the fast parser
    takes is a run of whole items. Where it takes none (strings and lists that hold commas and
    brackets), the list is read item by item.
    """
    text, start = text_and_start
    values: list[Any] = []
    while True:
        stop = text.find("]", start, start + SLICE_CHARACTERS)
        closed = stop >= 0
        if not closed:
            last = start + SLICE_CHARACTERS
            stop = text.rfind("},", start, last) + 1 or text.rfind(",", start, last)
        items = text[start : max(stop, start)]
        if not closed and not items.strip():
            break
        try:
            values += from_json(f"[{items}]")
        except ValueError:
            break
        start = stop + 1
        if closed:
            return values, start
    return decoder.JSONArray(text_and_start, scan)  # type: ignore[attr-defined, no-any-return]

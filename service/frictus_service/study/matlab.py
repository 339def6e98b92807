"""Variables of a MATLAB level 5 file, bounded before they are read.

The file is walked before scipy reads it: how much it unfolds to, how deeply it nests and how
many elements its arrays declare is bounded first, since a few bytes may declare any number of
gigabytes or levels. Layout: MathWorks, MAT-File Format, level 5.
"""

import math
import struct
import warnings
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

from frictus_service.errors import StudyError

MAX_BYTES: Final = 800_000_000
"""Unfolded."""
MAX_STRUCTS_DEEP: Final = 8
MAX_ELEMENTS: Final = 100_000
HEADER: Final = 128
OCTAVE_TEXT: Final = b"# Created by Octave"
MATRIX, COMPRESSED = 14, 15
FLAGS_BYTES: Final = 16
"""Of the element that a matrix begins with; its class is the low byte of the flags."""
SPARSE, OPAQUE = 5, 17
"""Classes whose arrays hold less than they declare, or declare nothing; scipy bounds them."""


def read_variables(path: Path) -> dict[str, Any]:
    """Return the variables of a file by name; a struct as scipy's `mat_struct`.

    Parameters
    ----------
    path : Path

    Raises
    ------
    StudyError
        If it is too large, too deeply nested or damaged, if two variables have one name, or one
        cannot be read.
    """
    from scipy.io import loadmat

    _check_bounds(path)
    with warnings.catch_warnings():
        warnings.filterwarnings("error", "Duplicate variable|Unreadable variable")
        # An object of MATLAB, as a session of NI-DAQ, is no array; scipy < 1.18 calls it None.
        warnings.filterwarnings("ignore", 'Duplicate variable name "None"')
        try:
            read = loadmat(path, struct_as_record=False, squeeze_me=False)
        except Warning as warning:
            said = str(warning).splitlines()[0]
            raise StudyError(f"{said}; save it again, each variable once") from warning
    return {name: value for name, value in read.items() if not name.startswith("__")}


def _check_bounds(path: Path) -> None:
    """Raise where a file unfolds to too much, or nests too deeply."""
    if path.stat().st_size > MAX_BYTES:
        raise StudyError(f"it is larger than {MAX_BYTES >> 20} MiB; cut the recording")
    with path.open("rb") as stream:
        header = stream.read(HEADER)
        order = {b"IM": "<", b"MI": ">"}.get(header[126:128])
        if header.startswith(OCTAVE_TEXT):
            raise StudyError(
                "it is Octave's own text, which `save` writes unless told otherwise; save it "
                "again with -v7"
            )
        if order is None:
            raise StudyError("its header is damaged; accepted: MATLAB level 5 or 7.3")
        total = 0
        while tag := stream.read(8):
            kind, length = _tag(tag, order)
            whole = stream.read(length)
            if len(whole) < length:
                raise StudyError("it is cut short; restore it from a copy, or save it again")
            if kind == COMPRESSED:
                whole = _unfolded(whole, MAX_BYTES - total)
            total += len(whole)
            if total > MAX_BYTES:
                raise StudyError(f"it unfolds to more than {MAX_BYTES >> 20} MiB; cut it")
            _check_depth(whole, order, kind)


def _tag(data: bytes, order: str) -> tuple[int, int]:
    if len(data) < 8:
        raise StudyError("it is cut short; restore it from a copy, or save it again")
    kind, length = struct.unpack(order + "II", data)
    return kind, length


def _unfolded(data: bytes, most: int) -> bytes:
    unzip = zlib.decompressobj()
    try:
        whole = unzip.decompress(data, most + 1)
    except zlib.error as error:
        raise StudyError(f"it is damaged ({error}); restore it from a copy") from error
    return whole


def _check_depth(whole: bytes, order: str, kind: int) -> None:
    """Raise where matrices lie in matrices too deeply, or there are too many of them."""
    spans = [(0, len(whole), 1 if kind == MATRIX else 0)]
    if kind == MATRIX:
        _check_dimensions(whole, order)
    seen = 0
    while spans:
        begin, end, depth = spans.pop()
        if depth > MAX_STRUCTS_DEEP:
            raise StudyError(
                f"structs lie in it more than {MAX_STRUCTS_DEEP} deep; save them flat"
            )
        for inner_kind, first, last in _elements(whole, begin, end, order):
            seen += 1
            if seen > MAX_ELEMENTS:
                raise StudyError(f"it holds more than {MAX_ELEMENTS} elements; save it flat")
            if inner_kind == MATRIX:
                _check_dimensions(whole[first:last], order)
                spans.append((first, last, depth + 1))


def _check_dimensions(matrix: bytes, order: str) -> None:
    """Raise where an array declares more elements than it has bytes."""
    if len(matrix) < FLAGS_BYTES + 8:  # an empty one
        return
    (flags,) = struct.unpack_from(order + "I", matrix, 8)
    at = FLAGS_BYTES + 8
    kind, length = _tag(matrix[FLAGS_BYTES:at], order)
    if kind >> 16:  # a small element: its length is in the upper half
        at, length = at - 4, kind >> 16
    if flags & 0xFF in (SPARSE, OPAQUE):
        return
    sizes = struct.iter_unpack(order + "I", matrix[at : at + length // 4 * 4])
    count = math.prod(size for (size,) in sizes)
    if count > len(matrix):
        raise StudyError(f"an array of it declares {count:,} elements and holds fewer; cut it")


def _elements(whole: bytes, at: int, end: int, order: str) -> Iterator[tuple[int, int, int]]:
    while at + 8 <= end:
        kind, length = _tag(whole[at : at + 8], order)
        if kind >> 16:  # a small element: type, length and data in eight bytes
            at += 8
            continue
        yield kind, at + 8, min(at + 8 + length, end)
        at += 8 + length + (-length % 8)

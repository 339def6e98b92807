"""Looking into an HDF5 file, which may be damaged anywhere, written by whichever program.

MATLAB writes every number as a float and a scalar as an array of one; other programs write text
as bytes of fixed length. All of that is the same value.
"""

import math
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Final

import h5py
import numpy as np
from numpy.typing import NDArray

from frictus.files import require_file
from frictus_service.errors import FieldError, StudyError, as_told

MAX_WHOLE: Final = 2.0**53
"""A float, as MATLAB writes it, tells greater whole numbers from one another no more."""
Plain = str | float | int | tuple[float, ...]


def plain(value: Any) -> Plain | None:
    """Return the value of an attribute; None if it is neither text in UTF-8 nor numbers."""
    try:
        return _plain(value)
    except UnicodeDecodeError:
        return None


def _plain(value: Any) -> Plain | None:
    if value is None:
        return value
    if isinstance(value, str):  # h5py escapes what is not UTF-8
        value = value.encode(errors="surrogateescape")
    if isinstance(value, bytes):
        return value.decode()
    if type(value).__name__ == "Empty":  # h5py's, for a null dataspace: MATLAB's []
        return ()
    array = np.asarray(value)
    if array.dtype.kind in "SUO":
        return _plain(array.reshape(-1)[0]) if array.size == 1 else None
    if array.dtype.kind not in "biuf":
        return None
    numbers = array.reshape(-1).tolist()
    return numbers[0] if len(numbers) == 1 else tuple(numbers)


def text(attributes: Mapping[str, Any], name: str) -> str:
    """Return an attribute that is text and not empty.

    Raises
    ------
    FieldError
    """
    value = _present(attributes, name)
    if not isinstance(value, str) or not value.strip():
        raise FieldError(name, f"is {as_told(value)}; accepted: text")
    return value


def shown(attributes: Mapping[str, Any], name: str) -> str:
    """Return an attribute that is a text of one line, without what a terminal would obey.

    Raises
    ------
    FieldError
    """
    value = text(attributes, name)
    if not value.isprintable():
        raise FieldError(
            name,
            f"is {as_told(value)}; accepted: text without control or formatting characters",
        )
    return value


def number(attributes: Mapping[str, Any], name: str, default: float | None = None) -> float:
    """Return an attribute that is one finite number.

    Raises
    ------
    FieldError
    """
    if default is not None and name not in attributes:
        return default
    value = _present(attributes, name)
    if not isinstance(value, int | float) or not math.isfinite(value):
        raise FieldError(name, f"is {as_told(value)}; accepted: one finite number")
    return float(value)


def whole(attributes: Mapping[str, Any], name: str) -> int:
    """Return an attribute that is a whole number from 0; a float may hold it.

    Raises
    ------
    FieldError
    """
    value = number(attributes, name)
    if not (0.0 <= value < MAX_WHOLE and value.is_integer()):
        raise FieldError(name, f"is {value:g}; accepted: a whole number from 0 to 2^53")
    return int(value)


def numbers(attributes: Mapping[str, Any], name: str) -> tuple[float, ...]:
    """Return an attribute that is a number or an array of them, which may be empty.

    Raises
    ------
    FieldError
    """
    value = _present(attributes, name)
    if isinstance(value, str) or value is None:
        raise FieldError(
            name, f"is {as_told(value)}; accepted: a number or an array of numbers"
        )
    return value if isinstance(value, tuple) else (float(value),)


def _present(attributes: Mapping[str, Any], name: str) -> Plain | None:
    if name not in attributes:
        raise FieldError(name, "is missing; every trial and the root carry their attributes")
    try:
        return _plain(attributes[name])
    except UnicodeDecodeError as error:
        raise FieldError(name, f"is not UTF-8 ({error.reason}); accepted: text") from error


MAX_CHUNK_BYTES: Final = 1 << 24
"""Of a data set that is smaller itself: a chunk is unfolded whole for one value of it."""
# What h5py raises on a damaged file, by what is damaged.
_RAISED = (OSError, RuntimeError, LookupError, TypeError, ValueError, MemoryError)


@dataclass(frozen=True)
class Stored:
    """A data set in a file; its values and attributes are read when they are asked for.

    Attributes
    ----------
    name : str
        Unique among its kind.
    shape : tuple of int
        As stored.
    kind : str
        Of its numbers, as numpy calls it: 'i', 'u', 'f'; others are no numbers.
    handle : h5py.Dataset
        Open with its file.
    """

    name: str
    shape: tuple[int, ...]
    kind: str
    handle: h5py.Dataset

    @cached_property
    def attributes(self) -> dict[str, Any]:
        """All of them.

        Raises
        ------
        FieldError
            If they are damaged.
        """
        return attributes_of(self.handle, self.name)

    def read(self) -> NDArray[Any]:
        """Return the values as stored.

        Raises
        ------
        FieldError
            If they are damaged, lie in another file, would unfold to far more than is asked
            for, or parts were never written.
        """
        with naming_damage(self.name):
            if self.handle.is_virtual or self.handle.external:
                raise FieldError(self.name, "lies in another file; copy it into this one")
            chunk_bytes = math.prod(self.handle.chunks or ()) * self.handle.dtype.itemsize
            if chunk_bytes > max(MAX_CHUNK_BYTES, self.handle.nbytes):
                raise FieldError(
                    self.name,
                    f"holds {self.handle.nbytes} bytes in chunks of {chunk_bytes}; store it in "
                    "smaller chunks",
                )
            if _is_unwritten(self.handle):
                raise FieldError(
                    self.name,
                    "parts of it were never written, as by a program that did not close the "
                    "file; write it again",
                )
            values: NDArray[Any] = self.handle[()]
            return values


@contextmanager
def naming_damage(field: str) -> Iterator[None]:
    """Turn whatever h5py raises on damage into a `FieldError`; wrap accesses to h5py alone."""
    try:
        yield
    except StudyError:
        raise
    except _RAISED as error:
        raise FieldError(
            field, f"is damaged ({error}); restore the file from a copy, or write it again"
        ) from error


def open_file(path: Path) -> h5py.File:
    """Return an HDF5 file, open for reading.

    Raises
    ------
    FileNotFoundError, PermissionError
    StudyError
        If it is not HDF5, or is cut short or damaged at its beginning.
    """
    if path.is_dir():
        raise StudyError(f"{path} is a folder of no known layout; accepted: an HDF5 file")
    require_file(path)
    with path.open("rb"):
        pass  # the system's own error if it is not there or may not be read
    if not h5py.is_hdf5(path):
        raise StudyError(
            f"{path} is not an HDF5 file, or its beginning is damaged; accepted: an HDF5 file, "
            "or a recording with a column map beside it: frictus study import makes both "
            "(frictus identify takes a frequency response, too, with columns called frequency, "
            "real and imag)"
        )
    try:
        return h5py.File(path, "r")
    except _RAISED as error:
        raise StudyError(
            f"{path} cannot be opened ({error}); where it is cut short or damaged, restore it "
            "from a copy, or write it again"
        ) from error


def attributes_of(
    holder: h5py.Group | h5py.Dataset, field: str = "attributes"
) -> dict[str, Any]:
    """Return the attributes of an object whose names are UTF-8.

    Raises
    ------
    FieldError
    """
    with naming_damage(field):
        held = holder.attrs
        # items() would look each up twice.
        return {name: held[name] for name in held if isinstance(name, str)}


def group_in(holder: h5py.Group, name: str) -> h5py.Group | None:
    """Return a group by its name; None if there is nothing, or something else.

    Raises
    ------
    FieldError
    """
    with naming_damage("group"):
        found = holder[name] if _is_there(holder, name) else None
        return found if isinstance(found, h5py.Group) else None


def names_in(holder: h5py.Group, field: str) -> tuple[str, ...]:
    """Return the names of what is in a group; one that is not UTF-8 as its bytes, escaped.

    Raises
    ------
    FieldError
    """
    with naming_damage(field):
        return tuple(name if isinstance(name, str) else repr(name) for name in holder)


def data_sets_in(holder: h5py.Group, names: Iterable[str]) -> dict[str, Stored]:
    """Return those of the named data sets that are there.

    Raises
    ------
    FieldError
        If one is damaged, or is no data set.
    """
    return {name: _stored(holder, name) for name in names if _is_there(holder, name)}


def _is_there(holder: h5py.Group, name: str) -> bool:
    """Return whether a group holds something itself: a link could lead to any other file."""
    with naming_damage(name):
        links, key = holder.id.links, name.encode()
        if not links.exists(key):
            return False
        if links.get_info(key).type != h5py.h5l.TYPE_HARD:
            raise FieldError(name, "is a link to elsewhere; copy in what it leads to")
        return True


def _stored(holder: h5py.Group, name: str) -> Stored:
    with naming_damage(name):
        handle = holder[name]
        if not isinstance(handle, h5py.Dataset):
            raise FieldError(name, "is no data set; accepted: an array of numbers")
        return Stored(name, handle.shape or (), handle.dtype.kind, handle)


def _is_unwritten(handle: h5py.Dataset) -> bool:
    """Return whether reading would give fill values for what is not in the file."""
    if handle.chunks is None:
        return bool(handle.size > 0 and handle.id.get_storage_size() == 0)
    expected = math.prod(
        math.ceil(rows / chunk) for rows, chunk in zip(handle.shape, handle.chunks, strict=True)
    )
    return bool(handle.id.get_num_chunks() < expected)

"""Looking into an HDF5 file, which may be damaged anywhere: that ends in one error, named."""

import math
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import h5py
from numpy.typing import NDArray

from frictus_service.study.errors import FieldError, StudyError

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
            If they are damaged, or parts were never written.
        """
        with naming_damage(self.name):
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
    with path.open("rb"):
        pass  # the system's own error if it is not there or may not be read
    if not h5py.is_hdf5(path):
        raise StudyError(
            f"{path} is not an HDF5 file, or its beginning is damaged; accepted: an HDF5 file"
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
    """Return all attributes of an object.

    Raises
    ------
    FieldError
    """
    with naming_damage(field):
        held = holder.attrs
        return {name: held[name] for name in held}  # items() would look each up twice


def group_in(holder: h5py.Group, name: str) -> h5py.Group | None:
    """Return a group by its name; None if there is nothing, or something else.

    Raises
    ------
    FieldError
    """
    with naming_damage("group"):
        found = holder[name] if name in holder else None
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
    with naming_damage(name):
        return name in holder


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

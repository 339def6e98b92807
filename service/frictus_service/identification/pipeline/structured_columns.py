"""Columns of equal length as one structured array, and back: the form that is kept."""

from dataclasses import fields
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

Table = NDArray[np.void]
Columns = TypeVar("Columns", bound="DataclassInstance")


def table_of(columns: "DataclassInstance") -> Table:
    """Return a dataclass of arrays of shape (n,) as a structured array of shape (n,).

    Parameters
    ----------
    columns : dataclass instance
        All of its fields are arrays of the same length.
    """
    arrays = {field.name: getattr(columns, field.name) for field in fields(columns)}
    (count,) = {array.size for array in arrays.values()}
    table = np.empty(count, dtype=[(name, array.dtype) for name, array in arrays.items()])
    for name, array in arrays.items():
        table[name] = array
    return table


def columns_of(kind: type[Columns], table: Table) -> Columns:
    """Return the dataclass whose columns a structured array holds.

    Parameters
    ----------
    kind : type
        The dataclass.
    table : ndarray, shape (n,)
        From `table_of`.
    """
    columns: dict[str, Any] = {field.name: table[field.name].copy() for field in fields(kind)}
    return kind(**columns)

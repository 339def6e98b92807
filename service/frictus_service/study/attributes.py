"""Attributes of HDF5 objects as plain Python values, whichever program wrote them.

MATLAB writes every number as a float and a scalar as an array of one; other programs write text
as bytes of fixed length. All of that is the same value.
"""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from frictus_service.study.errors import FieldError

Plain = str | float | int | tuple[float, ...]


def plain(value: Any) -> Plain | None:
    """Return the value of an attribute; None if it is neither text nor numbers."""
    if value is None or isinstance(value, str):
        return value
    if isinstance(value, bytes):
        return value.decode()
    if type(value).__name__ == "Empty":  # h5py's, for a null dataspace: MATLAB's []
        return ()
    array = np.asarray(value)
    if array.dtype.kind in "SUO":
        return plain(array.reshape(-1)[0]) if array.size == 1 else None
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
        raise FieldError(name, f"is {value!r}; accepted: text")
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
        raise FieldError(name, f"is {value!r}; accepted: one finite number")
    return float(value)


def whole(attributes: Mapping[str, Any], name: str) -> int:
    """Return an attribute that is a whole number from 0; a float may hold it.

    Raises
    ------
    FieldError
    """
    value = number(attributes, name)
    if not (value >= 0.0 and value.is_integer()):
        raise FieldError(name, f"is {value:g}; accepted: a whole number from 0")
    return int(value)


def numbers(attributes: Mapping[str, Any], name: str) -> tuple[float, ...]:
    """Return an attribute that is a number or an array of them, which may be empty.

    Raises
    ------
    FieldError
    """
    value = _present(attributes, name)
    if isinstance(value, str) or value is None:
        raise FieldError(name, f"is {value!r}; accepted: a number or an array of numbers")
    return value if isinstance(value, tuple) else (float(value),)


def _present(attributes: Mapping[str, Any], name: str) -> Plain | None:
    if name not in attributes:
        raise FieldError(name, "is missing; every trial and the root carry their attributes")
    try:
        return plain(attributes[name])
    except UnicodeDecodeError as error:
        raise FieldError(name, f"is not UTF-8 ({error.reason}); accepted: text") from error

"""Tables of ready frequency responses: as parts or as size and phase, with a coherence."""

import re
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from frictus_hardware.arrays import ComplexArray, FloatArray
from frictus_service.data_import.channels import UNITS, find_unit, split_name
from frictus_service.data_import.column_map import has_map
from frictus_service.data_import.formats.columns import Column, Columns
from frictus_service.data_import.formats.read import read_columns
from frictus_service.errors import FieldError, StudyError
from frictus_service.study.importers import importers

MAX_ROWS: Final = 100_000
_CALLED: Final = {"re": "real part", "im": "imaginary part", "size": "magnitude"}
SAME: Final = 0.01
"""Of the largest value, by which one part in two units may differ as it was written."""
_PATTERNS: Final = {
    "frequency": r"f|freq(uency)?|frequencies|hz|f_hz",
    "re": r"(.*[._ (])?(re|real)([._ ()].*)?",
    "im": r"(.*[._ (])?(im|imag(inary)?)([._ ()].*)?",
    "size": r"(.*[._ ])?(mag(nitude)?|abs|size|amplitude|gain)([._ ].*)?",
    "phase": r"(.*[._ ])?(phase|angle|arg)([._ ].*)?",
    "coherence": r"(.*[._ ])?(coh(erence)?|gamma2?|msc)",
}


@dataclass(frozen=True, slots=True)
class ResponseTable:
    """A table of responses; arrays of shape (n,).

    Attributes
    ----------
    frequency_hz : ndarray
        Where the response was measured.
    response : ndarray of complex
        In the unit of the table.
    coherence : ndarray or None
        0 to 1, of the squared kind.
    notes : tuple of str
        What columns without a unit were taken as.
    """

    frequency_hz: FloatArray
    response: ComplexArray
    coherence: FloatArray | None
    notes: tuple[str, ...] = ()


def response_of(path: Path) -> ResponseTable | None:
    """Return the table that a file holds; None where it is a study, a recording, or neither.

    Parameters
    ----------
    path : Path

    Raises
    ------
    FieldError
        If a table cannot be used.
    """
    known = path.is_dir() or has_map(path)
    if known or any(importer.recognises(path) for importer in importers()):
        return None
    try:
        columns = read_columns(path)
    except StudyError:
        return None  # whoever opens it as a study says why
    return find_response(columns)


def find_response(columns: Columns) -> ResponseTable | None:
    """Return the frequency response among columns; None where there is none.

    Parameters
    ----------
    columns : Columns
        Of a file.

    Raises
    ------
    FieldError
        If it is one, but values are out of range, the phase names no unit, or several responses
        are in it.
    """
    called: defaultdict[str, list[Column]] = defaultdict(list)
    for column in columns.columns:
        name = split_name(column.name)[0].strip().lower()
        for role, pattern in _PATTERNS.items():
            if re.fullmatch(pattern, name):
                called[role].append(column)
                break
    parts = {"re", "im"} <= set(called)
    if "frequency" not in called or not (parts or {"size", "phase"} <= set(called)):
        return None
    used = ("frequency", *(("re", "im") if parts else ("size", "phase")), "coherence")
    found = {role: _only(role, called[role]) for role in used if role in called}
    rows = found["frequency"].values.size
    if rows > MAX_ROWS or any(column.values.size != rows for column in found.values()):
        raise FieldError(
            "frequency", f"has {rows} rows; accepted: up to {MAX_ROWS}, as many in each column"
        )
    frequency = _plain("frequency", found["frequency"])
    if not np.all(frequency >= 0.0):
        raise FieldError("frequency", "has values below 0, or missing; accepted: Hz")
    coherence = found["coherence"].values if "coherence" in found else None
    if coherence is not None and not np.all((coherence >= 0.0) & (coherence <= 1.0 + 1e-9)):
        raise FieldError("coherence", "has values beyond 0 to 1; accepted: squared coherence")
    response = _response(found)
    taken = {"frequency": "Hz"}
    if not parts:
        taken["size"] = 'a plain number; where it is in dB, name the unit "dB"'
    notes = tuple(
        f"{found[role].name} names no unit: taken as {meaning}"
        for role, meaning in taken.items()
        if not _unit(found[role])
    )
    return ResponseTable(frequency, response, coherence, notes)


def _only(role: str, columns: list[Column]) -> Column:
    """Return the column of a part of a response; it may be there twice, in dB and without."""
    first, *others = columns
    plain = _plain(role, first)
    for other in others:
        if not _alike(plain, _plain(role, other)):
            raise FieldError(
                "response",
                f"{first.name!r} and {other.name!r} are both called like its "
                f"{_CALLED.get(role, role)}, and differ: save one response, with its "
                "frequency, as a table of its own",
            )
    return first


def _alike(values: FloatArray, others: FloatArray) -> bool:
    """Return whether columns hold the same but for the digits they were written with."""
    if values.size != others.size:
        return False
    largest = np.max(np.abs(values), where=np.isfinite(values), initial=0.0)
    with np.errstate(invalid="ignore"):  # of two that are infinite
        return not np.any(np.abs(values - others) > SAME * largest)


def _plain(role: str, column: Column) -> FloatArray:
    """Return a part of a response in Hz, as a number, or in rad; as it is without a unit."""
    if role == "size" and _unit(column) == "dB":
        level: FloatArray = 10.0 ** (column.values / 20.0)
        return level
    like = {"frequency": "Hz", "phase": "rad"}.get(role)
    return column.values * ((like and _factor(column, like)) or 1.0)


def _response(found: dict[str, Column]) -> ComplexArray:
    if {"re", "im"} <= set(found):
        return found["re"].values + 1j * found["im"].values
    magnitude = _plain("size", found["size"])
    if not np.all(magnitude >= 0.0):
        raise FieldError("magnitude", "has values below 0; where it is in dB, name the unit dB")
    # Degrees and radians cannot be told apart by their size: a cutoff of 200 Hz became 307.
    if _factor(found["phase"], "rad") is None:
        raise FieldError("phase", 'names no unit: call it "phase (deg)" or "phase (rad)"')
    phase_rad = _plain("phase", found["phase"])
    return np.asarray(magnitude * np.exp(1j * phase_rad), np.complex128)


def _unit(column: Column) -> str:
    """Return the unit that a column names, or is named after, as `hz`; empty where none."""
    return find_unit(column.unit) or split_name(column.name)[1] or find_unit(column.name) or ""


def _factor(column: Column, like: str) -> float | None:
    """Return the factor of a column's unit; None where it names none that measures the same."""
    unit = UNITS.get(_unit(column))
    return unit.factor if unit and unit.dimension == UNITS[like].dimension else None

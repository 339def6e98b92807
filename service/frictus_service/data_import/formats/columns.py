"""Columns of numbers, whatever the format of the file that held them."""

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from frictus_hardware.arrays import FloatArray
from frictus_service.errors import StudyError

MAX_VALUES: Final = 100_000_000
"""Of all columns of a file together: they are in memory at once, as float64."""
MAX_COLUMNS: Final = 4096
MAX_LETTERS: Final = 100
"""Of a text that is kept."""


@dataclass(frozen=True, slots=True)
class Column:
    """A column of numbers.

    Attributes
    ----------
    name : str
        Unique in its file; of a matrix, the name and the number of the column from 1.
    values : ndarray, shape (n,)
        Missing samples NaN.
    unit : str
        As the file says; empty where it says none.
    rate_hz : float or None
        As the file says of this column alone; None where it does not.
    """

    name: str
    values: FloatArray
    unit: str = ""
    rate_hz: float | None = None


@dataclass(frozen=True, slots=True)
class Columns:
    """What a file holds.

    Attributes
    ----------
    format : str
        As users call it.
    columns : tuple of Column
        In the order of the file.
    numbers : dict
        Single numbers by name: a sample rate among them, where the file says one.
    started_utc : str
        ISO 8601; empty where the file does not say it.
    notes : tuple of str
        What of the file was left out; sentences.
    texts : dict
        Single texts by name, as who was measured.
    """

    format: str
    columns: tuple[Column, ...]
    numbers: dict[str, float] = field(default_factory=dict)
    started_utc: str = ""
    notes: tuple[str, ...] = ()
    texts: dict[str, str] = field(default_factory=dict)

    @property
    def fields(self) -> dict[str, str]:
        """Single values as text, by name."""
        return {name: f"{value:.15g}" for name, value in self.numbers.items()} | self.texts


class Gatherer:
    """Gathers the columns of one file, within the limits.

    Parameters
    ----------
    format_name : str
        As users call it.
    """

    def __init__(self, format_name: str) -> None:
        self._format = format_name
        self._columns: list[Column] = []
        self._numbers: dict[str, float] = {}
        self._notes: list[str] = []
        self._texts: dict[str, str] = {}
        self._called: Counter[str] = Counter()
        self._values = 0

    def reserve(self, name: str, shape: tuple[int, ...]) -> bool:
        """Return whether an array is columns of samples, before it is read.

        Parameters
        ----------
        name : str
            For the error.
        shape : tuple of int
            As the file declares.

        Raises
        ------
        StudyError
            If it would be more than a file may hold.
        """
        size = math.prod(shape)
        if size < 1 or len([length for length in shape if length > 1]) > 2:
            return False
        self._values += size
        if self._values > MAX_VALUES:
            raise StudyError(
                f"{name} of shape {shape} makes more than {MAX_VALUES:,} values in one file; "
                "cut the recording into several files, or leave channels away"
            )
        return True

    def add(
        self,
        name: str,
        array: NDArray[np.generic],
        unit: str = "",
        rate_hz: float | None = None,
    ) -> None:
        """Take an array: a single number, a column, or a matrix of columns along its long axis.

        Parameters
        ----------
        name : str
            In the file; where several are called alike, the second becomes `name (2)`.
        array : ndarray
            Other than real numbers are left out.
        unit : str
            As the file says.
        rate_hz : float or None
            As the file says.

        Raises
        ------
        StudyError
            If there are too many columns.
        """
        if array.dtype.kind not in "biufc" or not array.size:
            return
        squeezed = array.squeeze()
        if squeezed.dtype.kind == "c":
            self.add(f"{name}.re", squeezed.real, unit)
            self.add(f"{name}.im", squeezed.imag, unit)
            return
        if squeezed.ndim == 0:
            self._numbers[name] = float(squeezed)
            return
        if squeezed.ndim > 2:
            return
        matrix = squeezed[:, np.newaxis] if squeezed.ndim == 1 else squeezed
        if matrix.shape[1] > matrix.shape[0]:
            matrix = matrix.T
        name = self._own_name(name)
        names = [name] if matrix.shape[1] == 1 else _numbered(name, matrix.shape[1])
        if len(self._columns) + len(names) > MAX_COLUMNS:
            raise StudyError(f"it holds more than {MAX_COLUMNS} columns; leave some away")
        for number, each in enumerate(names):
            values = np.ascontiguousarray(matrix[:, number], dtype=np.float64)
            self._columns.append(Column(each, values, unit, rate_hz))

    def _own_name(self, name: str) -> str:
        """Return a name, or the name with a number where arrays before are called alike."""
        self._called[name] += 1
        return f"{name} ({self._called[name]})" if self._called[name] > 1 else name

    def text(self, name: str, value: str) -> None:
        """Take a single text, unless it is long: it names nobody then."""
        if 0 < len(value) <= MAX_LETTERS and len(self._texts) < MAX_COLUMNS:
            self._texts[name] = value

    def note(self, sentence: str) -> None:
        """Keep what of the file was left out."""
        self._notes.append(sentence)

    def result(self, started_utc: str = "") -> Columns:
        """Return what was gathered.

        Parameters
        ----------
        started_utc : str
            ISO 8601; empty where the file does not say it.

        Raises
        ------
        StudyError
            If there is no column of numbers.
        """
        if not any(column.values.size > 1 for column in self._columns):
            raise StudyError(
                "it holds no column of numbers; accepted: arrays of samples of one or two "
                "dimensions, also in structs and cells; a table or timetable of MATLAB only "
                "MATLAB reads: save it by writetable or writetimetable as CSV, and trials in "
                "an array of more dimensions each as a struct, or as a file"
            )
        return Columns(
            self._format,
            tuple(self._columns),
            self._numbers,
            started_utc,
            tuple(self._notes),
            self._texts,
        )


def _numbered(name: str, count: int) -> list[str]:
    return [f"{name}:{number}" for number in range(1, count + 1)]


RATE_NAMES: Final = ("samplerate", "samplingrate", "samplingfrequency", "rate", "sr", "fs")
RATE_UNITS: Final[Mapping[str, float]] = {"": 1.0, "hz": 1.0, "khz": 1e3}


def named_rate_hz(numbers: Mapping[str, float]) -> float | None:
    """Return the sample rate among single numbers, by its name; None where none or several are.

    Parameters
    ----------
    numbers : mapping of str to float
        By name, as in `Columns`.
    """
    found = set()
    for name, value in numbers.items():
        plain = "".join(
            letter for letter in name.rsplit(".", 1)[-1].lower() if letter.isalnum()
        )
        for unit, factor in RATE_UNITS.items():
            bare = plain.removesuffix(unit) if unit else plain
            if bare in RATE_NAMES and 0.0 < value < 1e9:
                found.add(value * factor)
                break
    return found.pop() if len(found) == 1 else None

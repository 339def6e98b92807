"""The layout of a text of columns: its delimiter, names and units, from the first lines.

Lines before the numbers may be comments, names and units; a decimal comma is understood where
the delimiter is another character.
"""

import re
from dataclasses import dataclass
from typing import Final

from frictus_service.data_import.channels import UNITS, find_unit, is_unit, named_channel
from frictus_service.data_import.formats.columns import MAX_COLUMNS
from frictus_service.errors import StudyError

DELIMITERS: Final = ("\t", ";", ",", " ")
MISSING: Final = (
    *("", "-", "nan", "NaN", "NAN", "-nan", "NA", "N/A", "n/a", "#N/A", "null", "NULL", "None"),
    *("1.#QNAN", "-1.#IND"),
)
"""As programs write a sample that is missing; the last two are of Microsoft's C."""
_NUMBER: Final = re.compile(r"[+-]?(\d+([.,]\d*)?|[.,]\d+)([eE][+-]?\d+)?|[+-]?inf", re.ASCII)


@dataclass(frozen=True, slots=True)
class TextLayout:
    """How a text file is laid out.

    Attributes
    ----------
    delimiter, decimal : str
        Single characters.
    skipped : int
        Lines before the first line of numbers.
    names, units : tuple of str
        One for each column.
    encoding : str
        Of the text.
    """

    delimiter: str
    decimal: str
    skipped: int
    names: tuple[str, ...]
    units: tuple[str, ...]
    encoding: str


def find_layout(head: bytes) -> TextLayout:
    """Return how a text file is laid out.

    Parameters
    ----------
    head : bytes
        Its beginning.

    Raises
    ------
    StudyError
        If no line of numbers is among it.
    """
    if b"\0" in head:
        raise StudyError("it holds bytes that are no text; accepted: text in UTF-8 or Latin-1")
    try:
        text, encoding = head.decode("utf-8-sig", errors="strict"), "utf-8"
    except UnicodeDecodeError as error:
        cut = error.reason == "unexpected end of data"
        encoding = "utf-8" if cut else "latin-1"
        text = head.decode(encoding, errors="ignore")
    # As pyarrow counts them: `str.splitlines` also ends lines at what cp1252 has as "…".
    lines = re.split(r"\r\n|\n|\r", text)
    for number, line in enumerate(lines):
        for delimiter in DELIMITERS:
            fields = _split(line, delimiter)
            if not _are_numbers(fields, delimiter):
                continue
            if len(fields) == 1 and "," in line and _are_two_columns(line, lines[:number]):
                continue
            if len(fields) > MAX_COLUMNS:
                raise StudyError(f"it has more than {MAX_COLUMNS} columns; leave some away")
            # In all lines: the first may hold whole numbers alone.
            decimals = delimiter != "," and any("," in each for each in lines[number:])
            decimal = "," if decimals else "."
            names, units = _heading(lines[:number], delimiter, fields)
            return TextLayout(delimiter, decimal, number, names, units, encoding)
    raise StudyError(
        "no line of numbers is among its first 64 KiB; accepted: columns divided by comma, "
        "semicolon, tab or spaces, one sample in each line"
    )


def _split(line: str, delimiter: str) -> list[str]:
    # Spaces align as well as divide: any number of them is one.
    fields = line.split() if delimiter == " " else line.split(delimiter)
    return [field.strip().strip('"') for field in fields]


def _are_numbers(fields: list[str], delimiter: str) -> bool:
    """Return whether a line divides into numbers; missing values beside at least one."""
    found = [field for field in fields if field not in MISSING]
    if delimiter == "," and any("," in field for field in found):
        return False
    return bool(found) and all(_NUMBER.fullmatch(field) for field in found)


def _are_two_columns(line: str, above: list[str]) -> bool:
    """Return whether `0,12` is two whole numbers, as the heading shows, or a decimal."""
    heading = [text for text in above if text.strip()]
    if not heading:
        raise StudyError(
            f"{line[:40]!r} may be one number or two: name the columns in a first line, or "
            "divide them by semicolons"
        )
    return "," in heading[-1]


def _heading(
    lines: list[str], delimiter: str, row: list[str]
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return names and units: the last two lines of text with as many fields as the first row.

    LabVIEW has the units in a line that is called so.
    """
    texts, unit_labels, count = [], [""], len(row)
    for line in lines:
        fields = _split(line.lstrip("#%/ "), delimiter)
        if fields[0] == "Y_Unit_Label":
            unit_labels = ["", *fields[1:count]]
            continue
        if fields[-1].lower() == "comment":  # of LabVIEW, whose rows rarely have one
            fields.pop()
        if len(fields) == count - 1 and not row[-1]:  # rows end in a delimiter
            fields.append("")
        if len(fields) == count and any(fields):
            texts.append(fields)
    if not texts:
        return tuple(f"column {n}" for n in range(1, count + 1)), ("",) * count
    if paired := _paired(texts):
        return paired
    names, units = list(texts[-1]), unit_labels + [""] * (count - len(unit_labels))
    if len(texts) > 1 and all(_is_unit(text) for text in texts[-1]):
        names, units = texts[-2], [text.strip("[]() ") for text in texts[-1]]
    elif len(texts) > 1:
        for number, (above, name) in enumerate(zip(texts[-2], texts[-1], strict=True)):
            if _names_unit_of(name, above):  # `Time,Analog 1` over `ms,Speed`
                names[number], units[number] = above, name
    return _unique(names), tuple(units)


def _paired(texts: list[list[str]]) -> tuple[tuple[str, ...], tuple[str, ...]] | None:
    """Return names and units where each channel has a time beside it; None where none has.

    Programs of NI write `Channel name,Fx,Channel name,Fz` over `Unit,N,Unit,N`. Times are one
    clock where all intervals are alike.
    """
    count = len(texts[0])
    even = [fields[: count if fields[-1] else -1] for fields in texts]
    told = {
        fields[0].lower(): fields[1::2]
        for fields in even
        if len(fields) % 2 == 0 and len(set(fields[::2])) == 1
    }
    channels = told.get("channel name", [])
    intervals = told.get("interval", channels)
    times = [f"{channel} time" for channel in channels]
    if len(set(intervals)) == 1:
        times[0] = "time"
    names = [name for pair in zip(times, channels, strict=True) for name in pair]
    units = [each for unit in told.get("unit", [""] * len(channels)) for each in ("", unit)]
    rest = [""] * (count - len(names))  # of rows that end in a delimiter
    return (_unique(names + rest), tuple(units + rest)) if channels else None


def _is_unit(text: str) -> bool:
    return is_unit(text.strip("[]() ")) or text.strip("[]() ") in ("", "-")


def _names_unit_of(text: str, name: str) -> bool:
    """Return whether a text is a unit of the channel that a name stands for."""
    unit, channel = find_unit(text), named_channel(name)
    return bool(unit and channel and UNITS[unit].dimension == channel.dimension)


def _unique(names: list[str]) -> tuple[str, ...]:
    taken: list[str] = []
    for number, name in enumerate(names, 1):
        name = name or f"column {number}"
        taken.append(f"{name} ({number})" if name in taken else name)
    return tuple(taken)

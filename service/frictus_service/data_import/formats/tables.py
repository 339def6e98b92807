"""Tables of columns: text (CSV, TSV and others), and Parquet.

How a text is laid out is found in its first lines (`text_layout`).
"""

import re
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import Final

import numpy as np
import pyarrow as pa
from pyarrow import Table, csv, float64, parquet

from frictus_hardware.arrays import FloatArray
from frictus_service.data_import.formats.columns import Columns, Gatherer
from frictus_service.data_import.formats.text_layout import MISSING, TextLayout, find_layout
from frictus_service.errors import StudyError

MAX_BYTES: Final = 1 << 30
HEAD_BYTES: Final = 1 << 16
SPARE_SPACES: Final = re.compile(rb"(?:\A|(?<=[\r\n])) +| +(?=[ \r\n]|\Z)")
MAX_SECTIONS: Final = 1024
MAX_SECTIONS_BYTES: Final = 1 << 28
MAX_SECTIONS_LINES: Final = 1 << 24
"""Sections are found line by line, which are in memory at once, each with its overhead."""
HEAD_LINES: Final = 2000
ROW_BEGINS: Final = b'+-.0123456789nN",;\t'
_NO_NUMBER: Final = re.compile(
    r"CSV column #(\d+): Row #(\d+): .*invalid value '(.*)'", re.DOTALL
)
_OTHER_WIDTH: Final = re.compile(r"Row #(\d+): Expected (\d+) columns, got (\d+)")


def read_text(path: Path) -> Columns:
    """Return the columns of a text file.

    Parameters
    ----------
    path : Path

    Raises
    ------
    StudyError
        If it is too large, or is no table of numbers.
    """
    if path.stat().st_size > MAX_BYTES:
        raise StudyError(
            f"it is larger than {MAX_BYTES >> 20} MiB of text; cut it, or use HDF5"
        )
    with path.open("rb") as stream:
        layout = find_layout(_whole_lines(stream.read(HEAD_BYTES)))
    gathered = Gatherer("text")
    source: Path | BytesIO = path
    if layout.delimiter == " ":  # pyarrow takes each space as an end of a field
        source = BytesIO(SPARE_SPACES.sub(b"", path.read_bytes()))
    try:
        _add_rows(gathered, source, layout, "")
    except pa.ArrowInvalid as error:  # lines of text after the first of numbers, or damage
        if path.stat().st_size > MAX_SECTIONS_BYTES:
            raise
        return _read_sections(path.read_bytes(), error)
    return gathered.result()


def _whole_lines(head: bytes) -> bytes:
    """Leave away the line that a head ends in: its beginning may look like a whole one."""
    if len(head) < HEAD_BYTES:
        return head
    return head[: max(head.rfind(b"\n"), head.rfind(b"\r")) + 1] or head


def _add_rows(
    gathered: Gatherer, source: Path | BytesIO, layout: TextLayout, section: str
) -> None:
    """Add the columns of a table; of one of several, with its name before theirs.

    Raises
    ------
    ArrowInvalid
        If a row is damaged; the text says which.
    """
    try:
        table = _table(gathered, source, layout)
    except pa.ArrowInvalid as error:
        raise pa.ArrowInvalid(section + _in_words(str(error), layout)) from error
    for name, unit in zip(layout.names, layout.units, strict=True):
        # Null stands where a field is empty.
        values = table.column(name).to_numpy().astype(np.float64)
        gathered.add(f"{section}{name}", values, unit)


def _in_words(error: str, layout: TextLayout) -> str:
    """Return what is wrong with a row, where pyarrow says it in numbers of columns."""
    if found := _NO_NUMBER.search(error):
        column, row, value = found.groups()
        return (
            f"row {row} of the numbers, column {layout.names[int(column)][:40]!r}: "
            f"{value[:40]!r} is no number; a missing sample is empty, NaN, n/a, null or -"
        )
    if found := _OTHER_WIDTH.search(error):
        row, expected, got = map(int, found.groups())
        return (
            f"row {row - layout.skipped} of the numbers has another number of columns: {got}, "
            f"others {expected}"
        )
    return error


def _table(gathered: Gatherer, source: Path | BytesIO, layout: TextLayout) -> Table:
    batches = []
    with csv.open_csv(
        source,
        read_options=csv.ReadOptions(
            skip_rows=layout.skipped,
            column_names=list(layout.names),
            encoding=layout.encoding,
            use_threads=False,
        ),
        parse_options=csv.ParseOptions(delimiter=layout.delimiter),
        convert_options=csv.ConvertOptions(
            decimal_point=layout.decimal,
            null_values=list(MISSING),
            column_types=dict.fromkeys(layout.names, float64()),
        ),
    ) as reader:
        for batch in reader:  # a line may be two bytes, and takes eight in each column
            gathered.reserve("the table", (batch.num_rows, batch.num_columns))
            batches.append(batch)
        return Table.from_batches(batches, reader.schema)


def _read_sections(content: bytes, error: pa.ArrowInvalid) -> Columns:
    """Return the columns of a text in sections, as `section 2.Fx`, and leave what ends it.

    Programs of tribometers write each step below the one before, with a heading of its own, and
    a summary at the end. Where no heading stands between, a line is damaged.
    """
    gathered = Gatherer("text")
    if max(content.count(b"\n"), content.count(b"\r")) > MAX_SECTIONS_LINES:
        raise error
    lines = content.rstrip(b" \r\n").splitlines(keepends=True)
    at, sections = 0, list[tuple[TextLayout, bytes]]()
    while at + 1 < len(lines):  # a last line alone is no section
        try:
            head = b"".join(lines[at : at + HEAD_LINES])[:HEAD_BYTES]
            layout = find_layout(_whole_lines(head))
        except StudyError:
            break
        if sections and not _continues(layout, sections[0][0], len(sections)):
            raise error
        first = last = at + layout.skipped
        while last < len(lines) and _is_row(lines[last], layout):
            last += 1
        sections.append((layout, b"".join(lines[first:last])))
        at = last
    for number, (layout, rows) in enumerate(sections, 1):
        if layout.delimiter == " ":
            rows = SPARE_SPACES.sub(b"", rows)
        name = f"section {number}." if len(sections) > 1 else ""
        _add_rows(gathered, BytesIO(rows), replace(layout, skipped=0), name)
    left = [line.decode(errors="replace").strip() for line in lines[at:] if line.strip()]
    if left:
        gathered.note(
            f"left out, for they are no rows of the table: the last {len(left)} lines, from "
            f"{left[0][:40]!r} on"
        )
    return gathered.result()


def _continues(layout: TextLayout, first: TextLayout, before: int) -> bool:
    """Return whether a section after so many is of the first one's layout, by a heading."""
    named = layout.names[0] != "column 1"
    return named and layout.names == first.names and before < MAX_SECTIONS


def _is_row(line: bytes, layout: TextLayout) -> bool:
    """Return whether a line may be numbers, or is empty; pyarrow says whether it is."""
    text = line.strip(b" \r\n")
    fields = (
        len(text.split())
        if layout.delimiter == " "
        else text.count(layout.delimiter.encode()) + 1
    )
    return not text.strip() or (fields == len(layout.names) and text[:1] in ROW_BEGINS)


MAX_METADATA: Final = 1 << 24
UNIT_KEYS: Final = (b"unit", b"units")
RATE_KEYS: Final = (b"sample_rate_hz", b"rate_hz")


def read_parquet(path: Path) -> Columns:
    """Return the columns of a Parquet file that are numbers.

    Parameters
    ----------
    path : Path

    Raises
    ------
    StudyError
        If it declares more values than a file may hold.
    """
    gathered = Gatherer("Parquet")
    with parquet.ParquetFile(
        path,
        thrift_string_size_limit=MAX_METADATA,
        thrift_container_size_limit=MAX_METADATA,
    ) as file:
        schema = file.schema_arrow
        numeric = [each for each in schema if _is_number(each.type)]
        rows = file.metadata.num_rows
        kept = [each for each in numeric if gathered.reserve(each.name, (rows,))]
        for key, value in (schema.metadata or {}).items():
            if key in RATE_KEYS:
                gathered.add(key.decode(), np.asarray(float(value)))
        # One name at a time: dictionaries may unfold to all rows.
        for name in dict.fromkeys(each.name for each in kept):
            table = file.read(columns=[name], use_threads=False)
            for field, values in zip(table.schema, table.columns, strict=True):
                if field.name == name and _is_number(field.type):
                    gathered.add(name, _floats(values), _unit(field))
    return gathered.result()


def _is_number(kind: pa.DataType) -> bool:
    types = pa.types
    return bool(types.is_floating(kind) or types.is_integer(kind) or types.is_boolean(kind))


def _floats(values: pa.ChunkedArray) -> FloatArray:
    floats: FloatArray = values.cast(pa.float64(), safe=False).to_numpy()
    return floats


def _unit(field: pa.Field) -> str:
    found = field.metadata or {}
    return next((found[key].decode(errors="replace") for key in UNIT_KEYS if key in found), "")

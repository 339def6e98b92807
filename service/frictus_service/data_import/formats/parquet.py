"""Parquet: numeric columns; units in the metadata of a field, or in its name."""

from pathlib import Path
from typing import Final

import numpy as np
import pyarrow as pa
from pyarrow import parquet

from frictus_hardware.arrays import FloatArray
from frictus_service.data_import.formats.columns import Columns, Gatherer

MAX_METADATA: Final = 1 << 24
UNIT_KEYS: Final = (b"unit", b"units")
RATE_KEYS: Final = (b"sample_rate_hz", b"rate_hz")


def read(path: Path) -> Columns:
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
        for each in kept:  # one column at a time: dictionaries may unfold to all rows
            values = file.read(columns=[each.name], use_threads=False).column(0)
            gathered.add(each.name, _floats(values), _unit(each))
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

"""Which format a file is of, by its first bytes or its ending, and its columns."""

from collections.abc import Callable
from pathlib import Path
from typing import Final

from frictus.files import require_file
from frictus_service.data_import.formats import arrays, signals, tables
from frictus_service.data_import.formats.columns import Columns
from frictus_service.errors import StudyError
from frictus_service.study.file_state import unchanged

ACCEPTED: Final = (
    "accepted: MATLAB (.mat, level 5 or 7.3), HDF5, CSV, TSV and other text, WAV, Parquet, TDMS"
)
TEXT: Final = (".csv", ".tsv", ".txt", ".dat", ".asc", ".lvm")
_SIGNATURES: Final[dict[bytes, Callable[[Path], Columns]]] = {
    b"\x89HDF\r\n\x1a\n": arrays.read_hdf5,
    b"RIFF": signals.read_wav,
    b"RF64": signals.read_wav,
    b"PAR1": tables.read_parquet,
    b"TDSm": signals.read_tdms,
}
_PACKED: Final = {
    b"\x1f\x8b": "is packed by gzip; unpack it",
    b"PK\x03\x04": "is an Excel workbook or a zip archive; save the sheet as CSV, or unpack it",
    b"\xd0\xcf\x11\xe0": "is an Excel workbook; save the sheet as CSV",
}


def read_columns(path: Path) -> Columns:
    """Return the columns of a file.

    Parameters
    ----------
    path : Path

    Raises
    ------
    FileNotFoundError, PermissionError
    StudyError
        If it is of no known format, damaged, too large, or changes while it is read; the text
        says which.
    """
    reader = _reader(path)
    with unchanged(path):  # a part of text that ends with a line reads as if it were whole
        return _read(reader, path)


def _read(reader: Callable[[Path], Columns], path: Path) -> Columns:
    try:
        return reader(path)
    except StudyError as error:
        raise StudyError(f"{path}: {error}") from error
    except Exception as error:  # parsers raise whatever a damaged file leads them to
        what = " ".join(str(error).split()) or type(error).__name__  # one of Parquet has lines
        raise StudyError(
            f"{path} cannot be read ({what[:300]}); where it is damaged or cut short, restore "
            f"it from a copy, or save it again; {ACCEPTED}"
        ) from error


def _reader(path: Path) -> Callable[[Path], Columns]:
    if path.is_dir():
        raise StudyError(f"{path} is a folder; give its files")
    require_file(path)
    with path.open("rb") as stream:
        head = stream.read(520)
    for signature, reader in _SIGNATURES.items():
        if head.startswith(signature):
            return reader
    for signature, what in _PACKED.items():
        if head.startswith(signature):
            raise StudyError(f"{path} {what}; {ACCEPTED}")
    if head.startswith(b"MATLAB 7.3") or head[512:].startswith(b"\x89HDF"):
        return arrays.read_hdf5
    if head.startswith(b"MATLAB 5.0") or path.suffix.lower() == ".mat":
        return arrays.read_matlab
    if path.suffix.lower() in TEXT:
        return tables.read_text
    raise StudyError(f"{path} is of no known format; {ACCEPTED}")

"""HDF5 and MATLAB v7.3: every data set of numbers, by its path.

Data that lie in another file (external storage, virtual data sets, links) are not followed.
"""

from pathlib import Path
from typing import Final

import h5py
import numpy as np

from frictus_service.data_import.formats.columns import Columns, Gatherer
from frictus_service.errors import FieldError, StudyError
from frictus_service.study import hdf5
from frictus_service.study.hdf5 import Stored, naming_damage

MAX_OBJECTS: Final = 4096
MAX_DEPTH: Final = 16
"""Of groups: each object is found by its whole path, which takes ever longer."""
UNIT_NAMES: Final = ("unit", "units", "Unit", "Units", "UNIT")
RATE_NAMES: Final = ("sample_rate_hz", "rate_hz", "fs", "Fs", "sampling_rate", "sample_rate")


def read(path: Path) -> Columns:
    """Return the data sets of an HDF5 file as columns.

    Parameters
    ----------
    path : Path

    Raises
    ------
    StudyError
        If it is damaged, too large, a study already, or stores its data elsewhere.
    """
    with hdf5.open_file(path) as file:
        held = hdf5.attributes_of(file)
        if str(hdf5.plain(held.get("schema"))).startswith("study/"):
            raise StudyError("it is a study already; every command takes it as it is")
        matlab = b"MATLAB 7.3" in _user_block(path)
        gathered = Gatherer("MATLAB v7.3" if matlab else "HDF5")
        for name, value in held.items():
            _number(gathered, name, value)
        for stored in _data_sets(file):
            _add(gathered, stored)
        return gathered.result()


def _user_block(path: Path) -> bytes:
    with path.open("rb") as stream:
        return stream.read(128)


def _data_sets(file: h5py.File) -> list[Stored]:
    found: list[Stored] = []
    seen, deepest = 0, 0

    def visit(name: str, held: h5py.HLObject) -> bool | None:
        nonlocal seen, deepest
        seen, deepest = seen + 1, max(deepest, name.count("/"))
        if seen > MAX_OBJECTS or deepest > MAX_DEPTH:
            return True
        if isinstance(held, h5py.Dataset) and not name.startswith("#"):
            shape = held.shape or ()
            found.append(Stored(name.replace("/", "."), shape, held.dtype.kind, held))
        return None

    with naming_damage("file"):
        file.visititems(visit)
    if seen > MAX_OBJECTS:
        raise StudyError(f"it holds more than {MAX_OBJECTS} objects; save the channels alone")
    if deepest > MAX_DEPTH:
        raise StudyError(f"groups lie in it more than {MAX_DEPTH} deep; save the channels flat")
    return found


def _add(gathered: Gatherer, stored: Stored) -> None:
    kind = (
        "c" if stored.handle.dtype.fields and _is_complex(stored.handle.dtype) else stored.kind
    )
    if kind not in "biufc" or ("MATLAB_class" in stored.attributes and _is_text(stored)):
        return
    if stored.handle.is_virtual or stored.handle.external:
        raise FieldError(stored.name, "lies in another file; copy it into this one")
    if not gathered.reserve(stored.name, stored.shape):
        return
    unit = next((stored.attributes[n] for n in UNIT_NAMES if n in stored.attributes), "")
    plain = hdf5.plain(unit)
    rate = next((stored.attributes[n] for n in RATE_NAMES if n in stored.attributes), None)
    rate_hz = hdf5.plain(rate) if rate is not None else None
    values = stored.read()
    if values.dtype.fields:
        values = values["real"] + 1j * values["imag"]
    values = _scaled(stored, values)
    gathered.add(
        stored.name,
        values,
        plain if isinstance(plain, str) else "",
        float(rate_hz) if isinstance(rate_hz, int | float) else None,
    )


def _scaled(stored: Stored, values: np.ndarray) -> np.ndarray:
    """Return counts as values where the attributes say how, as netCDF and studies do."""
    held = stored.attributes
    if "scale" not in held or values.dtype.kind not in "iu":
        return values
    offset = hdf5.number(held, "offset", default=0.0)
    scaled: np.ndarray = values * hdf5.number(held, "scale") + offset
    return scaled


def _is_complex(kind: np.dtype) -> bool:
    return set(kind.names or ()) == {"real", "imag"}


def _is_text(stored: Stored) -> bool:
    return hdf5.plain(stored.attributes["MATLAB_class"]) in ("char", "cell", "function_handle")


def _number(gathered: Gatherer, name: str, value: object) -> None:
    plain = hdf5.plain(value)
    if isinstance(plain, int | float):
        gathered.add(name, np.asarray(float(plain)))

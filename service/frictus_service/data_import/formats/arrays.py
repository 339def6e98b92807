"""Named arrays in a tree: HDF5, and MATLAB of levels 5 and 7.3.

Of HDF5, which MATLAB 7.3 is too, every data set of numbers is read by its path. Data that lie
in another file (external storage, virtual data sets, links) are not followed.

Of MATLAB, variables and fields of structs are read; of an array of structs as `trial(2).force`,
of a cell of structs as `trial{2}.force`, of cells of arrays alike, with the number before the
name: of `run.force` and `run.speed` as `run{2}.force` and `run{2}.speed`.
"""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import h5py
import numpy as np

from frictus_service.data_import.formats.columns import MAX_LETTERS, Columns, Gatherer
from frictus_service.data_import.recording_names import is_person_field
from frictus_service.errors import StudyError
from frictus_service.study import hdf5
from frictus_service.study.hdf5 import Stored, naming_damage
from frictus_service.study.matlab import MAX_STRUCTS_DEEP, read_variables

MAX_OBJECTS: Final = 16_384
TOO_MANY: Final = f"it holds more than {MAX_OBJECTS} objects; save the channels alone"
MAX_GROUPS_DEEP: Final = 16
"""Of groups: each object is found by its whole path, which takes ever longer."""
UNIT_NAMES: Final = ("unit", "units", "Unit", "Units", "UNIT")
FILL_NAMES: Final = ("_FillValue", "missing_value")
"""Of netCDF: what stands where no value was measured."""
RATE_NAMES: Final = ("sample_rate_hz", "rate_hz", "fs", "Fs", "sampling_rate", "sample_rate")


def read_hdf5(path: Path) -> Columns:
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
            _text(gathered, name, value)
        data_sets, groups = _objects(file)
        for group, held in groups.items():
            for name in RATE_NAMES:
                _number(gathered, f"{group}.{name}", held.get(name))
            for name, value in held.items():
                _text(gathered, f"{group}.{name}", value)
        for stored in data_sets:
            _add_data_set(gathered, stored)
        return gathered.result()


def _user_block(path: Path) -> bytes:
    with path.open("rb") as stream:
        return stream.read(128)


def _objects(file: h5py.File) -> tuple[list[Stored], dict[str, dict[str, Any]]]:
    """Return the data sets of a file, and the attributes of its groups by name."""
    found: list[Stored] = []
    groups: dict[str, dict[str, Any]] = {}
    fields: list[tuple[str, h5py.Dataset]] = []
    seen, deepest = 0, 0

    def visit(called: str | bytes, held: h5py.HLObject) -> bool | None:
        nonlocal seen, deepest
        name = _name(called)
        seen, deepest = seen + 1, max(deepest, name.count("/"))
        if seen > MAX_OBJECTS or deepest > MAX_GROUPS_DEEP:
            return True
        if name.startswith("#"):
            return None
        dotted = name.replace("/", ".")
        if not isinstance(held, h5py.Dataset):
            groups[dotted] = hdf5.attributes_of(held, dotted)
        elif h5py.check_ref_dtype(held.dtype) is h5py.Reference:
            fields.append((dotted, held))
        else:
            found.append(Stored(dotted, held.shape or (), held.dtype.kind, held))
        return None

    with naming_damage("file"):
        file.visititems(visit)
    referred = sum(field.size for _, field in fields)  # many may lead to the same values
    if seen + referred > MAX_OBJECTS:
        raise StudyError(TOO_MANY)
    if deepest > MAX_GROUPS_DEEP:
        raise StudyError(
            f"groups lie in it more than {MAX_GROUPS_DEEP} deep; save the channels flat"
        )
    for name, field in fields:
        for place, inner in _referred(file, name, field):
            seen += 1
            if seen > MAX_OBJECTS:
                raise StudyError(TOO_MANY)
            if isinstance(inner, h5py.Dataset):
                found.append(Stored(place, inner.shape or (), inner.dtype.kind, inner))
    return found, groups


def _name(called: str | bytes) -> str:
    """Return the name of an object; programs on Windows write what is no UTF-8."""
    return called if isinstance(called, str) else called.decode("latin-1")


def _referred(
    file: h5py.File, name: str, field: h5py.Dataset
) -> Iterator[tuple[str, h5py.HLObject]]:
    """Yield what a cell, or a field of an array of structs, refers to in MATLAB 7.3."""
    with naming_damage(name):
        is_cell = "MATLAB_class" in field.attrs
        struct, _, last = name.rpartition(".")
        for number, reference in enumerate(field[()].reshape(-1), 1):
            held = file[reference] if reference else None
            if isinstance(held, h5py.Group) and is_cell:  # a struct
                for member in held:
                    if isinstance(held.get(member, getlink=True), h5py.HardLink):
                        yield f"{name}{{{number}}}.{_name(member)}", held[member]
            elif held is not None:
                yield _in_cell(name, number) if is_cell else f"{struct}({number}).{last}", held


def _in_cell(name: str, number: int) -> str:
    """Return the name of an array in a cell: cells beside it hold what else was recorded."""
    struct, _, last = name.rpartition(".")
    return f"{struct}{{{number}}}.{last}"


def _add_data_set(gathered: Gatherer, stored: Stored) -> None:
    kind = (
        "c" if stored.handle.dtype.fields and _is_complex(stored.handle.dtype) else stored.kind
    )
    if kind not in "biufc" or not _is_numeric(stored):
        _add_text(gathered, stored)
        return
    with naming_damage(stored.name):
        # A dimension of netCDF that has no values of its own: a scale that nobody writes.
        if stored.handle.is_scale and not stored.handle.id.get_storage_size():
            return
    if not gathered.reserve(stored.name, stored.shape):
        return
    unit = next((stored.attributes[n] for n in UNIT_NAMES if n in stored.attributes), "")
    plain = hdf5.plain(unit)
    rate = next((stored.attributes[n] for n in RATE_NAMES if n in stored.attributes), None)
    rate_hz = hdf5.plain(rate) if rate is not None else None
    if isinstance(rate_hz, int | float) and not 0.0 < rate_hz < np.inf:
        raise StudyError(
            f"{stored.name}: its sample rate is {rate_hz:g}; accepted: above 0 Hz; correct the "
            "attribute, or delete it and give rate_hz in the map"
        )
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


def _add_text(gathered: Gatherer, stored: Stored) -> None:
    """Take what MATLAB 7.3 keeps as the codes of letters, or a single text of HDF5."""
    letters = math.prod(stored.shape)
    if str(hdf5.plain(stored.attributes.get("MATLAB_class"))) == "char":
        if stored.kind == "u" and letters <= MAX_LETTERS:
            gathered.text(stored.name, "".join(map(chr, stored.read().reshape(-1).tolist())))
    elif letters == 1 and h5py.check_string_dtype(stored.handle.dtype) is not None:
        with naming_damage(stored.name):
            _text(gathered, stored.name, stored.handle[()])


def _scaled(stored: Stored, values: np.ndarray) -> np.ndarray:
    """Return counts as values where the attributes say how, as studies and netCDF do.

    NetCDF packs floats as well; its fill values are compared with what is stored.
    """
    held, kind = stored.attributes, values.dtype.kind
    if kind not in "iuf":
        return values
    if kind == "i" and str(hdf5.plain(held.get("_Unsigned"))).lower() == "true":
        values = values.view(values.dtype.str.replace("i", "u"))
    missing = np.zeros(values.shape, dtype=np.bool_)
    for name in FILL_NAMES:
        for fill in _as_stored(held.get(name), values):
            missing |= values == fill
    least, most = held.get("valid_min"), held.get("valid_max")
    if len(both := _as_stored(held.get("valid_range"), values)) == 2:
        least, most = both
    for bound in _as_stored(least, values):
        missing |= values < bound
    for bound in _as_stored(most, values):
        missing |= values > bound
    studies = "scale" in held and kind in "iu"
    scale, offset = ("scale", "offset") if studies else ("scale_factor", "add_offset")
    if not missing.any() and scale not in held and offset not in held:
        return values
    factor, shift = hdf5.number(held, scale, 1.0), hdf5.number(held, offset, 0.0)
    scaled: np.ndarray = np.where(missing, np.nan, values.astype(np.float64) * factor + shift)
    return scaled


def _as_stored(numbers: object, values: np.ndarray) -> np.ndarray:
    """Return numbers of an attribute as the data set would hold them; empty where it has none.

    The -99.9 of an attribute is another number than that of a data set of single precision, and
    the -1 of a signed attribute is the greatest of an unsigned data set.
    """
    found = np.asarray(numbers).reshape(-1)
    if found.dtype.kind not in "iuf":  # text in such an attribute marks no number
        return np.empty(0)
    if values.dtype.kind == "f" or (values.dtype.kind == "u" and found.dtype.kind == "i"):
        with np.errstate(over="ignore"):
            return found.astype(values.dtype)
    return found


def _is_complex(kind: np.dtype) -> bool:
    return set(kind.names or ()) == {"real", "imag"}


def _is_numeric(stored: Stored) -> bool:
    """Return whether MATLAB, where it wrote a data set, has numbers in it, and any at all."""
    held = stored.attributes
    kind = str(hdf5.plain(held.get("MATLAB_class", "double")))
    numeric = kind in ("double", "single", "logical") or kind.startswith(("int", "uint"))
    return numeric and not hdf5.plain(held.get("MATLAB_empty"))


def _number(gathered: Gatherer, name: str, value: object) -> None:
    plain = hdf5.plain(value)
    if isinstance(plain, int | float):
        gathered.add(name, np.asarray(float(plain)))


def _text(gathered: Gatherer, name: str, value: object) -> None:
    plain = hdf5.plain(value)
    if isinstance(plain, int | float) and is_person_field(name.rpartition(".")[2]):
        gathered.text(name, f"{plain:.15g}")
    elif isinstance(plain, str):
        gathered.text(name, plain)


def read_matlab(path: Path) -> Columns:
    """Return the variables of a level 5 file as columns; a field of a struct as `struct.field`.

    Parameters
    ----------
    path : Path

    Raises
    ------
    StudyError
        If it is too large, too deeply nested or damaged.
    """
    gathered = Gatherer("MATLAB v5")
    for name, value in read_variables(path).items():
        _add_variable(gathered, name, value, MAX_STRUCTS_DEEP)
    return gathered.result()


def _add_variable(gathered: Gatherer, name: str, value: Any, depth: int) -> None:
    if depth == 0 or not isinstance(value, np.ndarray):
        return
    if value.dtype == object:
        for number, inner in enumerate(value.reshape(-1), 1):
            place = name if value.size == 1 else f"{name}({number})"
            for field in getattr(inner, "_fieldnames", ()):
                _add_variable(gathered, f"{place}.{field}", getattr(inner, field), depth - 1)
            if isinstance(inner, np.ndarray):  # a cell
                structs = inner.dtype == object
                place = f"{name}{{{number}}}" if structs else _in_cell(name, number)
                _add_variable(gathered, place, inner, depth - 1)
    elif value.dtype.kind == "U" and value.size == 1:
        gathered.text(name, str(value.item()))
    elif value.dtype.kind in "biufc" and gathered.reserve(name, value.shape):
        gathered.add(name, value)

"""Reading a `study/1` file: attributes of all trials, data of one at a time."""

import hashlib
import json
import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path
from typing import Any, Literal, cast

import h5py
import numpy as np

from frictus.closing import Closing
from frictus.errors import printable
from frictus_hardware.arrays import FloatArray
from frictus_service.errors import Exclusion, FieldError, StudyError, TrialError, as_told
from frictus_service.study import hdf5
from frictus_service.study.hdf5 import (
    Stored,
    attributes_of,
    data_sets_in,
    group_in,
    names_in,
    open_file,
)
from frictus_service.study.layout import (
    DATA_SETS,
    MAX_VALUES,
    NAMES,
    ROOT,
    SCHEMA,
    ConverterStep,
    DataSet,
    hashed,
    in_time,
    is_shape_of,
    shape_hint,
)
from frictus_service.study.plausible import check_asked, check_measured, check_study
from frictus_service.study.trial import StudyInfo, Trial, TrialInfo, parse_mount


def read_asked(trial_id: str, group: h5py.Group) -> TrialInfo:
    """Return the attributes of a trial.

    Raises
    ------
    FieldError
        If one is missing, of another type or damaged.
    """
    return _asked(trial_id, attributes_of(group))


def count_samples(asked: TrialInfo, group: h5py.Group) -> int:
    """Return how many samples a trial has, from the shapes of its data sets.

    Raises
    ------
    FieldError
        If a data set is missing or does not fit the format.
    """
    return _checked_samples(asked, data_sets_in(group, NAMES))


def read_trial(trial_id: str, group: h5py.Group) -> Trial:
    """Return a trial with its hash.

    Raises
    ------
    FieldError
        If something is missing, damaged or does not fit the format.
    """
    held = attributes_of(group)
    asked = _asked(trial_id, held)
    stored = data_sets_in(group, NAMES)
    _checked_samples(asked, stored)
    values = {name: _values(found) for name, found in stored.items()}
    skin = "accel_m_s2" if "accel_m_s2" in stored else "skin_velocity_m_s"
    read = Trial(
        info=asked,
        voltage_v=values.get("voltage_v"),
        force_n=values["force_n"],
        accel_m_s2=values.get("accel_m_s2"),
        skin_velocity_m_s=values.get("skin_velocity_m_s"),
        position_mm=values["position_mm"],
        position_t_s=values["position_t_s"],
        force_skew_s=_skew(stored.get("force_n")),
        skin_skew_s=_skew(stored.get(skin)),
        voltage_source=_source(stored.get("voltage_v")),
    )
    read = hashed(read)
    _check_hash(held, read.sha256)
    return read


def _asked(trial_id: str, held: Mapping[str, Any]) -> TrialInfo:
    tones = hdf5.numbers(held, "tone_hz")
    return TrialInfo(
        id=trial_id,
        participant=hdf5.shown(held, "participant"),
        session=hdf5.whole(held, "session"),
        order=hdf5.whole(held, "order"),
        speed_mm_s=hdf5.number(held, "speed_mm_s"),
        force_n=hdf5.number(held, "force_n"),
        tones_hz=tuple(map(float, tones)) if any(tones) else (),
        drive_vpp=hdf5.number(held, "drive_vpp"),
        sample_rate_hz=hdf5.number(held, "sample_rate_hz"),
        started_utc=hdf5.shown(held, "started_utc"),
    )


def _checked_samples(asked: TrialInfo, stored: Mapping[str, Stored]) -> int:
    if "voltage_v" not in stored and asked.tones_hz:
        raise FieldError("voltage_v", "is missing; only a blank trial, of tone 0, has none")
    if "accel_m_s2" in stored and "skin_velocity_m_s" in stored:
        raise FieldError(
            "skin_velocity_m_s", "stands beside accel_m_s2; accepted: one of them, or none"
        )
    rows: dict[str, tuple[str, int]] = {}
    for data_set in DATA_SETS:
        if data_set.name in stored:
            length = _rows(data_set, stored[data_set.name])
            first, expected = rows.setdefault(data_set.along, (data_set.name, length))
            if length != expected:
                raise FieldError(
                    data_set.name, f"has {length} rows, {first} {expected}; accepted: as many"
                )
        elif data_set.required:
            raise FieldError(data_set.name, "is missing; every trial has it")
    return rows["sample"][1]


def _rows(data_set: DataSet, stored: Stored) -> int:
    """Return how many rows a data set has, having checked it."""
    if stored.kind not in "iuf":
        raise FieldError(data_set.name, "holds no numbers; accepted: integers or floats")
    if not is_shape_of(data_set, stored.shape):
        raise FieldError(data_set.name, shape_hint(data_set, stored.shape))
    rows = stored.shape[0] if data_set.columns > 1 else max(stored.shape)
    most = MAX_VALUES // data_set.columns
    if not 2 <= rows <= most:
        raise FieldError(data_set.name, f"has {rows} rows; accepted: 2 to {most}")
    return rows


def _values(stored: Stored) -> FloatArray:
    """Return what a data set stands for: scale and offset of integers applied."""
    raw = stored.read()
    if 1 in raw.shape[1:] or raw.shape[0] == 1:
        raw = raw.reshape(-1)
    if stored.kind == "f":
        if "scale" in stored.attributes or "offset" in stored.attributes:
            raise FieldError(
                stored.name, "has scale or offset on floats; they belong to integers"
            )
        return raw.astype(np.float64)
    columns = 1 if raw.ndim == 1 else raw.shape[1]
    return ConverterStep(
        _per_column(stored, "scale", columns), _per_column(stored, "offset", columns)
    ).values(raw)


def _per_column(stored: Stored, key: str, columns: int) -> tuple[float, ...]:
    """Return `scale` or `offset`: one number, or one per column."""
    if key not in stored.attributes:
        raise FieldError(
            stored.name,
            f"holds integers without the attribute {key}; value = raw * scale + offset",
        )
    found = hdf5.numbers(stored.attributes, key)
    usable = len(found) in (1, columns) and bool(np.all(np.isfinite(found)))
    if not usable or (key == "scale" and 0.0 in found):
        raise FieldError(
            stored.name, f"has {key} = {found}; accepted: a finite number, or one per column"
        )
    return found


def _skew(stored: Stored | None) -> float:
    if stored is None:
        return 0.0
    return hdf5.number(stored.attributes, "skew_s", default=0.0)


def _source(stored: Stored | None) -> Literal["command", "monitor"]:
    if stored is None or "source" not in stored.attributes:
        return "command"
    source = hdf5.text(stored.attributes, "source")
    if source not in ("command", "monitor"):
        raise FieldError(
            "voltage_v",
            f"has source = {as_told(source)}; accepted: 'command' or 'monitor'",
        )
    return cast(Literal["command", "monitor"], source)


def _check_hash(held: Mapping[str, Any], found: str) -> None:
    if "sha256" in held and hdf5.text(held, "sha256") != found:
        raise FieldError(
            "sha256",
            "the content does not match it: the file is damaged, or was edited; restore it, or "
            "delete the attribute to accept the content as it stands",
        )


class StudyReader(Closing):
    """An open `study/1` file; a context manager.

    Opening reads the root alone. `trials` and `excluded` read the attributes of all trials when
    they are first asked for; `read` reads one trial, so that a study of any size fits in
    memory.

    Parameters
    ----------
    path : Path or str
        Of the file.

    Attributes
    ----------
    path : Path
        As opened.
    info : StudyInfo
        Of the root.

    Raises
    ------
    FileNotFoundError
    StudyError
        If the file is not HDF5, is damaged at the root, is of another schema, lacks a root
        attribute or holds no trial.
    """

    def __init__(self, path: Path | str) -> None:
        self.path = Path(path)
        self._file = open_file(self.path)
        try:
            self.info = _read_info(attributes_of(self._file))
            self._names, self._group = _trials_of(self._file)
        except FieldError as error:
            self._file.close()
            raise StudyError(f"{self.path}, root, {error}") from error

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    @property
    def trials(self) -> tuple[TrialInfo, ...]:
        """Trials that can be read, by participant, session and order."""
        return self._listing[0]

    @property
    def excluded(self) -> tuple[Exclusion, ...]:
        """Trials whose attributes or shapes cannot be used, or whose place is taken."""
        return self._listing[1]

    def n_samples(self, trial_id: str) -> int:
        """Return how many samples a trial of `trials` has, without reading them."""
        return self._listing[2][trial_id]

    @cached_property
    def sha256(self) -> str:
        """Hash of the file's bytes, hexadecimal, as `sha256sum` gives it."""
        with self.path.open("rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()

    def read(self, trial_id: str) -> Trial:
        """Return one trial.

        Parameters
        ----------
        trial_id : str

        Raises
        ------
        TrialError
            If it cannot be used: an attribute, a shape, implausible values, damage.
        StudyError
            If there is no such trial.
        """
        if trial_id not in self._names:
            raise StudyError(f"{self.path}: there is no trial {trial_id!r}")
        with self._naming(trial_id):
            trial = read_trial(trial_id, self._trial(trial_id))
            check_asked(trial.info, self.info)
            check_measured(trial, self.info)
            return in_time(trial, self.info.positions_late_s or 0.0)

    @cached_property
    def _listing(self) -> tuple[tuple[TrialInfo, ...], tuple[Exclusion, ...], dict[str, int]]:
        trials: list[TrialInfo] = []
        n_samples: dict[str, int] = {}
        excluded: list[Exclusion] = []
        for name in sorted(self._names):
            try:
                with self._naming(name):
                    group = self._trial(name)
                    asked = read_asked(name, group)
                    check_asked(asked, self.info)
                    n_samples[name] = count_samples(asked, group)
                    trials.append(asked)
            except TrialError as error:
                excluded.append(error.exclusion)
        kept, taken = _one_per_place(trials)
        return kept, (*excluded, *taken), n_samples

    def _trial(self, trial_id: str) -> h5py.Group:
        if not self._file:
            raise StudyError(f"{self.path} was closed; read within the context of the reader")
        group = group_in(self._group, trial_id)
        if group is None or not trial_id.isprintable():
            raise FieldError("group", "is no group with a UTF-8 name; accepted: /trials/<id>")
        return group

    @contextmanager
    def _naming(self, trial_id: str) -> Iterator[None]:
        try:
            yield
        except FieldError as error:
            exclusion = Exclusion(printable(trial_id), error.field, error.reason)
            raise TrialError(self.path, exclusion) from error


def _read_info(held: Mapping[str, Any]) -> StudyInfo:
    schema = hdf5.text(held, "schema")
    if schema != SCHEMA:
        raise FieldError("schema", f"is {as_told(schema)}; accepted: {SCHEMA!r}")
    mount_json = hdf5.text(held, "mount") if "mount" in held else None
    late = "positions_late_s"
    info = StudyInfo(
        rig=hdf5.shown(held, "rig"),
        carrier_hz=hdf5.number(held, "carrier_hz"),
        screen_peak_v=hdf5.number(held, "screen_peak_v"),
        mount=None if mount_json is None else parse_mount(mount_json),
        mount_json=mount_json,
        positions_late_s=None if late not in held else hdf5.number(held, late),
        extras=_extras(held),
    )
    check_study(info)
    return info


def _extras(held: Mapping[str, Any]) -> dict[str, str | int | float]:
    extras: dict[str, str | int | float] = {}
    for name in sorted(set(held) - set(ROOT)):
        value = hdf5.plain(held[name])
        if isinstance(value, tuple):
            extras[printable(name)] = json.dumps(value)
        elif isinstance(value, float) and not math.isfinite(value):  # JSON has no such numbers
            extras[printable(name)] = str(value)
        elif value is not None:
            extras[printable(name)] = printable(value) if isinstance(value, str) else value
    return extras


def _trials_of(file: h5py.File) -> tuple[frozenset[str], h5py.Group]:
    group = group_in(file, "trials")
    if group is None:
        raise FieldError("trials", "is missing; trials are the groups /trials/<id>")
    names = frozenset(names_in(group, "trials"))
    if not names:
        raise FieldError("trials", "holds no trial; accepted: at least one")
    return names, group


def _one_per_place(
    trials: list[TrialInfo],
) -> tuple[tuple[TrialInfo, ...], tuple[Exclusion, ...]]:
    """Return the trials in order, the first of each place in it, and the others."""
    kept: dict[tuple[str, int, int], TrialInfo] = {}
    taken: list[Exclusion] = []
    for asked in sorted(
        trials, key=lambda asked: (*_place(asked), asked.started_utc, asked.id)
    ):
        first = kept.setdefault(_place(asked), asked)
        if first is not asked:
            taken.append(
                Exclusion(
                    asked.id,
                    "order",
                    f"participant {asked.participant}, session {asked.session}, order "
                    f"{asked.order} is trial {first.id} too; a copy is to be deleted, another "
                    "trial to be given its own order",
                )
            )
    return tuple(kept.values()), tuple(taken)


def _place(asked: TrialInfo) -> tuple[str, int, int]:
    return (asked.participant, asked.session, asked.order)

"""One trial as a group of the file: its attributes, and its data sets as numbers."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Literal, cast

import h5py
import numpy as np

from frictus_hardware.arrays import FloatArray
from frictus_service.errors import FieldError
from frictus_service.study import hdf5
from frictus_service.study.hdf5 import Stored, attributes_of, data_sets_in
from frictus_service.study.layout import (
    DATA_SETS,
    MAX_VALUES,
    NAMES,
    ConverterStep,
    DataSet,
    digest,
    is_shape_of,
    shape_hint,
)
from frictus_service.study.trial import Trial, TrialInfo


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
    read = replace(read, sha256=digest(read))
    _check_hash(held, read.sha256)
    return read


def _asked(trial_id: str, held: Mapping[str, Any]) -> TrialInfo:
    tones = hdf5.numbers(held, "tone_hz")
    return TrialInfo(
        id=trial_id,
        participant=hdf5.text(held, "participant"),
        session=hdf5.whole(held, "session"),
        order=hdf5.whole(held, "order"),
        speed_mm_s=hdf5.number(held, "speed_mm_s"),
        force_n=hdf5.number(held, "force_n"),
        tones_hz=tuple(map(float, tones)) if any(tones) else (),
        drive_vpp=hdf5.number(held, "drive_vpp"),
        sample_rate_hz=hdf5.number(held, "sample_rate_hz"),
        started_utc=hdf5.text(held, "started_utc"),
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
            "voltage_v", f"has source = {source!r}; accepted: 'command' or 'monitor'"
        )
    return cast(Literal["command", "monitor"], source)


def _check_hash(held: Mapping[str, Any], found: str) -> None:
    if "sha256" in held and hdf5.text(held, "sha256") != found:
        raise FieldError(
            "sha256",
            "the content does not match it: the file is damaged, or was edited; restore it, or "
            "delete the attribute to accept the content as it stands",
        )

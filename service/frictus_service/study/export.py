"""A study for other programs: MATLAB files, or Parquet tables.

A study as MATLAB files: `study.mat` tells what there is, and each trial has a file.

Files of level 5, which every MATLAB, Octave and scipy reads; one variable holds up to 2 GiB,
and those of a trial stay below. `docs/study.md` shows how to load them.

A study as Parquet tables, for pandas, polars, DuckDB and the like.

`samples.parquet` and `positions.parquet` hold one row group per trial, so that one trial is
read without the others; `trials.parquet` and `excluded.parquet` one row per trial. What holds
for the study is metadata of `trials.parquet`, under the key `study`, as JSON.
"""

import json
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray
from scipy.io import savemat

from frictus_service.durable import new_folder
from frictus_service.errors import Exclusion
from frictus_service.study.importers import Study, read_all
from frictus_service.study.layout import NAMES
from frictus_service.study.trial import Trial, mount_text, row_of


def export_matlab(study: Study, folder: Path) -> tuple[Exclusion, ...]:
    """Write a study as MATLAB files, one trial in memory at a time.

    Parameters
    ----------
    study : Study
        Open.
    folder : Path
        Must not exist; it appears when everything is written.

    Returns
    -------
    tuple of Exclusion
        What was left out, and why; `study.mat` says so too.

    Raises
    ------
    StudyError
        If the folder exists.
    """
    rows: list[dict[str, Any]] = []
    excluded: list[Exclusion] = []
    with new_folder(folder) as unfinished:
        for found in read_all(study):
            if isinstance(found, Exclusion):
                excluded.append(found)
                continue
            row = {"file": f"trial_{len(rows) + 1:05d}.mat", **row_of(found)}
            _save(unfinished / row["file"], row | _data(found))
            rows.append(row)
        index = {
            **_root(study),
            "trials": _struct_array(rows),
            "excluded": _struct_array([asdict(one) for one in excluded]),
        }
        _save(unfinished / "study.mat", index)
    return tuple(excluded)


def _root(study: Study) -> dict[str, Any]:
    return {
        "rig": study.info.rig,
        "carrier_hz": study.info.carrier_hz,
        "screen_peak_v": study.info.screen_peak_v,
        "mount": mount_text(study.info) or "",
        "extras": json.dumps(study.info.extras),
        "sha256": study.sha256,
    }


def _data(trial: Trial) -> dict[str, Any]:
    """Return the data sets; an absent one is an empty array."""
    held = {name: getattr(trial, name) for name in NAMES}
    return {name: [] if values is None else values for name, values in held.items()}


def _struct_array(rows: Sequence[Mapping[str, Any]]) -> Any:
    """Return what MATLAB shows as a struct array of one element per row."""
    if not rows:
        return []
    array = np.empty((len(rows), 1), dtype=[(name, object) for name in rows[0]])
    for index, row in enumerate(rows):
        array[index, 0] = tuple(map(_of_matlab, row.values()))
    return array


def _of_matlab(value: Any) -> Any:
    """Return a value as MATLAB has it: every number a double."""
    if isinstance(value, str):
        return value
    return np.asarray(value, dtype=np.float64)


def _save(path: Path, variables: Mapping[str, Any]) -> None:
    plain = {
        name: value if isinstance(value, np.ndarray) else _of_matlab(value)
        for name, value in variables.items()
    }
    savemat(path, plain, long_field_names=True, oned_as="column")


COMPRESSION: Final = "zstd"
_TRIALS: Final = pa.schema(
    [(name, pa.string()) for name in ("id", "participant")]
    + [(name, pa.int64()) for name in ("session", "order")]
    + [(name, pa.float64()) for name in ("target_speed_mm_s", "target_force_n")]
    + [("tone_hz", pa.list_(pa.float64()))]
    + [(name, pa.float64()) for name in ("drive_vpp", "sample_rate_hz")]
    + [(name, pa.string()) for name in ("started_utc", "voltage_source")]
    + [(name, pa.float64()) for name in ("force_skew_s", "skin_skew_s")]
    + [("sha256", pa.string())]
)
_EXCLUDED: Final = pa.schema([(name, pa.string()) for name in ("trial", "field", "reason")])
_KEY: Final = ("trial", pa.dictionary(pa.int32(), pa.string()))
_COLUMNS: Final = {
    "voltage_v": ("voltage_v",),
    "force_n": ("force_x_n", "force_y_n", "force_z_n"),
    "accel_m_s2": ("accel_x_m_s2", "accel_y_m_s2", "accel_z_m_s2"),
    "skin_velocity_m_s": ("skin_velocity_m_s",),
    "position_t_s": ("t_s",),
    "position_mm": ("x_mm", "y_mm"),
}
_OF_SAMPLES: Final = ("voltage_v", "force_n", "accel_m_s2", "skin_velocity_m_s")
_OF_POSITIONS: Final = ("position_t_s", "position_mm")


def export_parquet(study: Study, folder: Path) -> tuple[Exclusion, ...]:
    """Write a study as Parquet tables, one trial in memory at a time.

    Parameters
    ----------
    study : Study
        Open.
    folder : Path
        Must not exist; it appears when everything is written.

    Returns
    -------
    tuple of Exclusion
        What was left out, and why; `excluded.parquet` says so too.

    Raises
    ------
    StudyError
        If the folder exists.
    """
    rows: list[dict[str, Any]] = []
    excluded: list[Exclusion] = []
    with new_folder(folder) as unfinished:
        with ExitStack() as open_files:
            samples, positions = (
                open_files.enter_context(
                    pq.ParquetWriter(unfinished / name, _schema(names), compression=COMPRESSION)
                )
                for name, names in (
                    ("samples.parquet", _OF_SAMPLES),
                    ("positions.parquet", _OF_POSITIONS),
                )
            )
            for found in read_all(study):
                if isinstance(found, Exclusion):
                    excluded.append(found)
                    continue
                _append(samples, found, _OF_SAMPLES)
                _append(positions, found, _OF_POSITIONS)
                rows.append(row_of(found))
        trials = pa.Table.from_pylist(
            rows, _TRIALS.with_metadata({"study": _parquet_root(study)})
        )
        pq.write_table(trials, unfinished / "trials.parquet")
        left_out = pa.Table.from_pylist([asdict(one) for one in excluded], _EXCLUDED)
        pq.write_table(left_out, unfinished / "excluded.parquet")
    return tuple(excluded)


def _parquet_root(study: Study) -> str:
    return json.dumps(
        {
            "rig": study.info.rig,
            "carrier_hz": study.info.carrier_hz,
            "screen_peak_v": study.info.screen_peak_v,
            "mount": mount_text(study.info),
            "extras": study.info.extras,
            "sha256": study.sha256,
        }
    )


def _schema(names: Sequence[str]) -> Any:
    columns = [(column, pa.float64()) for name in names for column in _COLUMNS[name]]
    return pa.schema([_KEY, ("row", pa.int64()), *columns])


def _append(writer: Any, trial: Trial, names: Sequence[str]) -> None:
    """Write the named data sets of a trial as one row group; absent ones as nulls."""
    length = len(getattr(trial, names[-1]) if names is _OF_POSITIONS else trial.force_n)
    columns = [
        pa.DictionaryArray.from_arrays(np.zeros(length, dtype=np.int32), [trial.info.id]),
        pa.array(np.arange(length)),
    ]
    for name in names:
        columns += _columns(getattr(trial, name), len(_COLUMNS[name]), length)
    table = pa.table(columns, schema=_schema(names))
    writer.write_table(table, row_group_size=length)


def _columns(values: NDArray[np.float64] | None, width: int, length: int) -> list[Any]:
    if values is None:
        return [pa.nulls(length, pa.float64())] * width
    return [pa.array(column) for column in np.atleast_2d(values.T)]

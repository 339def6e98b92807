"""A study as Parquet tables, for pandas, polars, DuckDB and the like.

`samples.parquet` and `positions.parquet` hold one row group per trial, so that one trial is
read without the others; `trials.parquet` and `excluded.parquet` one row per trial. What holds
for the study is metadata of `trials.parquet`, under the key `study`, as JSON.
"""

import json
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from frictus_service.study.errors import Exclusion
from frictus_service.study.mount import mount_text
from frictus_service.study.new_folder import new_folder
from frictus_service.study.study import Study, read_all
from frictus_service.study.trial import Trial
from frictus_service.study.trial_row import row_of

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
        trials = pa.Table.from_pylist(rows, _TRIALS.with_metadata({"study": _root(study)}))
        pq.write_table(trials, unfinished / "trials.parquet")
        left_out = pa.Table.from_pylist([asdict(one) for one in excluded], _EXCLUDED)
        pq.write_table(left_out, unfinished / "excluded.parquet")
    return tuple(excluded)


def _root(study: Study) -> str:
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

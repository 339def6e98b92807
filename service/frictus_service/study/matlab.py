"""A study as MATLAB files: `study.mat` tells what there is, and each trial has a file.

Files of level 5, which every MATLAB, Octave and scipy reads; one variable holds up to 2 GiB,
and those of a trial stay below. `docs/study.md` shows how to load them.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from scipy.io import savemat

from frictus_service.study.errors import Exclusion
from frictus_service.study.layout import NAMES
from frictus_service.study.mount import mount_text
from frictus_service.study.new_folder import new_folder
from frictus_service.study.study import Study, read_all
from frictus_service.study.trial import Trial
from frictus_service.study.trial_row import row_of


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

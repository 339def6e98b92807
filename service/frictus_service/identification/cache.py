"""Observations on disk, by the content they were made from.

The key of a trial is the hash of its content, of what of the study enters its observations, and
of the estimator's own source, so that nothing can be out of date. Beside them stands, per study
file, which content its trials had when it was last read: as long as the file's size and time
stay the same, its trials need not even be read.
"""

import hashlib
import json
import os
import tempfile
from dataclasses import dataclass, fields
from functools import lru_cache
from pathlib import Path
from typing import Any, Final

import numpy as np

from frictus_hardware.physics import linear
from frictus_service.identification import (
    blocks,
    clipping,
    least_squares,
    message,
    observe,
    response,
    sweeps,
    tones,
    validity,
)
from frictus_service.identification.observation import Rows, TrialObservations
from frictus_service.study.trial import StudyInfo, TrialInfo

_ESTIMATOR: Final = (
    blocks,
    clipping,
    least_squares,
    linear,
    message,
    observe,
    response,
    sweeps,
    tones,
    validity,
)
_ROW: Final = np.dtype(
    [(each.name, getattr(response.NO_ROWS, each.name).dtype) for each in fields(Rows)]
)


@lru_cache(maxsize=1)
def estimator_version() -> str:
    """Return the hash of the source of all that turns a trial into observations."""
    hashed = hashlib.sha256()
    for module in _ESTIMATOR:
        hashed.update(Path(str(module.__file__)).read_bytes())
    return hashed.hexdigest()


@dataclass(frozen=True, slots=True)
class Cache:
    """A folder of observations; several processes may use it at once.

    Attributes
    ----------
    folder : Path
        Made where it is missing.
    """

    folder: Path

    def find(self, sha256: str, asked: TrialInfo, study: StudyInfo) -> TrialObservations | None:
        """Return the observations of a trial; None where there are none, or damaged ones.

        Parameters
        ----------
        sha256 : str
            Of the trial's content.
        asked : TrialInfo
            Taken over: a copy of the trial may have another id.
        study : StudyInfo
        """
        held = _unsealed(self._place(sha256, study))
        return None if held is None else _decoded(held, sha256, asked)

    def keep(self, observed: TrialObservations, study: StudyInfo) -> None:
        """Store the observations of a trial."""
        _seal(self._place(observed.sha256, study), _encoded(observed))

    def contents(self, state: str) -> dict[str, str]:
        """Return the hashes of a file's trials by id, as far as they are known.

        Parameters
        ----------
        state : str
            Of the file, from `state_of`.
        """
        held = _unsealed(self._index(state))
        known: dict[str, str] = {} if held is None else json.loads(held)
        return known

    def keep_contents(self, state: str, hashes: dict[str, str]) -> None:
        """Store the hashes of a file's trials by id.

        Parameters
        ----------
        state : str
            From before the file was read.
        hashes : dict
        """
        _seal(self._index(state), json.dumps(hashes, sort_keys=True).encode())

    def _place(self, sha256: str, study: StudyInfo) -> Path:
        mount = study.mount and (study.mount.numerator, study.mount.denominator)
        asked = [sha256, estimator_version(), study.screen_peak_v, mount]
        key = hashlib.sha256(json.dumps(asked).encode()).hexdigest()
        return self.folder / key[:2] / f"{key}.observations"

    def _index(self, state: str) -> Path:
        return self.folder / "studies" / f"{state}.contents"


def state_of(file: Path) -> str:
    """Return what changes when a file does: a hash of its place, size and time.

    Parameters
    ----------
    file : Path
    """
    found = file.stat()
    asked = [str(file.resolve()), found.st_size, found.st_mtime_ns]
    return hashlib.sha256(json.dumps(asked).encode()).hexdigest()


def _encoded(observed: TrialObservations) -> bytes:
    rows = np.empty(observed.rows.sweep.size, dtype=_ROW)
    for name in rows.dtype.names or ():
        rows[name] = getattr(observed.rows, name)
    said = {
        "valid": observed.valid,
        "reasons": observed.reasons,
        "notes": observed.notes,
        "mean_speed_mm_s": observed.mean_speed_mm_s,
        "mean_force_n": observed.mean_force_n,
    }
    return json.dumps(said).encode() + b"\n" + rows.tobytes()


def _decoded(held: bytes, sha256: str, asked: TrialInfo) -> TrialObservations:
    head, _, body = held.partition(b"\n")
    said: dict[str, Any] = json.loads(head)
    rows = np.frombuffer(body, dtype=_ROW)
    return TrialObservations(
        info=asked,
        sha256=sha256,
        valid=said["valid"],
        reasons=tuple(said["reasons"]),
        notes=tuple(said["notes"]),
        mean_speed_mm_s=said["mean_speed_mm_s"],
        mean_force_n=said["mean_force_n"],
        rows=Rows(**{name: rows[name].copy() for name in rows.dtype.names or ()}),
    )


def _seal(place: Path, content: bytes) -> None:
    """Write a file with its hash, whole or not at all."""
    place.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=place.parent, suffix=".part")
    try:
        with os.fdopen(handle, "wb") as stream:
            stream.write(hashlib.sha256(content).digest() + content)
        os.replace(name, place)
    except BaseException:
        os.unlink(name)
        raise


def _unsealed(place: Path) -> bytes | None:
    """Return what was sealed; None where there is nothing, or not what was sealed."""
    try:
        held = place.read_bytes()
    except FileNotFoundError:
        return None
    seal, content = held[:32], held[32:]
    return content if hashlib.sha256(content).digest() == seal else None

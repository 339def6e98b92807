"""Readings of trials on disk, by the content they were made from.

The key of a trial is the hash of its content, of what of the study enters its observations, and
of the source of all that read it, so that nothing can be out of date. Beside them stands, per
study file, which content its trials had when it was last read: as long as the file's size and
time stay the same, its trials need not even be read.
"""

import hashlib
import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from frictus_service.durable import replace_file
from frictus_service.identification.observation.response import ResponseRows, TrialObservations
from frictus_service.identification.pipeline.workers import (
    Reader,
    Reading,
    Table,
    columns_of,
    table_of,
    version_of,
)
from frictus_service.study.trial import StudyInfo, TrialInfo

_ESTIMATOR: Final = (
    "frictus_hardware.physics.linear",
    "frictus_service.identification.observation.blocks",
    "frictus_service.identification.observation.hann_spectrum",
    "frictus_service.identification.observation.images",
    "frictus_service.identification.observation.least_squares",
    "frictus_service.identification.observation.observe",
    "frictus_service.identification.observation.response",
    "frictus_service.identification.observation.standing",
    "frictus_service.identification.observation.sweeps",
    "frictus_service.identification.observation.tones",
    "frictus_service.identification.observation.validity",
    "frictus_service.identification.pipeline.workers",
)


def estimator_version() -> str:
    """Return the hash of the source of all that turns a trial into observations."""
    return version_of(_ESTIMATOR)


@dataclass(frozen=True, slots=True)
class Cache:
    """A folder of readings; several processes may use it at once.

    Attributes
    ----------
    folder : Path
        Made where it is missing.
    reader : Reader
        Whose readings are kept and found.
    """

    folder: Path
    reader: Reader

    def find(self, sha256: str, asked: TrialInfo, study: StudyInfo) -> Reading | None:
        """Return the reading of a trial; None where there is none, or a damaged one.

        Parameters
        ----------
        sha256 : str
            Of the trial's content.
        asked : TrialInfo
            Taken over: a copy of the trial may have another id.
        study : StudyInfo
            What holds for all trials: carrier, peak voltage, mount.
        """
        held = unsealed(self._place(sha256, study))
        return None if held is None else _decoded(held, sha256, asked)

    def keep(self, reading: Reading, study: StudyInfo) -> None:
        """Store the reading of a trial."""
        seal(self._place(reading.observed.sha256, study), _encoded(reading))

    def contents(self, state: str) -> dict[str, str]:
        """Return the hashes of a file's trials by id, as far as they are known.

        Parameters
        ----------
        state : str
            Of the file, from `state_of`.
        """
        held = unsealed(self._index(state))
        known: dict[str, str] = {} if held is None else json.loads(held)
        return known

    def keep_contents(self, state: str, hashes: dict[str, str]) -> None:
        """Store the hashes of a file's trials by id.

        Parameters
        ----------
        state : str
            From before the file was read.
        hashes : dict
            From trial id to hash.
        """
        seal(self._index(state), json.dumps(hashes, sort_keys=True).encode())

    def _place(self, sha256: str, study: StudyInfo) -> Path:
        mount = study.mount and (study.mount.numerator, study.mount.denominator)
        version = [estimator_version(), self.reader.name, self.reader.version]
        asked = [sha256, *version, study.carrier_hz, study.screen_peak_v, mount]
        key = hashlib.sha256(json.dumps(asked).encode()).hexdigest()
        return self.folder / key[:2] / f"{key}.{self.reader.name}"

    def _index(self, state: str) -> Path:
        return self.folder / "studies" / f"{state}.contents"


def _encoded(reading: Reading) -> bytes:
    observed = reading.observed
    tables = {"rows": table_of(observed.rows), **reading.more}
    said = {
        "valid": observed.valid,
        "reasons": observed.reasons,
        "notes": observed.notes,
        "mean_speed_mm_s": observed.mean_speed_mm_s,
        "mean_force_n": observed.mean_force_n,
        "measured_sha256": observed.measured_sha256,
        "tables": [(name, table.dtype.descr, table.size) for name, table in tables.items()],
    }
    return json.dumps(said).encode() + b"\n" + b"".join(t.tobytes() for t in tables.values())


def _decoded(held: bytes, sha256: str, asked: TrialInfo) -> Reading:
    head, _, body = held.partition(b"\n")
    said: dict[str, Any] = json.loads(head)
    tables = dict(_tables(said["tables"], body))
    observed = TrialObservations(
        info=asked,
        sha256=sha256,
        valid=said["valid"],
        reasons=tuple(said["reasons"]),
        notes=tuple(said["notes"]),
        mean_speed_mm_s=said["mean_speed_mm_s"],
        mean_force_n=said["mean_force_n"],
        rows=columns_of(ResponseRows, tables.pop("rows")),
        measured_sha256=said["measured_sha256"],
    )
    return Reading(observed, tables)


def _tables(
    listed: list[tuple[str, list[list[str]], int]], body: bytes
) -> Iterator[tuple[str, Table]]:
    first = 0
    for name, columns, count in listed:
        kind = np.dtype([(column, code) for column, code in columns])
        yield name, np.frombuffer(body, kind, count, first)
        first += count * kind.itemsize


def seal(place: Path, content: bytes) -> None:
    """Write a file with its hash, whole or not at all.

    Parameters
    ----------
    place : Path
        Its folder is made where it is missing.
    content : bytes
        Of the file, hash aside.
    """
    place.parent.mkdir(parents=True, exist_ok=True)
    replace_file(place, hashlib.sha256(content).digest() + content)


def unsealed(place: Path) -> bytes | None:
    """Return what was sealed; None where there is nothing, or not what was sealed."""
    try:
        held = place.read_bytes()
    except FileNotFoundError:
        return None
    seal, content = held[:32], held[32:]
    return content if hashlib.sha256(content).digest() == seal else None

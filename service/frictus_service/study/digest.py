"""The hash of a trial's content: the same wherever, in whatever number format it is stored.

Hashed are a JSON object of the attributes (`docs/study.md` lists its keys) and, after a line
feed, the hash of what was measured: of each data set that is there, in a fixed order, its name,
its shape and its values as little-endian float64, row by row, every NaN as the same NaN. The id
is left out: a copy under another id shows.
"""

import hashlib
import json
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from frictus_hardware.arrays import FloatArray
from frictus_service.study.errors import Exclusion
from frictus_service.study.trial import Trial

_NAN = np.float64("nan")


def digest(trial: Trial) -> str:
    """Return the SHA-256 of a trial, hexadecimal.

    Parameters
    ----------
    trial : Trial
        Its id and its `sha256` do not count.
    """
    whole = _attributes(trial) + b"\n" + measured_digest(trial).encode()
    return hashlib.sha256(whole).hexdigest()


def measured_digest(trial: Trial) -> str:
    """Return the SHA-256 of the data sets alone, hexadecimal.

    Noise makes two measurements differ: where it is the same for two trials, one is a copy,
    whatever its attributes say.
    """
    hashed = hashlib.sha256()
    for name, values in _data_sets(trial):
        hashed.update(f"{name} {list(values.shape)}\n".encode())
        hashed.update(_canonical(values).data.cast("B"))
    return hashed.hexdigest()


def _attributes(trial: Trial) -> bytes:
    info = trial.info
    asked: dict[str, Any] = {
        "participant": info.participant,
        "session": info.session,
        "order": info.order,
        "speed_mm_s": float(info.speed_mm_s),
        "force_n": float(info.force_n),
        "tone_hz": [float(tone) for tone in info.tones_hz],
        "drive_vpp": float(info.drive_vpp),
        "sample_rate_hz": float(info.sample_rate_hz),
        "started_utc": info.started_utc,
        "force_skew_s": float(trial.force_skew_s),
    }
    if trial.voltage_v is not None:
        asked["voltage_source"] = trial.voltage_source
    if trial.accel_m_s2 is not None or trial.skin_velocity_m_s is not None:
        asked["skin_skew_s"] = float(trial.skin_skew_s)
    return json.dumps(asked, sort_keys=True, separators=(",", ":")).encode()


def _data_sets(trial: Trial) -> Iterator[tuple[str, FloatArray]]:
    for name in (
        "voltage_v",
        "force_n",
        "accel_m_s2",
        "skin_velocity_m_s",
        "position_mm",
        "position_t_s",
    ):
        values = getattr(trial, name)
        if values is not None and values.size:
            yield name, values


def _canonical(values: FloatArray) -> NDArray[np.float64]:
    plain = np.ascontiguousarray(values, dtype="<f8")
    missing = np.isnan(plain)
    return np.where(missing, _NAN, plain) if missing.any() else plain


def duplicates(hashes: Iterable[tuple[str, str]]) -> tuple[Exclusion, ...]:
    """Return the trials that are copies of an earlier one.

    Parameters
    ----------
    hashes : iterable of (trial id, hash)
        Of `measured_digest`, in order: the first of several equal ones is kept.
    """
    first: dict[str, str] = {}
    return tuple(
        copy_of(first[measured], trial)
        for trial, measured in hashes
        if first.setdefault(measured, trial) != trial
    )


def copy_of(kept: str, trial: str) -> Exclusion:
    """Return why a trial is left out that holds the same as the one kept."""
    return Exclusion(
        trial,
        "data",
        f"holds the same measurement as trial {kept}, which alone is used; delete the copy, or "
        "write what was measured",
    )

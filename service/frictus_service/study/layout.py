"""The layout of `study/1`: names, shapes, number formats, and the hash of a trial's content.

Hashed are a JSON object of the attributes (`docs/study.md` lists its keys) and, after a line
feed, the hash of what was measured: of each data set that is there, in a fixed order, its name,
its shape and its values as little-endian float64, row by row, every NaN as the same NaN. The id
is left out: a copy under another id shows.
"""

import hashlib
import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from frictus_hardware.arrays import FloatArray
from frictus_service.errors import Exclusion, FieldError
from frictus_service.study.trial import Trial

SCHEMA: Final = "study/1"
ROOT: Final = ("schema", "rig", "carrier_hz", "screen_peak_v", "mount", "positions_late_s")
MAX_VALUES: Final = 200_000_000
"""Of one data set: one trial at a time is held in memory, as float64."""


@dataclass(frozen=True, slots=True)
class DataSet:
    """One data set of a trial.

    Attributes
    ----------
    name : str
        Unique among its kind.
    columns : int
        1: a vector.
    along : {'sample', 'position'}
        What a row is; all data sets of a kind have as many rows.
    required : bool
        Whether a trial without it is refused.
    """

    name: str
    columns: int
    along: str
    required: bool


DATA_SETS: Final = (
    DataSet("voltage_v", 1, "sample", required=False),
    DataSet("force_n", 3, "sample", required=True),
    DataSet("accel_m_s2", 3, "sample", required=False),
    DataSet("skin_velocity_m_s", 1, "sample", required=False),
    DataSet("position_mm", 2, "position", required=True),
    DataSet("position_t_s", 1, "position", required=True),
)
NAMES: Final = tuple(data_set.name for data_set in DATA_SETS)


def is_shape_of(data_set: DataSet, shape: tuple[int, ...]) -> bool:
    """Return whether an array of this shape holds the data set.

    A vector may also be a matrix of one row or one column, as MATLAB writes it.
    """
    if data_set.columns > 1:
        return len(shape) == 2 and shape[1] == data_set.columns
    return len(shape) == 1 or (len(shape) == 2 and 1 in shape)


def shape_hint(data_set: DataSet, shape: tuple[int, ...]) -> str:
    """Return what to say of a shape that is not the data set's."""
    letter = "n" if data_set.along == "sample" else "k"
    asked = f"({letter}, {data_set.columns})" if data_set.columns > 1 else f"({letter},)"
    hint = f"has shape {shape}; accepted: {asked}, time along the first axis"
    if len(shape) == 2 and shape[0] == data_set.columns > 1:
        hint += "; write its transpose (MATLAB reverses the axes of what it stores)"
    return hint


@dataclass(frozen=True, slots=True)
class ConverterStep:
    """How a converter counts: value = count * scale + offset.

    Attributes
    ----------
    scale : float or tuple of float
        Unit per count, of all columns or of each; not 0.
    offset : float or tuple of float
        Value of a count of 0; one for each column.
    """

    scale: float | tuple[float, ...]
    offset: float | tuple[float, ...] = 0.0

    def values(self, counts: NDArray[Any]) -> FloatArray:
        """Return what counts stand for; the very numbers that every reader gets."""
        values: FloatArray = counts * np.asarray(self.scale, dtype=np.float64)
        values += np.asarray(self.offset, dtype=np.float64)
        return values

    def counts(self, values: FloatArray) -> NDArray[np.float64]:
        """Return the nearest counts, as floats."""
        scale, offset = np.asarray(self.scale), np.asarray(self.offset)
        counts: FloatArray = np.rint((values - offset) / scale)
        return counts


@dataclass(frozen=True, slots=True)
class Encoded:
    """A data set as it stands in the file.

    Attributes
    ----------
    raw : ndarray
        Counts, or the values themselves.
    step : ConverterStep or None
        Of integers.
    """

    raw: NDArray[Any]
    step: ConverterStep | None

    @property
    def values(self) -> FloatArray:
        """What a reader gets."""
        return self.raw.astype(np.float64) if self.step is None else self.step.values(self.raw)


def encode(field: str, values: FloatArray, step: ConverterStep | None) -> Encoded:
    """Return how to store an array.

    Parameters
    ----------
    field : str
        Name of the data set.
    values : ndarray
        NaN where samples are missing; counts cannot say that, so these stay floating point.
    step : ConverterStep or None
        None: exact, as float32 where that is enough.

    Raises
    ------
    FieldError
        If the step does not suit the values.
    """
    values = np.asarray(values, dtype=np.float64)
    if step is None or not np.all(np.isfinite(values)):
        with np.errstate(over="ignore"):
            short = values.astype(np.float32)
        exact = np.array_equal(short.astype(np.float64), values, equal_nan=True)
        return Encoded(short if exact else values, None)
    counts = step.counts(values)
    for kind in (np.int16, np.int32):
        limits = np.iinfo(kind)
        if not np.all(np.isfinite(counts)):
            break
        if limits.min <= counts.min(initial=0.0) and counts.max(initial=0.0) <= limits.max:
            return Encoded(counts.astype(kind), step)
    raise FieldError(
        field,
        f"reaches more than 32 bits of counts at a step of {step.scale}; give the step of the "
        "converter",
    )


_NAN = np.float64("nan")


def digest(trial: Trial) -> str:
    """Return the SHA-256 of a trial, hexadecimal.

    Parameters
    ----------
    trial : Trial
        Its id and its `sha256` do not count.
    """
    return hashed(trial).sha256


def hashed(trial: Trial) -> Trial:
    """Return a trial with its hashes: `digest`, and `measured_digest`, which it is made of."""
    measured = measured_digest(trial)
    whole = _attributes(trial) + b"\n" + measured.encode()
    sha256 = hashlib.sha256(whole).hexdigest()
    return replace(trial, sha256=sha256, measured_sha256=measured)


def in_time(trial: Trial, late_s: float) -> Trial:
    """Return a trial whose positions are as much earlier as they come late, with its hashes."""
    if not late_s:
        return trial
    return hashed(replace(trial, position_t_s=trial.position_t_s - late_s))


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

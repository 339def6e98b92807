"""Writing a `study/1` file, trial by trial."""

import contextlib
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Final, Self

import h5py
import numpy as np

from frictus_service.durable import put_in_free_place, remove_left_beside, unfinished_beside
from frictus_service.errors import FieldError, NotWrittenError, StudyError
from frictus_service.study.hdf5_output import Hdf5Output, not_written
from frictus_service.study.layout import (
    DATA_SETS,
    SCHEMA,
    ConverterStep,
    Encoded,
    digest,
    encode,
    is_shape_of,
    shape_hint,
)
from frictus_service.study.trial import StudyInfo, Trial, mount_text

MAX_CHUNK_ROWS: Final = 1 << 20


class StudyWriter:
    """A new `study/1` file; a context manager.

    The file appears under its name, whole, when the context ends; where it ends with an error,
    nothing appears. Everything in it carries a checksum, and each trial the hash of its
    content, so that a reader notices a flipped bit.

    Parameters
    ----------
    path : Path or str
        Of the file.
    info : StudyInfo

    Raises
    ------
    StudyError
        If there is such a file already.
    NotWrittenError
        If its folder takes none.
    """

    def __init__(self, path: Path | str, info: StudyInfo) -> None:
        self.path = Path(path)
        if self.path.exists():
            raise _exists(self.path)
        self._unfinished = unfinished_beside(self.path)
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            remove_left_beside(self.path)
            self._output = Hdf5Output(self._unfinished)
        except OSError as error:
            raise not_written(self.path, error) from error
        # v110: this version of the format protects names, attributes and indices by checksums.
        self._file = h5py.File(self._output, "w", libver=("v110", "v110"))
        try:
            self._trials = self._file.create_group("trials")
            _write_attributes(self._file, _root(info))
        except BaseException:
            self._discard()
            raise

    def __enter__(self) -> Self:
        """Return the writer."""
        return self

    def __exit__(self, error: type[BaseException] | None, *_: object) -> None:
        """Put the file in its place, or discard it after an error."""
        if error is None:
            self.close()
        else:
            self._discard()

    def close(self) -> None:
        """Put the file in its place.

        Raises
        ------
        StudyError
            If another came there meanwhile, which stays.
        NotWrittenError
            If the disk is full.
        """
        if not self._file:
            return
        try:
            with self._output.in_whole(self.path):
                self._file.close()
            self._output.close()
            put_in_free_place(self._unfinished, self.path)
        except FileExistsError:
            self._discard()
            raise _exists(self.path) from None
        except NotWrittenError:
            self._discard()
            raise
        except OSError as error:
            self._discard()
            raise not_written(self.path, error) from error

    def add(self, trial: Trial, steps: Mapping[str, ConverterStep] | None = None) -> str:
        """Write a trial.

        Parameters
        ----------
        trial : Trial
            As it was recorded.
        steps : mapping of str to Step, optional
            By name of the data set: what came from a converter is stored as its counts, which
            takes a quarter of the room. Values between two counts are rounded to the nearest. A
            data set with missing samples stays floating point. Others are stored exactly.

        Returns
        -------
        sha256 : str
            Of the content that was written.

        Raises
        ------
        StudyError
            If an array has another shape, or the id is taken or cannot name a group.
        NotWrittenError
            If the disk is full.
        """
        name = trial.info.id
        if not name or "/" in name or name in (".", "..") or name in self._trials:
            raise StudyError(
                f"{self.path}, trial {name!r}: its id is empty, holds '/' or is taken; every "
                "trial has an id of its own"
            )
        try:
            stored = _encoded(trial, steps or {})
        except FieldError as error:
            raise StudyError(f"{self.path}, trial {name}, {error}") from error
        read_back: dict[str, Any] = {key: found.values for key, found in stored.items()}
        sha256 = digest(replace(trial, **read_back))
        with self._output.in_whole(self.path):
            group = self._trials.create_group(name)
            _write_attributes(group, _asked(trial) | {"sha256": sha256})
            for key, found in stored.items():
                _write_data_set(group, key, found, _beside(trial, key))
        return sha256

    def _discard(self) -> None:
        with contextlib.suppress(NotWrittenError), self._output.in_whole(self.path):
            self._file.close()
        self._output.close()
        self._unfinished.unlink(missing_ok=True)


def _exists(path: Path) -> StudyError:
    return StudyError(f"{path} exists; choose another name, or delete it first")


def _encoded(trial: Trial, steps: Mapping[str, ConverterStep]) -> dict[str, Encoded]:
    stored: dict[str, Encoded] = {}
    rows: dict[str, int] = {}
    for data_set in DATA_SETS:
        values = getattr(trial, data_set.name)
        if values is None:
            continue
        if np.ndim(values) != (2 if data_set.columns > 1 else 1) or not is_shape_of(
            data_set, np.shape(values)
        ):
            raise FieldError(data_set.name, shape_hint(data_set, np.shape(values)))
        if len(values) != rows.setdefault(data_set.along, len(values)):
            raise FieldError(data_set.name, f"has {len(values)} rows; others have more or less")
        stored[data_set.name] = encode(data_set.name, values, steps.get(data_set.name))
    return stored


def _root(info: StudyInfo) -> dict[str, Any]:
    root: dict[str, Any] = {
        "schema": SCHEMA,
        "rig": info.rig,
        "carrier_hz": info.carrier_hz,
        "screen_peak_v": info.screen_peak_v,
    }
    if (mount := mount_text(info)) is not None:
        root["mount"] = mount
    return info.extras | root


def _asked(trial: Trial) -> dict[str, Any]:
    info = trial.info
    tones: Any = np.asarray(info.tones_hz, dtype=np.float64)
    return {
        "participant": info.participant,
        "session": info.session,
        "order": info.order,
        "speed_mm_s": float(info.speed_mm_s),
        "force_n": float(info.force_n),
        "tone_hz": tones if tones.size > 1 else float(tones.sum()),
        "drive_vpp": float(info.drive_vpp),
        "sample_rate_hz": float(info.sample_rate_hz),
        "started_utc": info.started_utc,
    }


def _beside(trial: Trial, name: str) -> dict[str, Any]:
    """Return the attributes of a data set."""
    if name == "voltage_v":
        return {"source": trial.voltage_source}
    if name == "force_n":
        return {"skew_s": float(trial.force_skew_s)}
    if name in ("accel_m_s2", "skin_velocity_m_s"):
        return {"skew_s": float(trial.skin_skew_s)}
    return {}


def _write_attributes(holder: h5py.Group | h5py.Dataset, values: Mapping[str, Any]) -> None:
    for name, value in values.items():
        if isinstance(value, str):
            # Of fixed length: text of variable length lies in a heap without a checksum.
            data = value.encode()
            holder.attrs.create(name, data, dtype=h5py.string_dtype("utf-8", len(data) or 1))
        else:
            holder.attrs.create(name, value)


def _write_data_set(
    group: h5py.Group, name: str, stored: Encoded, beside: Mapping[str, Any]
) -> None:
    raw = stored.raw
    # Chunks so that there are checksums. Not compressed: that reads about half as fast and
    # writes eight times slower, for 0.55 of the size.
    chunks = (min(len(raw), MAX_CHUNK_ROWS), *raw.shape[1:]) if raw.size else None
    kept = group.create_dataset(name, data=raw, chunks=chunks, fletcher32=raw.size > 0)
    step = stored.step
    scaling = {} if step is None else {"scale": step.scale, "offset": step.offset}
    _write_attributes(kept, {**beside, **scaling})

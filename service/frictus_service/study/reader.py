"""Reading a `study/1` file: attributes of all trials, data of one at a time."""

import hashlib
import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path
from typing import Any, Self

import h5py

from frictus_service.errors import Exclusion, FieldError, StudyError, TrialError
from frictus_service.study import hdf5
from frictus_service.study.hdf5 import attributes_of, group_in, names_in, open_file
from frictus_service.study.layout import ROOT, SCHEMA
from frictus_service.study.plausible import check_asked, check_measured, check_study
from frictus_service.study.trial import StudyInfo, Trial, TrialInfo, parse_mount
from frictus_service.study.trial_group import count_samples, read_asked, read_trial


class StudyReader:
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

    def __enter__(self) -> Self:
        """Return the reader."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the file."""
        self.close()

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
            return trial

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
        if group is None:
            raise FieldError("group", "is no group with a UTF-8 name; accepted: /trials/<id>")
        return group

    @contextmanager
    def _naming(self, trial_id: str) -> Iterator[None]:
        try:
            yield
        except FieldError as error:
            exclusion = Exclusion(trial_id, error.field, error.reason)
            raise TrialError(self.path, exclusion) from error


def _read_info(held: Mapping[str, Any]) -> StudyInfo:
    schema = hdf5.text(held, "schema")
    if schema != SCHEMA:
        raise FieldError("schema", f"is {schema!r}; accepted: {SCHEMA!r}")
    mount_json = hdf5.text(held, "mount") if "mount" in held else None
    info = StudyInfo(
        rig=hdf5.text(held, "rig"),
        carrier_hz=hdf5.number(held, "carrier_hz"),
        screen_peak_v=hdf5.number(held, "screen_peak_v"),
        mount=None if mount_json is None else parse_mount(mount_json),
        mount_json=mount_json,
        extras=_extras(held),
    )
    check_study(info)
    return info


def _extras(held: Mapping[str, Any]) -> dict[str, str | int | float]:
    extras: dict[str, str | int | float] = {}
    for name in sorted(set(held) - set(ROOT)):
        value = hdf5.plain(held[name])
        if isinstance(value, tuple):
            extras[name] = json.dumps(value)
        elif value is not None:
            extras[name] = value
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

"""Recordings with a column map, opened as a study: each stroke of a recording is a trial.

Every command takes a file that has its map beside it.
"""

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Final, Self

import numpy as np

from frictus_service.data_import.channels import DRIVES
from frictus_service.data_import.column_map import (
    ColumnMap,
    has_map,
    load_map,
    map_beside,
    map_text,
)
from frictus_service.data_import.drive_tones import find_tones
from frictus_service.data_import.formats.read import read_columns
from frictus_service.data_import.motion import (
    LOOK_AT,
    STROKES,
    Stroke,
    conditions_of,
    find_strokes,
)
from frictus_service.data_import.recording import MappedRecording
from frictus_service.data_import.recordings_in_file import mapped_recordings
from frictus_service.errors import Exclusion, FieldError, StudyError
from frictus_service.identification.observation.response import drive_fraction
from frictus_service.identification.observation.validity import LEAST_DRIVE
from frictus_service.study.layout import hashed
from frictus_service.study.plausible import (
    SAMPLE_RATE,
    check_asked,
    check_measured,
    check_study,
    instant,
)
from frictus_service.study.trial import StudyInfo, Trial, TrialInfo

AROUND_S: Final = 0.1
"""Positions of so long before and after a stroke belong to its trial."""
BY_STEADINESS: Final = (
    "no targets were given: speed and force of each trial are the middle of what was measured, "
    "so that trials are judged by steadiness only"
)
BY_FILE_TIME: Final = (
    "no start time was given: a recording is taken to end when its file was last written, so "
    "that what depends on the time between files is not to be trusted (set started_utc)"
)
ONE_PERSON: Final = (
    "all recordings are taken as of one person, p01: where they are of several, nothing that "
    "is said of people holds (set names, as names={participant}_{}, or participant)"
)
WITHOUT_DRIVE: Final = (
    "no drive is in the map: all trials are blank (where something drove the screen, set "
    "drive_voltage.column, drive_envelope.column or drive_fraction.column)"
)


def is_nobody(column_map: ColumnMap) -> bool:
    """Return whether a map says of nobody whose recording it is."""
    default: str = ColumnMap.model_fields["participant"].default
    said = column_map.names or column_map.participant_field
    return not said and column_map.participant == default


class MappedStudy:
    """The recordings of a file under its map; a context manager, with all trials in memory.

    Parameters
    ----------
    path : Path
        Of the recording.
    column_map : ColumnMap

    Raises
    ------
    StudyError
        If the file or the map cannot be used, or no stroke makes a trial; the text says why.

    Attributes
    ----------
    recorded_s : float
        Of all recordings in the file.
    """

    def __init__(self, path: Path, column_map: ColumnMap) -> None:
        columns = read_columns(path)
        try:
            recordings, excluded = mapped_recordings(columns, column_map, path)
            for recording in recordings:
                _check_usable(recording)
            self.recorded_s = sum(recording.seconds for recording in recordings)
            given = column_map.started_utc or columns.started_utc
            started = _started(given, path, self.recorded_s)
            notes = dict.fromkeys(columns.notes)
            notes |= dict.fromkeys(note for each in recordings for note in each.notes)
            notes |= dict.fromkeys(_of_file(len(recordings), given))
            if len(recordings) > 1 and is_nobody(column_map):
                notes[ONE_PERSON] = None
            if any(
                None in (each.column_map.speed_mm_s, each.column_map.force_n)
                for each in recordings
            ):
                notes[BY_STEADINESS] = None
            self.info = _info(path, columns.format, column_map, list(notes))
            check_study(self.info)
        except FieldError as error:
            raise StudyError(f"{path}: {error}") from error
        self.path = path
        self._map = column_map
        strokes = list(_strokes(recordings))
        if not strokes:
            look_at = (
                "the tangential force, whose sign gives the direction where neither position "
                "nor velocity was recorded: a force without its mean changes sign all the time"
                if column_map.direction_from_force
                else LOOK_AT
            )
            raise StudyError(
                f"{path}: no stroke is found in {self.recorded_s:.3g} s; accepted: {STROKES}; "
                f"look at {look_at}"
            )
        self._trials, left_out = _trials(path.stem, strokes, self.info, started)
        self.excluded = (*excluded, *left_out)
        if not self._trials:
            first = left_out[0]
            raise StudyError(
                f"{path}: none of {len(strokes)} strokes makes a trial; the first: "
                f"{first.field}: {first.reason}"
            )

    @property
    def trials(self) -> tuple[TrialInfo, ...]:
        """Trials, in time."""
        return tuple(trial.info for trial in self._trials.values())

    @property
    def sha256(self) -> str:
        """Hash of the file's bytes and of its map, hexadecimal."""
        with self.path.open("rb") as stream:
            found = hashlib.file_digest(stream, "sha256")
        found.update(map_text(self._map).encode())
        return found.hexdigest()

    def n_samples(self, trial_id: str) -> int:
        """Return how many samples a trial has."""
        return len(self._trials[trial_id].force_n)

    def read(self, trial_id: str) -> Trial:
        """Return one trial.

        Parameters
        ----------
        trial_id : str

        Raises
        ------
        StudyError
            If there is no such trial.
        """
        if trial_id not in self._trials:
            raise StudyError(f"{self.path}: there is no trial {trial_id!r}")
        trial = self._trials[trial_id]
        return hashed(trial)

    def __enter__(self) -> Self:
        """Return the study."""
        return self

    def __exit__(self, *_: object) -> None:
        """Let go of nothing: the file is closed already."""


@dataclass(frozen=True, slots=True)
class MappedImporter:
    """Opens files that have a column map beside them."""

    layout: str = "recording with a column map"

    def recognises(self, path: Path) -> bool:
        """Return whether a map lies beside a file."""
        return path.is_file() and has_map(path)

    def open(self, path: Path) -> MappedStudy:
        """Return the study.

        Raises
        ------
        StudyError
            If the file or its map cannot be used.
        """
        return MappedStudy(path, load_map(map_beside(path)))


IMPORTER: Final = MappedImporter()


@dataclass(frozen=True, slots=True)
class _Placed:
    """A stroke, its recording, and when that began after the first one."""

    stroke: Stroke
    recording: MappedRecording
    begins_s: float


def _strokes(recordings: Sequence[MappedRecording]) -> Iterator[_Placed]:
    begins_s = 0.0
    for recording in recordings:
        for stroke in find_strokes(recording):
            yield _Placed(stroke, recording, begins_s)
        begins_s += recording.seconds


def _of_file(recordings: int, given: str) -> Iterator[str]:
    """Yield what is assumed of the times of a file."""
    if recordings > 1:
        yield (
            f"the {recordings} recordings of the file are taken to follow each other at once, "
            "so that what depends on the time between them is not to be trusted"
        )
    if not given:
        yield BY_FILE_TIME


def _started(given: str, path: Path, seconds: float) -> datetime:
    """Return when a recording began; a file is last written when its recording ends."""
    if given:
        return instant(given)
    ended = datetime.fromtimestamp(int(path.stat().st_mtime), UTC)
    return ended - timedelta(seconds=seconds)


def _check_usable(recording: MappedRecording) -> None:
    """Refuse what identifies nothing, and say what it is good for."""
    lacks: dict[str, str] = {}
    if recording.rate_hz > SAMPLE_RATE.highest:
        lacks["rate_hz"] = f"{recording.rate_hz:.4g} Hz is absurd; correct rate_hz or time.unit"
    if recording.rate_hz < SAMPLE_RATE.lowest:
        lacks["rate_hz"] = (
            f"{recording.rate_hz:.4g} Hz is too slow for the band of 20 to 1000 Hz, which "
            f"needs {SAMPLE_RATE.lowest:g} Hz"
        )
    if recording.force_unit == "counts":
        lacks["force unit"] = "raw counts; give scale in newtons per count, and the unit N"
    if not np.isfinite(recording.force_n[:, 0]).any():
        lacks["force_x"] = "no tangential force is mapped"
    if not np.isfinite(recording.force_n[:, 2]).any():
        lacks["force_z"] = "no normal force is mapped; map it, or set normal_load_n"
    if not len(recording.position_mm):
        lacks["position_x"] = (
            "nothing says where the finger was; map position_x or velocity_x, or set "
            "stage_speed_mm_s"
        )
    if lacks:
        field, reason = next(iter(lacks.items()))
        more = [f"{name}: {why}" for name, why in lacks.items() if name != field]
        raise FieldError(
            field,
            "; ".join([reason, *more])
            + ". What is there can be looked at: frictus study show --friction",
        )


def _info(path: Path, file_format: str, column_map: ColumnMap, notes: list[str]) -> StudyInfo:
    if not column_map.channels.keys() & set(DRIVES):
        notes = [*notes, WITHOUT_DRIVE]
    return StudyInfo(
        rig=column_map.rig,
        carrier_hz=column_map.carrier_hz,
        screen_peak_v=column_map.screen_peak_v,
        extras={
            "imported_from": f"{path.name} ({file_format})",
            "import_notes": "; ".join(notes),
        },
    )


def _trials(
    stem: str,
    strokes: list[_Placed],
    study: StudyInfo,
    started: datetime,
) -> tuple[dict[str, Trial], tuple[Exclusion, ...]]:
    speeds = conditions_of(np.array([placed.stroke.speed_mm_s for placed in strokes]))
    normal = np.array([placed.stroke.normal for placed in strokes])
    forces = conditions_of(np.where(normal > 0.0, normal, np.nan))
    kept: dict[str, Trial] = {}
    excluded: list[Exclusion] = []
    for order, placed in enumerate(strokes):
        stroke, recording = placed.stroke, placed.recording
        column_map = recording.column_map
        begin_s = placed.begins_s + stroke.first / recording.rate_hz
        asked = TrialInfo(
            id=f"{stem}-{order:04d}",
            participant=column_map.participant,
            session=column_map.session,
            order=order,
            speed_mm_s=column_map.speed_mm_s or float(speeds[order]),
            force_n=column_map.force_n or float(forces[order]),
            tones_hz=(),
            drive_vpp=0.0,
            sample_rate_hz=recording.rate_hz,
            started_utc=(started + timedelta(seconds=begin_s)).isoformat(),
        )
        trial = _trial(recording, stroke, _driven(recording, stroke, asked))
        try:
            check_asked(trial.info, study)
            check_measured(trial, study)
        except FieldError as error:
            excluded.append(Exclusion(asked.id, error.field, error.reason))
        else:
            kept[asked.id] = trial
    return kept, tuple(excluded)


def _driven(recording: MappedRecording, stroke: Stroke, asked: TrialInfo) -> TrialInfo:
    """Return what was asked, with the drive as the voltage shows it."""
    if recording.voltage_v is None:
        return asked
    column_map = recording.column_map
    voltage = recording.voltage_v[stroke.first : stroke.last]
    drive = drive_fraction(voltage, column_map.screen_peak_v)
    tones = find_tones(drive, recording.rate_hz, column_map.carrier_hz)
    if tones is None:  # at rest, or a constant drive
        if not np.nan_to_num(drive).mean() >= LEAST_DRIVE:
            return asked
        tones = ()
    if column_map.tones_hz is not None:
        tones = column_map.tones_hz
    peak = recording.crest * float(np.nanmax(np.abs(voltage)))
    return replace(asked, tones_hz=tones, drive_vpp=round(2.0 * peak, 3))


def _trial(recording: MappedRecording, stroke: Stroke, asked: TrialInfo) -> Trial:
    cut = slice(stroke.first, stroke.last)
    begin_s, end_s = stroke.first / recording.rate_hz, stroke.last / recording.rate_hz
    near = (recording.position_t_s >= begin_s - AROUND_S) & (
        recording.position_t_s <= end_s + AROUND_S
    )
    accel, skin, voltage = (
        recording.accel_m_s2,
        recording.skin_velocity_m_s,
        recording.voltage_v,
    )
    return Trial(
        info=asked,
        voltage_v=None if voltage is None else voltage[cut],
        force_n=recording.force_n[cut],
        accel_m_s2=None if accel is None else accel[cut],
        skin_velocity_m_s=None if skin is None else skin[cut],
        position_mm=recording.position_mm[near],
        position_t_s=recording.position_t_s[near] - begin_s,
    )

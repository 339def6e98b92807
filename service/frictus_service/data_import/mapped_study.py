"""Recordings with a column map as a study: opened as one, and written as one.

Each stroke of a recording is a trial. Every command takes a file that has its map beside it;
`frictus study import` writes such files into one `study/1` file.
"""

import hashlib
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Final, Self

import numpy as np

from frictus_hardware.physics.linear import TransferFunction
from frictus_service.data_import.channels import DRIVES
from frictus_service.data_import.column_map import ColumnMap, load_map, map_beside, map_text
from frictus_service.data_import.drive_tones import find_tones
from frictus_service.data_import.formats.read import read_columns
from frictus_service.data_import.motion import Stroke, conditions_of, find_strokes
from frictus_service.data_import.recording import MappedRecording, apply_map
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
from frictus_service.study.writer import StudyWriter

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
WITHOUT_DRIVE: Final = (
    "no drive is in the map: all trials are blank (where something drove the screen, set "
    "drive_voltage.column, drive_envelope.column or drive_fraction.column)"
)


class MappedStudy:
    """A recording under its map; a context manager, with all trials in memory.

    Parameters
    ----------
    path : Path
        Of the recording.
    column_map : ColumnMap

    Raises
    ------
    StudyError
        If the file or the map cannot be used, or no stroke makes a trial; the text says why.
    """

    def __init__(self, path: Path, column_map: ColumnMap) -> None:
        columns = read_columns(path)
        try:
            recording = apply_map(columns, column_map)
            _check_usable(recording)
            given = column_map.started_utc or columns.started_utc
            started = _started(given, path, recording.seconds)
            notes = [*recording.notes, *([] if given else [BY_FILE_TIME])]
            self.info = _info(path, columns.format, column_map, notes)
            check_study(self.info)
        except FieldError as error:
            raise StudyError(f"{path}: {error}") from error
        self.path = path
        self.recording = recording
        self._map = column_map
        strokes = find_strokes(recording)
        if not strokes:
            look_at = (
                "the tangential force, whose sign gives the direction where neither position "
                "nor velocity was recorded: a force without its mean changes sign all the time"
                if column_map.direction_from_force
                else "unit and sign of position and normal force"
            )
            raise StudyError(
                f"{path}: no stroke is found in {recording.seconds:.3g} s; accepted: sections "
                "of one direction that last 0.1 s and 3 mm at least, the finger pressing; look "
                f"at {look_at}"
            )
        self._trials, self.excluded = _trials(
            path.stem, recording, column_map, strokes, self.info, started
        )
        if not self._trials:
            first = self.excluded[0]
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
        return path.is_file() and map_beside(path).is_file()

    def open(self, path: Path) -> MappedStudy:
        """Return the study.

        Raises
        ------
        StudyError
            If the file or its map cannot be used.
        """
        return MappedStudy(path, load_map(map_beside(path)))


IMPORTER: Final = MappedImporter()


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
    if column_map.speed_mm_s is None or column_map.force_n is None:
        notes = [*notes, BY_STEADINESS]
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
    recording: MappedRecording,
    column_map: ColumnMap,
    strokes: list[Stroke],
    study: StudyInfo,
    started: datetime,
) -> tuple[dict[str, Trial], tuple[Exclusion, ...]]:
    speeds = conditions_of(np.array([stroke.speed_mm_s for stroke in strokes]))
    normal = np.array([stroke.normal for stroke in strokes])
    forces = conditions_of(np.where(normal > 0.0, normal, np.nan))
    kept: dict[str, Trial] = {}
    excluded: list[Exclusion] = []
    for order, stroke in enumerate(strokes):
        begin_s = stroke.first / recording.rate_hz
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
        trial = _trial(recording, stroke, _driven(recording, stroke, column_map, asked))
        try:
            check_asked(trial.info, study)
            check_measured(trial, study)
        except FieldError as error:
            excluded.append(Exclusion(asked.id, error.field, error.reason))
        else:
            kept[asked.id] = trial
    return kept, tuple(excluded)


def _driven(
    recording: MappedRecording, stroke: Stroke, column_map: ColumnMap, asked: TrialInfo
) -> TrialInfo:
    """Return what was asked, with the drive as the voltage shows it."""
    if recording.voltage_v is None:
        return asked
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


@dataclass(frozen=True, slots=True)
class Imported:
    """What came of an import.

    Attributes
    ----------
    trials : int
        Written.
    seconds : float
        Of all trials, and `recorded_s` of all recordings.
    recorded_s : float
        Of all recordings.
    excluded : tuple of Exclusion
        Strokes that make no trial.
    notes : tuple of str
        What was assumed or changed; sentences.
    """

    trials: int
    seconds: float
    recorded_s: float
    excluded: tuple[Exclusion, ...]
    notes: tuple[str, ...]


def import_recordings(
    recordings: Sequence[tuple[Path, ColumnMap]],
    out: Path,
    mount: TransferFunction | None,
    tell: Callable[[str], None] = lambda _: None,
) -> Imported:
    """Write recordings as a study; one is in memory at a time.

    Parameters
    ----------
    recordings : sequence of (Path, ColumnMap)
        Of the same screen and carrier.
    out : Path
        The study.
    mount : TransferFunction or None
        Under the screen.
    tell : callable
        Called with how far it is, for each trial.

    Raises
    ------
    StudyError
        If one cannot be used, or they are of different rigs; nothing is written then.
    """
    _check_same([column_map for _, column_map in recordings])
    first = recordings[0][1]
    info = StudyInfo(
        rig=first.rig,
        carrier_hz=first.carrier_hz,
        screen_peak_v=first.screen_peak_v,
        mount=mount,
        extras={"imported_from": ", ".join(path.name for path, _ in recordings)[:4000]},
    )
    orders: Counter[tuple[str, int]] = Counter()
    names: Counter[str] = Counter()
    excluded: list[Exclusion] = []
    notes: dict[str, None] = {}
    seconds = recorded_s = 0.0
    with StudyWriter(out, info) as writer:
        for path, column_map in recordings:
            study = MappedStudy(path, column_map)
            recorded_s += study.recording.seconds
            excluded += study.excluded
            notes |= dict.fromkeys(str(study.info.extras["import_notes"]).split("; "))
            for asked in study.trials:
                tell(f"{path}: {sum(orders.values())} trials written")
                place = (asked.participant, asked.session)
                name = asked.id if not names[asked.id] else f"{asked.id}-{names[asked.id]}"
                names[asked.id] += 1
                trial = study.read(asked.id)
                told = replace(asked, id=name, order=orders[place])
                orders[place] += 1
                writer.add(replace(trial, info=told))
                seconds += len(trial.force_n) / asked.sample_rate_hz
    notes.pop("", None)
    return Imported(sum(orders.values()), seconds, recorded_s, tuple(excluded), tuple(notes))


def _check_same(maps: Sequence[ColumnMap]) -> None:
    for key in ("rig", "carrier_hz", "screen_peak_v"):
        values = {getattr(each, key) for each in maps}
        if len(values) > 1:
            raise StudyError(
                f"the files differ in {key}: {', '.join(map(str, sorted(values)))}; a study "
                "has one; import them apart"
            )

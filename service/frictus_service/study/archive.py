"""A study as a folder for an archive: NWB files, events, a data card and checksums.

The names are those of BIDS and DANDI, ``sub-P1/sub-P1_ses-01.nwb``, so that the folder can be
given to DANDI, OSF or 4TU as it is.
"""

import csv
import hashlib
import importlib.metadata
import itertools
import json
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

import h5py
import numpy as np

from frictus.files import inert_cell
from frictus_hardware.arrays import FloatArray
from frictus_service.durable import new_folder
from frictus_service.errors import Exclusion, StudyError
from frictus_service.study.hdf5_output import Hdf5Output
from frictus_service.study.importers import Study, read_all
from frictus_service.study.trial import Trial

INSTALL: Final = 'pip install "frictus[nwb]"'
AGE: Final = re.compile(r"P\d{1,3}Y(/(P\d{1,3}Y)?)?", re.ASCII)
"""ISO 8601: years, or a range of them."""
EVEN_S: Final = 1e-6
"""Positions whose steps differ by less have a rate instead of times."""
SIMULATED: Final = "Simulated: no finger was measured."
COLUMNS: Final = {
    "trial": "id of the trial in the study",
    "order": "position in the participant's sequence, from 0",
    "target_speed_mm_s": "speed asked for, mm/s; 0 is at rest",
    "target_force_n": "normal force asked for, N",
    "tone_hz": "message tones, Hz, separated by blanks; n/a: no tones (see drive_vpp)",
    "drive_vpp": "voltage at the screen, peak to peak, V",
    "voltage_source": "whether the voltage was commanded or monitored",
    "sha256": "hash of the trial's content as docs/study.md of frictus defines it",
}
"""What is said of every trial, here and in `events.tsv`."""
SIGNALS: Final = {
    "voltage_v": ("voltage", "volts", "At the screen, carrier included."),
    "force_n": ("force", "newtons", "Of the finger on the screen: along x, along y, normal."),
    "accel_m_s2": ("acceleration", "meters/second^2", "Of the nail: x, y, z."),
    "skin_velocity_m_s": ("skin_velocity", "meters/second", "Along x."),
}


def write_session(
    path: Path, study: Study, trials: Sequence[Trial], age: str | None = None
) -> None:
    """Write the trials of one participant and session; a missing sample stays NaN.

    Each trial has a time series per signal, named by signal and order; the trials table says
    when each begins and ends. Times count from the earliest trial.

    Parameters
    ----------
    path : Path
        Of the file.
    study : Study
        That they belong to.
    trials : sequence of Trial
        At least one.
    age : str or None
        Of the participant: `AGE`. Archives ask for it, and a study does not know it.

    Raises
    ------
    StudyError
        If pynwb is not installed, or the age is none.
    NotWrittenError
        If the disk is full.
    """
    try:
        from pynwb import NWBHDF5IO, NWBFile
        from pynwb.behavior import Position
        from pynwb.file import Subject
    except ImportError as error:
        raise StudyError(f"NWB files need pynwb: {INSTALL}") from error
    if age is not None and not AGE.fullmatch(age):
        raise StudyError(f"age {age!r}: P25Y, or a range such as P18Y/P65Y, is accepted")
    info, begun = trials[0].info, begin_of(trials)
    file = NWBFile(
        session_description=f"Fingers on the electrovibration screen of {study.info.rig}.",
        identifier=f"{study.sha256}/{info.participant}/{info.session}",
        session_start_time=begun,
        session_id=f"{info.session:02d}",
        experiment_description=f"Carrier {study.info.carrier_hz:g} Hz, full drive "
        f"{study.info.screen_peak_v:g} V at the screen.",
        keywords=["haptics", "electrovibration", "friction", "touch"],
        subject=Subject(
            subject_id=label_of(info.participant),
            species=None if study.info.simulated else "Homo sapiens",
            description=SIMULATED if study.info.simulated else None,
            sex="U",
            age=age,
        ),
    )
    for name, meaning in COLUMNS.items():
        file.add_trial_column(name, meaning)
    positions = Position(name="Position")
    for trial in trials:
        onset_s = onset_of(trial, begun)
        file.add_trial(onset_s, onset_s + duration_of(trial), **row_of_session(trial))
        for series in _signals(trial, onset_s):
            file.add_acquisition(series)
        positions.add_spatial_series(_position(trial, onset_s))
    behaviour = file.create_processing_module("behavior", "Where the finger was.")
    behaviour.add(positions)
    with (
        Hdf5Output(path) as output,
        output.in_whole(path),
        h5py.File(output, "w") as hdf5,
        NWBHDF5IO(file=hdf5, mode="w") as written,
    ):
        written.write(file)


def begin_of(trials: Sequence[Trial]) -> datetime:
    """Return when the earliest trial began."""
    return min(_started(trial) for trial in trials)


def onset_of(trial: Trial, begun: datetime) -> float:
    """Return when a trial began, in s from the begin of its session."""
    return (_started(trial) - begun).total_seconds()


def duration_of(trial: Trial) -> float:
    """Return how long a trial lasted, s."""
    return len(trial.force_n) / trial.info.sample_rate_hz


def label_of(participant: str) -> str:
    """Return a pseudonym as archives take it: letters and digits alone.

    Raises
    ------
    StudyError
        If nothing is left of it.
    """
    label = "".join(letter for letter in participant if letter.isascii() and letter.isalnum())
    if not label:
        raise StudyError(
            f"participant {participant!r}: archives take letters a to z and digits; rename it"
        )
    return label


def row_of_session(trial: Trial) -> dict[str, Any]:
    """Return the values of `COLUMNS`."""
    info = trial.info
    return {
        "trial": info.id,
        "order": info.order,
        "target_speed_mm_s": info.speed_mm_s,
        "target_force_n": info.force_n,
        "tone_hz": " ".join(_in_full(hz) for hz in info.tones_hz) or "n/a",
        "drive_vpp": info.drive_vpp,
        "voltage_source": trial.voltage_source,
        "sha256": trial.sha256 or "n/a",
    }


def _in_full(value: float) -> str:
    return np.format_float_positional(value, trim="-")


def _started(trial: Trial) -> datetime:
    started = datetime.fromisoformat(trial.info.started_utc)
    return started if started.tzinfo else started.replace(tzinfo=UTC)


def _signals(trial: Trial, onset_s: float) -> list[Any]:
    from pynwb import H5DataIO, TimeSeries

    skews_s = {"voltage_v": 0.0, "force_n": trial.force_skew_s}
    return [
        TimeSeries(
            name=f"{name}_{trial.info.order:05d}",
            description=f"{description} Trial {trial.info.id}.",
            data=H5DataIO(values, compression="gzip", shuffle=True),
            unit=unit,
            starting_time=onset_s + skews_s.get(field, trial.skin_skew_s),
            rate=trial.info.sample_rate_hz,
        )
        for field, (name, unit, description) in SIGNALS.items()
        if (values := getattr(trial, field)) is not None
    ]


def _position(trial: Trial, onset_s: float) -> Any:
    from pynwb import H5DataIO
    from pynwb.behavior import SpatialSeries

    return SpatialSeries(
        name=f"position_{trial.info.order:05d}",
        description=f"Of the finger on the screen: x, y. Trial {trial.info.id}.",
        data=H5DataIO(1e-3 * trial.position_mm, compression="gzip", shuffle=True),
        unit="meters",
        reference_frame="The screen; x along the slide.",
        **_times(onset_s + trial.position_t_s),
    )


def _times(time_s: FloatArray) -> dict[str, Any]:
    """Return times as they are, or a rate where they are even, as archives want it."""
    steps_s = np.diff(time_s)
    if steps_s.size > 1 and np.ptp(steps_s) < EVEN_S:
        return {"starting_time": float(time_s[0]), "rate": float(1.0 / np.mean(steps_s))}
    return {"timestamps": time_s}


CARD: Final = "README.md"
SUMS: Final = "SHA256SUMS"
_TIMES: Final = {
    "onset": "when the trial began, s from the begin of the session",
    "duration": "how long it lasted, s",
}


@dataclass(frozen=True, slots=True)
class _Session:
    name: str
    participant: str
    trials: int
    seconds: float


def export_archive(
    study: Study, folder: Path, licence: str | None = None, age: str | None = None
) -> tuple[Exclusion, ...]:
    """Write a study for an archive, one session in memory at a time.

    Parameters
    ----------
    study : Study
        Open.
    folder : Path
        Must not exist; it appears when everything is written.
    licence : str or None
        Under which the data may be used, by its SPDX name, such as ``CC-BY-4.0``; None: the
        card says that none has been given.
    age : str or None
        Of all participants, such as ``P18Y/P65Y``; None: the files and the card lack it, which
        archives mind.

    Returns
    -------
    tuple of Exclusion
        What was left out, and why; the card says so too.

    Raises
    ------
    StudyError
        If the folder exists, pynwb is not installed, the age is none, two participants
        would have one name, or no trial can be used.
    NotWrittenError
        If the disk is full.
    """
    excluded: list[Exclusion] = []
    sessions: list[_Session] = []
    people: dict[str, str] = {}
    with new_folder(folder) as unfinished:
        kept = _usable(study, excluded)
        # In order of participant and session, as a study gives its trials.
        for (participant, number), group in itertools.groupby(kept, key=_session_of):
            label = label_of(participant)
            name = f"sub-{label}/sub-{label}_ses-{number:02d}"
            # Windows and macOS take P1 and p1 for one folder.
            if people.setdefault(label.casefold(), participant) != participant:
                raise StudyError(f"two participants would be called {label!r}: rename one")
            trials = list(group)
            (unfinished / f"sub-{label}").mkdir(exist_ok=True)
            write_session(unfinished / f"{name}.nwb", study, trials, age)
            _write_events(unfinished / f"{name}_events", trials)
            seconds = sum(map(duration_of, trials))
            sessions.append(_Session(name, participant, len(trials), seconds))
        if not sessions:
            why = "; ".join(f"{one.trial}, {one.field}: {one.reason}" for one in excluded)
            raise StudyError(f"no trial can be used, and there is nothing to archive: {why}")
        card = data_card(study, sessions, excluded, licence, age)
        (unfinished / CARD).write_text(card, encoding="utf-8", newline="\n")
        _write_sums(unfinished)
    return tuple(excluded)


def data_card(
    study: Study,
    sessions: Sequence[_Session],
    excluded: Sequence[Exclusion],
    licence: str | None,
    age: str | None,
) -> str:
    """Return what a stranger needs to know of the folder, in Markdown."""
    info, people = study.info, {session.participant for session in sessions}
    trials, seconds = sum(s.trials for s in sessions), sum(s.seconds for s in sessions)
    lines = [
        f"# Friction of fingers on the screen of {info.rig}",
        "",
        f"{len(people)} participants, {len(sessions)} sessions, {trials} trials, "
        f"{seconds:.0f} s. A finger slides over a screen whose friction is changed by "
        f"electrovibration: a carrier of {info.carrier_hz:g} Hz, full drive "
        f"{info.screen_peak_v:g} V at the screen.",
        "",
        *((SIMULATED, "") if info.simulated else ()),
        f"- Licence: {licence or 'none has been given; ask before you use the data'}",
        f"- Written by frictus {importlib.metadata.version('frictus')} from a study whose "
        f"sha256 is {study.sha256}",
        f"- Age of the participants: {age or 'not given; archives ask for it'}",
        "- Participants have pseudonyms; sex and handedness are not in the study.",
        *(f"- {name}: {value}" for name, value in sorted(info.extras.items())),
        "",
        "## Files",
        "",
        "| file | trials | s |",
        "|---|---|---|",
        *(f"| {one.name}.nwb | {one.trials} | {one.seconds:.1f} |" for one in sessions),
        "",
        "Beside each stand its trials as `_events.tsv`, whose columns `_events.json` explains. "
        f"`{SUMS}` is checked by `sha256sum -c {SUMS}`.",
        "",
        "## Signals",
        "",
        "| in the NWB file | unit | what |",
        "|---|---|---|",
        *(f"| {name}_ORDER | {unit} | {what} |" for name, unit, what in SIGNALS.values()),
        "| position_ORDER | meters | Of the finger on the screen: x, y. |",
        "",
        "ORDER is that of the trial. A missing sample is NaN.",
        "",
        "## Left out",
        "",
        *(f"- trial {one.trial}, {one.field}: {one.reason}" for one in excluded),
    ]
    return "\n".join([*lines, *([] if excluded else ["Nothing."])]) + "\n"


def _usable(study: Study, excluded: list[Exclusion]) -> Iterator[Trial]:
    """Yield the trials that can be used; the others are added to `excluded`."""
    for found in read_all(study):
        if isinstance(found, Exclusion):
            excluded.append(found)
        else:
            yield found


def _session_of(trial: Trial) -> tuple[str, int]:
    return trial.info.participant, trial.info.session


def _write_events(stem: Path, trials: Sequence[Trial]) -> None:
    """Write the trials of a session as BIDS has events: a table, and what its columns are."""
    begun = begin_of(trials)
    with stem.with_name(f"{stem.name}.tsv").open("w", encoding="utf-8", newline="") as file:
        table = csv.DictWriter(file, [*_TIMES, *COLUMNS], delimiter="\t", lineterminator="\n")
        table.writeheader()
        for trial in sorted(trials, key=lambda one: onset_of(one, begun)):
            times = {"onset": onset_of(trial, begun), "duration": duration_of(trial)}
            row = row_of_session(trial)
            table.writerow(times | row | {"trial": inert_cell(row["trial"])})
    explained = {name: {"Description": what} for name, what in (_TIMES | COLUMNS).items()}
    text = json.dumps(explained, indent=2) + "\n"
    stem.with_name(f"{stem.name}.json").write_text(text, encoding="utf-8", newline="\n")


def _write_sums(folder: Path) -> None:
    lines = []
    for path in sorted(found for found in folder.rglob("*") if found.is_file()):
        with path.open("rb") as file:
            digest = hashlib.file_digest(file, "sha256").hexdigest()
        lines.append(f"{digest}  {path.relative_to(folder).as_posix()}\n")
    (folder / SUMS).write_text("".join(lines), encoding="utf-8", newline="\n")

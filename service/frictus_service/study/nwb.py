"""One session of a study as a file of Neurodata Without Borders (NWB 2)."""

import re
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

import numpy as np

from frictus_hardware.arrays import FloatArray
from frictus_service.errors import StudyError
from frictus_service.study.importers import Study
from frictus_service.study.trial import Trial

INSTALL: Final = 'pip install "frictus[nwb]"'
AGE: Final = re.compile(r"P\d{1,3}Y(/(P\d{1,3}Y)?)?", re.ASCII)
"""ISO 8601: years, or a range of them."""
EVEN_S: Final = 1e-6
"""Positions whose steps differ by less have a rate instead of times."""
COLUMNS: Final = {
    "trial": "id of the trial in the study",
    "order": "position in the participant's sequence, from 0",
    "target_speed_mm_s": "speed asked for, mm/s; 0 is at rest",
    "target_force_n": "normal force asked for, N",
    "tone_hz": "frequencies of the message tones, Hz, separated by blanks; n/a: no drive",
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
            subject_id=label_of(info.participant), species="Homo sapiens", sex="U", age=age
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
    with NWBHDF5IO(path, "w") as written:
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
        "tone_hz": " ".join(f"{hz:g}" for hz in info.tones_hz) or "n/a",
        "drive_vpp": info.drive_vpp,
        "voltage_source": trial.voltage_source,
        "sha256": trial.sha256 or "n/a",
    }


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

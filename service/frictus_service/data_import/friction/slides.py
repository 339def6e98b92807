"""Steady slides of a recording or a study, friction positive along the motion."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from frictus_hardware.arrays import FloatArray
from frictus_service.data_import.motion import find_strokes
from frictus_service.data_import.recording import MappedRecording
from frictus_service.errors import Exclusion
from frictus_service.identification.observation.observe import course_of
from frictus_service.identification.observation.response import drive_fraction
from frictus_service.identification.observation.validity import LEAST_DRIVE
from frictus_service.study.importers import Study, read_all
from frictus_service.study.trial import Trial

LEAST_THERE: Final = 0.9
"""Share of the samples of a slide that must be there."""


@dataclass(frozen=True, slots=True)
class Slide:
    """One steady slide in one direction.

    Attributes
    ----------
    rate_hz : float
        Of the samples.
    direction : int
        +1 along x, -1 against it.
    speed_mm_s : float
        Mean.
    friction, normal : ndarray, shape (n,)
        Tangential force along the motion, and normal force; NaN where not measured.
    unit : {'N', 'counts'}
        Of both.
    driven : bool
        Whether a voltage changed the friction.
    """

    rate_hz: float
    direction: int
    speed_mm_s: float
    friction: FloatArray
    normal: FloatArray
    unit: str
    driven: bool


def force_of(slides: Sequence[Slide]) -> Literal["friction", "normal"]:
    """Return which force the slides have: the friction, else the normal force.

    Parameters
    ----------
    slides : sequence of Slide
        Of one recording or study.
    """
    tangential = any(np.isfinite(each.friction).any() for each in slides)
    return "friction" if tangential else "normal"


def whole(values: FloatArray) -> FloatArray:
    """Return values without their straight line, gaps bridged; empty where a tenth is missing.

    Parameters
    ----------
    values : ndarray, shape (n,)
    """
    there = np.isfinite(values)
    if values.size < 3 or there.mean() < LEAST_THERE:
        return np.empty(0)
    index = np.arange(values.size, dtype=np.float64)
    filled = np.interp(index, index[there], values[there])
    flat: FloatArray = filled - np.polyval(np.polyfit(index, filled, 1), index)
    return flat


def slides_of_recording(recording: MappedRecording, screen_peak_v: float) -> list[Slide]:
    """Return the slides of a recording.

    Parameters
    ----------
    recording : MappedRecording
        Of any length.
    screen_peak_v : float
        Screen volts at full drive.
    """
    found = []
    for stroke in find_strokes(recording):
        cut = slice(stroke.first, stroke.last)
        voltage = None if recording.voltage_v is None else recording.voltage_v[cut]
        found.append(
            Slide(
                recording.rate_hz,
                stroke.direction,
                stroke.speed_mm_s,
                stroke.direction * recording.force_n[cut, 0],
                recording.force_n[cut, 2],
                recording.force_unit,
                is_driven(voltage, screen_peak_v),
            )
        )
    return found


def slides_of_study(study: Study) -> Iterator[Slide]:
    """Yield the slides of a study, one trial in memory at a time.

    Parameters
    ----------
    study : Study
        Open.
    """
    for trial in read_all(study):
        if not isinstance(trial, Exclusion):
            yield from _slides_of_trial(trial, study.info.screen_peak_v)


def _slides_of_trial(trial: Trial, screen_peak_v: float) -> Iterator[Slide]:
    rate_hz = trial.info.sample_rate_hz
    course = course_of(trial)
    for number, sweep in enumerate(course.sweeps):
        thirds = [third for third in course.segments if third.sweep == number]
        lasting = np.array([third.end_s - third.begin_s for third in thirds])
        speeds = np.array([third.speed_mm_s for third in thirds])
        cut = slice(round(sweep.begin_s * rate_hz), round(sweep.end_s * rate_hz))
        voltage = None if trial.voltage_v is None else trial.voltage_v[cut]
        yield Slide(
            rate_hz,
            sweep.direction,
            float(speeds @ lasting / lasting.sum()),
            sweep.direction * trial.force_n[cut, 0],
            trial.force_n[cut, 2],
            "N",
            is_driven(voltage, screen_peak_v),
        )


def is_driven(voltage_v: FloatArray | None, screen_peak_v: float) -> bool:
    """Return whether a voltage drives the friction.

    Parameters
    ----------
    voltage_v : ndarray, shape (n,), or None
    screen_peak_v : float
        Screen volts at full drive.
    """
    if voltage_v is None or not np.isfinite(voltage_v).any():
        return False
    return bool(np.nanmean(drive_fraction(voltage_v, screen_peak_v)) >= LEAST_DRIVE)

"""What people get wrong when they write a study, each made of a right trial."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from scipy import signal

from frictus_hardware.arrays import FloatArray
from frictus_service.errors import FieldError
from frictus_service.identification.observation.observe import course_of, observe_along
from frictus_service.identification.plausibility.pool import TrialRecord
from frictus_service.identification.plausibility.trial_statistics import statistics_of
from frictus_service.study.plausible import check_asked, check_measured
from frictus_service.study.trial import StudyInfo, Trial

EYE: Final = np.eye(3)
G: Final = 9.80665


@dataclass(frozen=True, slots=True)
class Slip:
    """One slip.

    Attributes
    ----------
    make : callable
        From a right trial to a wrong one.
    found_by : frozenset of str
        Checks of which one trips at least.
    remedy : str
        Part of what is advised.
    """

    make: Callable[[Trial], Trial]
    found_by: frozenset[str]
    remedy: str


def _asked(trial: Trial, **changed: Any) -> Trial:
    return replace(trial, info=replace(trial.info, **changed))


def _force(trial: Trial, matrix: FloatArray) -> Trial:
    return replace(trial, force_n=trial.force_n @ matrix.T)


def _accel(trial: Trial, matrix: FloatArray) -> Trial:
    assert trial.accel_m_s2 is not None
    return replace(trial, accel_m_s2=trial.accel_m_s2 @ matrix.T)


def velocity(trial: Trial, factor: float = 1.0) -> Trial:
    """Return a trial whose skin is measured by a vibrometer above 10 Hz instead."""
    assert trial.accel_m_s2 is not None
    rate_hz = trial.info.sample_rate_hz
    along = trial.accel_m_s2[:, 0] - trial.accel_m_s2[:, 0].mean()
    high = signal.butter(2, 10.0, "high", fs=rate_hz, output="sos")
    skin = signal.sosfiltfilt(high, np.cumsum(along) / rate_hz)
    return replace(trial, accel_m_s2=None, skin_velocity_m_s=factor * skin)


def _late(trial: Trial, late_s: float) -> Trial:
    assert trial.accel_m_s2 is not None
    count = trial.accel_m_s2.shape[0]
    turns = np.fft.rfftfreq(count, 1.0 / trial.info.sample_rate_hz) * late_s
    spectrum = np.fft.rfft(trial.accel_m_s2, axis=0)
    spectrum *= np.exp(-2j * np.pi * turns)[:, np.newaxis]
    return replace(trial, accel_m_s2=np.fft.irfft(spectrum, count, axis=0))


def _clipped(trial: Trial) -> Trial:
    force = trial.force_n.copy()
    force[:, 0] = np.minimum(force[:, 0], np.quantile(force[:, 0], 0.97))
    return replace(trial, force_n=force)


def _mirrored(trial: Trial) -> Trial:
    return replace(trial, position_mm=np.array([70.0, 0.0]) + [-1.0, 1.0] * trial.position_mm)


def _slip(make: Callable[[Trial], Trial], found_by: str, remedy: str) -> Slip:
    return Slip(make, frozenset(found_by.split()), remedy)


SLIPS: Final[Mapping[str, Slip]] = {
    "force x turned": _slip(
        lambda t: _force(t, np.diag([-1.0, 1.0, 1.0])), "friction_sign", "turn force_n along x:"
    ),
    "force z turned": _slip(
        lambda t: _force(t, np.diag([1.0, 1.0, -1.0])), "normal_sign", "column 2 of force_n"
    ),
    "acceleration turned": _slip(
        lambda t: _accel(t, -EYE), "mobility_sign", "turn accel_m_s2 or skin_velocity_m_s"
    ),
    "velocity turned": _slip(
        lambda t: velocity(t, -1.0), "mobility_sign", "turn accel_m_s2 or skin_velocity_m_s"
    ),
    "position turned": _slip(_mirrored, "friction_sign", "position_mm along x"),
    "acceleration in g": _slip(
        lambda t: _accel(t, EYE / G), "skin_scale skin_unit", "which looks like g"
    ),
    "force in gram-force": _slip(
        lambda t: _force(t, 1000.0 / G * EYE), "force_unit", "which looks like gram-force"
    ),
    "force in kN": _slip(lambda t: _force(t, 1e-3 * EYE), "force_unit", "which looks like kN"),
    "force in V, 5 V/N": _slip(lambda t: _force(t, 5.0 * EYE), "force_unit", "sensitivity"),
    "force x and y swapped": _slip(
        lambda t: _force(t, EYE[[1, 0, 2]]), "friction_axis", "first two columns of force_n"
    ),
    "force x and z swapped": _slip(
        lambda t: _force(t, EYE[[2, 1, 0]]), "normal_axis normal_flips", "in the order x, y, z"
    ),
    "acceleration x and y swapped": _slip(
        lambda t: _accel(t, EYE[[1, 0, 2]]), "skin_axis", "first two columns of accel_m_s2"
    ),
    "position in cm": _slip(
        lambda t: replace(t, position_mm=0.1 * t.position_mm), "speed_unit", "looks like cm"
    ),
    "speed in cm/s": _slip(
        lambda t: _asked(t, speed_mm_s=0.1 * t.info.speed_mm_s), "speed_unit", "speed_mm_s"
    ),
    "rate of 10 kHz": _slip(
        lambda t: _asked(t, sample_rate_hz=10_000.0), "carrier stamps", "sample_rate_hz"
    ),
    "rate of 40 kHz": _slip(
        lambda t: _asked(t, sample_rate_hz=40_000.0), "carrier stamps", "sample_rate_hz"
    ),
}
"""Every fit would be nonsense."""


def _monitor_clipped(trial: Trial) -> Trial:
    if trial.voltage_v is None:
        return trial
    return replace(trial, voltage_v=np.clip(trial.voltage_v, -50.0, 50.0))


WARNINGS: Final[Mapping[str, Slip]] = {
    "a speed never kept": _slip(
        lambda t: _asked(t, speed_mm_s=1.5 * t.info.speed_mm_s), "speed_target", "was measured"
    ),
    "a force never kept": _slip(
        lambda t: _asked(t, force_n=1.5 * t.info.force_n), "force_target", "was asked for"
    ),
    "skin 260 us late": _slip(lambda t: _late(t, 260e-6), "skin_delay", "skew_s"),
    "force clipped": _slip(_clipped, "clipped", "widen the range"),
    "monitor clipped": _slip(_monitor_clipped, "drive_peak", "square of the voltage"),
    "positions 40 ms late": _slip(
        lambda t: replace(t, position_t_s=t.position_t_s + 0.04), "position_delay", "late_s"
    ),
}
"""Fits are possible."""

REFUSED: Final[Mapping[str, Callable[[Trial], Trial]]] = {
    "force in mN": lambda t: _force(t, 1e3 * EYE),
    "acceleration in mm/s2": lambda t: _accel(t, 1e3 * EYE),
    "position in m": lambda t: replace(t, position_mm=1e-3 * t.position_mm),
    "position x and y swapped": lambda t: replace(t, position_mm=t.position_mm[:, ::-1]),
    "times in ms": lambda t: replace(t, position_t_s=1e3 * t.position_t_s),
    "speed in m/s": lambda t: _asked(t, speed_mm_s=1e-3 * t.info.speed_mm_s),
}
"""Refused by the reader already."""


def is_refused(trial: Trial, study: StudyInfo) -> bool:
    """Return whether the reader of studies refuses a trial."""
    try:
        check_asked(trial.info, study)
        check_measured(trial, study)
    except FieldError:
        return True
    return False


def record_of(trial: Trial, study: StudyInfo) -> TrialRecord:
    """Return what the checks know of a trial."""
    course = course_of(trial)
    observed = observe_along(course, trial, study)
    return TrialRecord(observed, statistics_of(trial, study, course))

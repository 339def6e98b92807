"""Values that no finger and no rig produce: nearly always a slip of unit, and named as one."""

from dataclasses import dataclass
from datetime import datetime
from typing import Final

import numpy as np

from frictus_hardware.arrays import FloatArray
from frictus_service.errors import FieldError, as_told
from frictus_service.study.trial import StudyInfo, Trial, TrialInfo


@dataclass(frozen=True, slots=True)
class Range:
    """What a quantity may be.

    Attributes
    ----------
    lowest, highest : float
        Both accepted.
    unit : str
        Of the quantity.
    below, above : str
        What a value beyond looks like.
    """

    lowest: float
    highest: float
    unit: str
    below: str
    above: str

    def check(self, field: str, value: float, what: str = "is") -> None:
        """Raise where the value is beyond.

        Raises
        ------
        FieldError
        """
        if self.lowest <= value <= self.highest:
            return
        slip = self.above if value > self.highest else self.below
        raise FieldError(
            field,
            f"{what} {value:g} {self.unit}; accepted: {self.lowest:g} to {self.highest:g} "
            f"{self.unit}; {slip}",
        )


CARRIER: Final = Range(100.0, 1e6, "Hz", "it looks like kHz", "it looks like mHz")
SCREEN_PEAK: Final = Range(1.0, 1000.0, "V", "it looks like kV", "it looks like mV")
SAMPLE_RATE: Final = Range(
    2000.0,
    1e7,
    "Hz",
    "it looks like kHz, or is too slow for the band of 20 to 1000 Hz",
    "it is absurd",
)
SPEED: Final = Range(1.0, 1000.0, "mm/s", "it looks like m/s", "it looks like um/s")
FORCE: Final = Range(0.01, 20.0, "N", "it looks like kN", "it looks like mN or grams")
SKEW: Final = Range(-0.05, 0.05, "s", "it looks like ms or us", "it looks like ms or us")
LATE: Final = Range(-1.0, 1.0, "s", "it looks like ms", "it looks like ms")
MEASURED_FORCE: Final = Range(0.0, 50.0, "N", "", "it looks like mN or raw counts")
ACCELERATION: Final = Range(0.0, 2e4, "m/s2", "", "it looks like mm/s2 or raw counts")
SKIN_VELOCITY: Final = Range(0.0, 10.0, "m/s", "", "it looks like mm/s")
POSITION: Final = Range(
    0.0, 2000.0, "mm", "", "it looks like um or pixels; the origin lies on the screen"
)
MOST_LETTERS: Final = 100
OVER_PEAK: Final = 1.2
"""So far over the peak of the screen a voltage may be."""
LEAST_OF_DRIVE: Final = 0.1
"""Of half of `drive_vpp` the voltage of a driven trial must reach."""
STILL_MM: Final = 0.5
EXPECTED_MM: Final = 10.0
CLOCK_SLACK_S: Final = 1.0
"""So far position times may lie outside of the samples."""


def check_study(info: StudyInfo) -> None:
    """Refuse implausible attributes of the root.

    Raises
    ------
    FieldError
    """
    CARRIER.check("carrier_hz", info.carrier_hz)
    SCREEN_PEAK.check("screen_peak_v", info.screen_peak_v)
    if info.positions_late_s is not None:
        LATE.check("positions_late_s", info.positions_late_s)


def check_asked(asked: TrialInfo, info: StudyInfo) -> None:
    """Refuse implausible attributes of a trial.

    Raises
    ------
    FieldError
    """
    if len(asked.participant) > MOST_LETTERS:  # names of files hold it
        raise FieldError(
            "participant",
            f"has {len(asked.participant)} letters; accepted: {MOST_LETTERS}, of a pseudonym",
        )
    SAMPLE_RATE.check("sample_rate_hz", asked.sample_rate_hz)
    if asked.speed_mm_s != 0.0:
        SPEED.check("speed_mm_s", asked.speed_mm_s)
    FORCE.check("force_n", asked.force_n)
    nyquist_hz = asked.sample_rate_hz / 2.0
    tones = Range(
        1.0,
        np.nextafter(nyquist_hz, 0.0),
        "Hz",
        "it looks like kHz; 0 alone, or an empty array, is a blank trial",
        f"half of the sample rate of {asked.sample_rate_hz:g} Hz is the limit",
    )
    for tone_hz in asked.tones_hz:
        tones.check("tone_hz", tone_hz)
    each, times = np.unique(asked.tones_hz, return_counts=True)
    if np.any(times > 1):
        twice = each[times > 1][0]
        raise FieldError("tone_hz", f"holds {twice:g} Hz more than once; accepted: each once")
    most = OVER_PEAK * 2.0 * info.screen_peak_v
    least = 1.0 if asked.tones_hz else 0.0
    drive = Range(
        least,
        most,
        "V",
        "it looks like kV, or is 0 in a trial with tones",
        f"it looks like mV, or screen_peak_v is not {info.screen_peak_v:g} V",
    )
    drive.check("drive_vpp", asked.drive_vpp)
    instant(asked.started_utc)


def instant(started_utc: str) -> datetime:
    """Return the time that a text gives.

    Parameters
    ----------
    started_utc : str
        ISO 8601.

    Raises
    ------
    FieldError
        If it is no such text, or so near the ends of the calendar that no time can be added.
    """
    try:
        started = datetime.fromisoformat(started_utc)
    except ValueError:
        started = datetime.min
    if not 2 <= started.year <= 9998:
        raise FieldError(
            "started_utc",
            f"is {as_told(started_utc)}; accepted: ISO 8601 of the years 2 to 9998, as "
            "2026-01-31T12:00:00Z",
        )
    return started


def check_measured(trial: Trial, info: StudyInfo) -> None:
    """Refuse implausible data.

    Raises
    ------
    FieldError
    """
    SKEW.check("force_n", trial.force_skew_s, "its skew_s is")
    SKEW.check("accel_m_s2", trial.skin_skew_s, "its skew_s is")
    _check_voltage(trial, info)
    MEASURED_FORCE.check("force_n", largest("force_n", trial.force_n), "reaches")
    if trial.accel_m_s2 is not None:
        ACCELERATION.check("accel_m_s2", largest("accel_m_s2", trial.accel_m_s2), "reaches")
    if trial.skin_velocity_m_s is not None:
        fastest = largest("skin_velocity_m_s", trial.skin_velocity_m_s)
        SKIN_VELOCITY.check("skin_velocity_m_s", fastest, "reaches")
    _check_clock(trial)
    _check_path(trial)


def largest(field: str, values: FloatArray) -> float:
    """Return the largest magnitude, NaN aside.

    Raises
    ------
    FieldError
        If there is an infinite value, or none that is a number.
    """
    highest, lowest = np.fmax.reduce(values, axis=None), np.fmin.reduce(values, axis=None)
    if np.isnan(highest):
        raise FieldError(field, "holds nothing but NaN; leave the trial away")
    if np.isinf(highest) or np.isinf(lowest):
        raise FieldError(field, "holds infinite values; missing samples are written as NaN")
    return float(max(highest, -lowest))


def _check_voltage(trial: Trial, info: StudyInfo) -> None:
    if trial.voltage_v is None:
        return
    peak = largest("voltage_v", trial.voltage_v)
    asked_v = trial.info.drive_vpp / 2.0
    least = LEAST_OF_DRIVE * asked_v if trial.info.tones_hz else 0.0
    Range(
        least,
        OVER_PEAK * info.screen_peak_v,
        "V",
        f"drive_vpp asks for {asked_v:g} V; it looks like volts before the amplifier, or kV",
        f"screen_peak_v is {info.screen_peak_v:g} V; it looks like mV, or peak to peak",
    ).check("voltage_v", peak, "peaks at")


def _check_clock(trial: Trial) -> None:
    times = trial.position_t_s
    if not np.all(np.isfinite(times)):
        raise FieldError("position_t_s", "holds values that are no times; leave them away")
    steps = np.diff(times)
    if not np.all(steps > 0.0):
        at = int(np.argmin(steps > 0.0)) + 1
        raise FieldError(
            "position_t_s",
            f"does not rise at row {at} ({times[at - 1]:g} s, then {times[at]:g} s); accepted: "
            "rising times, one per position; sort them or leave repeats away",
        )
    duration_s = len(trial.force_n) / trial.info.sample_rate_hz
    slip = "it looks like ms, or does not count from the first sample"
    clock = Range(-CLOCK_SLACK_S, duration_s + CLOCK_SLACK_S, "s", slip, slip)
    clock.check("position_t_s", float(times[0]), "begins at")
    clock.check("position_t_s", float(times[-1]), "ends at")


def _check_path(trial: Trial) -> None:
    POSITION.check("position_mm", largest("position_mm", trial.position_mm), "reaches")
    x_mm = trial.position_mm[:, 0]
    span_mm = float(np.fmax.reduce(x_mm) - np.fmin.reduce(x_mm))
    asked_mm = trial.info.speed_mm_s * len(trial.force_n) / trial.info.sample_rate_hz
    if span_mm < STILL_MM and asked_mm > EXPECTED_MM:
        raise FieldError(
            "position_mm",
            f"spans {span_mm:g} mm along x where the target speed covers {asked_mm:g} mm; "
            "it looks like m, or the finger did not move",
        )

"""A few numbers of the samples of one trial, which the checks pool over trials."""

from dataclasses import astuple, dataclass, fields
from functools import partial
from typing import Final, Self

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from frictus_hardware.arrays import FloatArray
from frictus_service.identification.observation.hann_spectrum import LONGEST, hann_spectrum
from frictus_service.identification.observation.observe import FingerTrajectory
from frictus_service.identification.observation.sweeps import WINDOW_S
from frictus_service.identification.observation.validity import inspect
from frictus_service.identification.plausibility.turns import (
    DELAYS_S,
    delay_of,
    friction_delay_s,
    often_reported,
)
from frictus_service.study.trial import StudyInfo, Trial

BAND_HZ: Final = (20.0, 1000.0)
"""In which the power along and across is compared."""
APART_S: Final = 0.4
"""Changes of velocity are taken over so long: a reversal fits, gravity's drift does not."""
BLOCK_S: Final = 0.5e-3
"""Sums of a sensor over so long are enough for how a finger moves."""
LEAST_CHANGE_M_S: Final = 0.02
"""Standard deviation of these changes, below which nothing is compared: the finger went on."""
ALIKE: Final = 0.95
"""Correlation above which the two show one motion, so that a delay can be told."""
LEAST_SPEED_MM_S: Final = 2.0
AROUND_S: Final = 0.1
"""Positions so long before the first and after the last sample contradict no clock."""
ONE_SIDED: Final = 0.25
"""Share of a voltage's mean square that its mean has at most where there is a carrier."""
ENOUGH: Final = 10_000
"""Samples for the median of a force: to sort ten times as many would tell the same."""
PRESSED: Final = 0.25
"""Of the strongest force: what presses."""


@dataclass(frozen=True, slots=True)
class TrialStatistics:
    """Statistics of one trial's samples; NaN where they cannot be told.

    Attributes
    ----------
    duration_s : float
        Samples over sample rate.
    coverage : float
        Time from the first to the last position report, as a share of that; without up to
        0.1 s at either end that no sample covers.
    carrier_ratio : float
        Strongest line of the voltage over the carrier as the sample rate would show it; NaN
        where the voltage has a mean, and so no carrier.
    drive_ratio : float
        Largest magnitude of the voltage over half of `drive_vpp`; NaN without tones, or where
        `carrier_ratio` is.
    across_motion : float
        Rms of the velocity along y over that along x, where the finger moves.
    normal_n, lateral_n : float
        Median of the force along z; the larger median magnitude of those along x and y.
    normal_flips : float
        Share of the samples that press in which the force along z has the rarer sign.
    right_force_n, right_across_n, right_normal_n, right_s : float
        Over sweeps to the right: mean force along the motion, mean across it to the left of
        the motion, mean normal force; seconds.
    left_force_n, left_across_n, left_normal_n, left_s : float
        Over sweeps to the left.
    force_across, skin_across : float
        Power from 20 to 1000 Hz along y over that along x, of force and of acceleration.
    motion_power, shared, skin_power : float
        Sums of squares and of products about their means: change of the finger's velocity from
        its positions, and from the skin's sensor; (m/s)².
    late_by_skin_s, late_by_friction_s : float
        By which positions follow the skin's sensor, and friction.
    positions_earlier_s : float
        By which the times of the positions were taken earlier, as they were found late.
    clipped : float
        Largest share of samples at an end of a channel's range.
    """

    duration_s: float
    coverage: float
    carrier_ratio: float
    drive_ratio: float
    across_motion: float
    normal_n: float
    lateral_n: float
    normal_flips: float
    right_force_n: float
    right_across_n: float
    right_normal_n: float
    right_s: float
    left_force_n: float
    left_across_n: float
    left_normal_n: float
    left_s: float
    force_across: float
    skin_across: float
    motion_power: float
    shared: float
    skin_power: float
    late_by_skin_s: float
    late_by_friction_s: float
    positions_earlier_s: float
    clipped: float

    def as_table(self) -> NDArray[np.void]:
        """Return it as a structured array of shape (1,)."""
        names = [(field.name, np.float64) for field in fields(self)]
        return np.array([astuple(self)], dtype=names)

    @classmethod
    def of_table(cls, table: NDArray[np.void]) -> Self:
        """Return what `as_table` made."""
        return cls(*(float(table[field.name][0]) for field in fields(cls)))


def statistics_of(trial: Trial, study: StudyInfo, course: FingerTrajectory) -> TrialStatistics:
    """Return the statistics of a trial.

    Parameters
    ----------
    trial : Trial
        As it was recorded.
    study : StudyInfo
        Its carrier is used.
    course : FingerTrajectory
        Of the finger in the trial.
    """
    duration_s = trial.force_n.shape[0] / trial.info.sample_rate_hz
    times = trial.position_t_s[np.isfinite(trial.position_mm).all(axis=1)]
    covered = _covered(times, duration_s) if times.size > 1 else np.nan
    force_n = np.ascontiguousarray(trial.force_n.T)  # whole axes are looked through, many times
    known = np.isfinite(force_n)
    axes = [
        axis if here.all() else axis[here] for axis, here in zip(force_n, known, strict=True)
    ]
    medians = [float(np.median(_spread(axis))) if axis.size else np.nan for axis in axes]
    rate_hz = trial.info.sample_rate_hz
    whole = np.logical_and.reduce(known, axis=0)
    swept = partial(_swept, course, force_n, whole, rate_hz)
    motion_power, shared, skin_power, late_by_skin_s = _kinematics(trial, course)
    carrier_ratio = _carrier_ratio(trial, study)
    return TrialStatistics(
        duration_s,
        covered,
        carrier_ratio,
        np.nan if np.isnan(carrier_ratio) else _drive_ratio(trial),
        _across_motion(course),
        medians[2],
        max(abs(medians[0]), abs(medians[1])),
        _flips(axes[2]),
        *swept(1),
        *swept(-1),
        _across(trial.force_n, rate_hz),
        np.nan if trial.accel_m_s2 is None else _across(trial.accel_m_s2, rate_hz),
        motion_power,
        shared,
        skin_power,
        late_by_skin_s,
        friction_delay_s(force_n, rate_hz, course),
        0.0,
        _clipped(trial),
    )


def _covered(times_s: FloatArray, duration_s: float) -> float:
    """Return what positions span over what the samples last, without what lies around them."""
    span_s = float(times_s[-1] - times_s[0])
    if span_s > duration_s:
        span_s = max(span_s - 2.0 * AROUND_S, duration_s)
    return span_s / duration_s


def _spread(samples: FloatArray) -> FloatArray:
    """Return samples from the whole of a trial, fewer than twice `ENOUGH`."""
    return samples[:: max(samples.size // ENOUGH, 1)]


def _flips(normal_n: FloatArray) -> float:
    if not normal_n.size:
        return np.nan
    pressed_n = PRESSED * np.quantile(np.abs(_spread(normal_n)), 0.9)
    either = [np.count_nonzero(normal_n > pressed_n), np.count_nonzero(normal_n < -pressed_n)]
    return min(either) / sum(either) if any(either) else np.nan


def _across_motion(course: FingerTrajectory) -> float:
    velocity = course.motion.velocity_mm_s
    moving = velocity[course.motion.speed_mm_s > LEAST_SPEED_MM_S]
    if not moving.size:
        return np.nan
    along, across = np.sqrt(np.mean(np.square(moving), axis=0))
    return float(across / max(along, 1e-9))


def _swept(
    course: FingerTrajectory,
    force_n: FloatArray,
    known: NDArray[np.bool_],
    rate_hz: float,
    direction: int,
) -> tuple[float, float, float, float]:
    """Return mean forces along, across and into the screen, and seconds, in one direction.

    Parameters
    ----------
    course : FingerTrajectory
        Of the finger.
    force_n : ndarray, shape (3, n_samples)
    known : ndarray, shape (n_samples,)
        Whether all three axes are.
    rate_hz : float
        Of the samples.
    direction : int
        1 to the right, -1 to the left.
    """
    whole = bool(known.all())
    totals, samples = np.zeros(3), 0
    for segment in course.segments:
        if segment.direction != direction:
            continue
        first, last = (max(int(at * rate_hz), 0) for at in (segment.begin_s, segment.end_s))
        force = force_n[:, first:last]
        if not whole:
            force = force[:, known[first:last]]
        x, y, z = force.sum(axis=1)
        along_x, along_y = segment.along
        totals += (x * along_x + y * along_y, y * along_x - x * along_y, z)
        samples += force.shape[1]
    if not samples:
        return np.nan, np.nan, np.nan, 0.0
    along, across, normal = (totals / samples).tolist()
    return along, across, normal, samples / rate_hz


def _across(samples: FloatArray, rate_hz: float) -> float:
    """Return the power along y over that along x in the band."""
    middle = max(samples.shape[0] - LONGEST, 0) // 2
    amplitudes, length = hann_spectrum(samples[middle:, :2])
    at_hz = np.fft.rfftfreq(length, 1.0 / rate_hz)
    in_band = (at_hz >= BAND_HZ[0]) & (at_hz <= BAND_HZ[1])
    along, across = np.square(amplitudes[in_band]).sum(axis=0)
    return float(across / along) if along > 0.0 else np.nan


def _carrier_ratio(trial: Trial, study: StudyInfo) -> float:
    if trial.voltage_v is None:
        return np.nan
    voltage = np.nan_to_num(trial.voltage_v[:LONGEST])
    if np.square(voltage.mean()) > ONE_SIDED * np.square(voltage).mean():
        return np.nan  # a drive without its carrier, as imports keep an envelope
    amplitudes, length = hann_spectrum(voltage)
    if not amplitudes.max() > 0.0:
        return np.nan
    per_sample = study.carrier_hz / trial.info.sample_rate_hz
    expected = abs(per_sample - round(per_sample))
    return float(np.argmax(amplitudes)) / length / expected if expected > 0.0 else np.nan


def _drive_ratio(trial: Trial) -> float:
    if trial.voltage_v is None or not trial.info.tones_hz:
        return np.nan
    return float(2.0 * np.nanmax(np.abs(trial.voltage_v)) / trial.info.drive_vpp)


def _kinematics(trial: Trial, course: FingerTrajectory) -> tuple[float, float, float, float]:
    """Return how velocity changes by positions and by the skin's sensor, and how late by them.

    Sums of squares and of products of the integrated acceleration over `APART_S`, or of the
    mean skin velocity: both follow a finger that reverses, whatever its skin does. The delay
    is that at which the two are correlated most.
    """
    motion, rate_hz = course.motion, trial.info.sample_rate_hz
    unknown = (np.nan, np.nan, np.nan, np.nan)
    if trial.accel_m_s2 is not None:
        sensor = trial.accel_m_s2[:, 0]
    elif trial.skin_velocity_m_s is not None:
        sensor = trial.skin_velocity_m_s
    else:
        return unknown
    first, last = motion.time_s, motion.time_s + APART_S
    end_s = min(float(motion.time_s.max(initial=0.0)), sensor.size / rate_hz)
    inside = (first >= 0.0) & (last <= end_s)
    if np.count_nonzero(inside) < 3 or not np.isfinite(sensor).any():
        return unknown
    first, last = first[inside], last[inside]
    block = max(int(BLOCK_S * rate_hz), 1)
    blocks = sensor[: sensor.size // block * block].reshape(-1, block)
    total = np.append(0.0, np.cumsum(np.nansum(blocks, axis=1))) / rate_hz
    clock = np.arange(total.size) * (block / rate_hz)
    if trial.accel_m_s2 is not None:
        # What a tone does to the skin turns with the direction: reports would see it as motion.
        smoothed = round(2.0 * WINDOW_S * rate_hz / block)
        total = uniform_filter1d(total, smoothed, mode="nearest")
        along = motion.velocity_mm_s[:, 0] / 1000.0
    else:
        total = total / APART_S
        along = motion.position_mm[:, 0] / 1000.0 / APART_S
    moved = np.interp(last, motion.time_s, along) - np.interp(first, motion.time_s, along)
    measured = np.interp(last, clock, total) - np.interp(first, clock, total)
    if not moved.std() >= LEAST_CHANGE_M_S:
        return unknown
    late_s = np.nan
    if often_reported(motion):
        whole = (first >= DELAYS_S[-1]) & (last <= end_s + DELAYS_S[0])
        earlier = DELAYS_S[:, np.newaxis]  # a late report shows where the finger was
        shifted = np.interp(last[whole] - earlier, clock, total)
        shifted = shifted - np.interp(first[whole] - earlier, clock, total)
        late_s, _ = delay_of(moved[whole], shifted, ALIKE)
    moved, measured = moved - moved.mean(), measured - measured.mean()
    return float(moved @ moved), float(moved @ measured), float(measured @ measured), late_s


def _clipped(trial: Trial) -> float:
    channels = (trial.force_n, trial.accel_m_s2, trial.skin_velocity_m_s)
    return max(
        (
            end.share
            for samples in channels
            if samples is not None
            for end in inspect(samples.reshape(samples.shape[0], -1)).clipped
        ),
        default=0.0,
    )

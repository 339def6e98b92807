"""Whether a trial may be used: the paper's Appendix C, and whether its converters clipped.

The paper asks that means stay within 10 % of the targets, and that samples more than 25 % off
add up to no more than one second of the ten of a trial. Here that is a tenth of a trial of any
length. A finger that reverses cannot keep its speed: speed is not judged within 0.15 s of a
reversal, and means are taken over the sweeps.

Every row holds the speed that was measured, and every law is fitted to that. So a speed may be
25 % off its target, and is to be steady about its own mean; farther off it is another condition
than the one whose trials it is compared with.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from numba import njit

from frictus_hardware.arrays import BoolArray, FloatArray
from frictus_service.identification.observation.hann_spectrum import LONGEST, hann_spectrum
from frictus_service.identification.observation.response import drive_fraction
from frictus_service.identification.observation.standing import judge_standing
from frictus_service.identification.observation.sweeps import (
    GAP_S,
    LEAST_SWEEP_S,
    LEAST_TRAVEL_MM,
    Sweep,
    TouchMotion,
    rest_mm_s,
)
from frictus_service.study.trial import StudyInfo, Trial

CLIPPED_SHARE: Final = 0.001
"""Of the samples, at one end of the range: so many are accepted."""

CLIPPED_RATIO: Final = 5.0
"""Of the samples at an end to those at the next value. The crest of a sine wave in coarse steps
has 1.4 times as many, clipped ones have many more."""

LEAST_LEVELS: Final = 10.0
"""Range over the distance from an end to the next value: below, the channel rests, and what
stands at an end is a converter's step."""


@dataclass(frozen=True, slots=True)
class Clipped:
    """An end of the range at which samples stand.

    Attributes
    ----------
    column : int
        Number of the channel's column.
    value : float
        In the channel's unit.
    share : float
        Of the samples.
    """

    column: int
    value: float
    share: float


@dataclass(frozen=True, slots=True)
class Quality:
    """Of one channel.

    Attributes
    ----------
    missing_share : float
        Of the samples, in the column that lacks most.
    missing_column : int
        That column.
    clipped : tuple of Clipped
        Ends at which samples stand; empty where none do.
    constant : tuple of int
        The columns that hold one and the same value throughout.
    """

    missing_share: float
    missing_column: int
    clipped: tuple[Clipped, ...]
    constant: tuple[int, ...]


def inspect(samples: FloatArray) -> Quality:
    """Return what is missing, what is clipped and what stands.

    Parameters
    ----------
    samples : ndarray, shape (n_samples, n_columns)
        Missing samples NaN.
    """
    count = samples.shape[0]
    found: list[Clipped] = []
    constant: list[int] = []
    missing_of = np.zeros(samples.shape[1])
    for column in range(samples.shape[1]):
        missing, ends = _ends(samples[:, column])
        missing_of[column] = missing / count
        if missing == count:
            continue
        levels = np.ptp(ends[:, 0])
        if levels == 0.0:
            constant.append(column)
            continue
        for value, there, following, after in ends:
            rests = not levels >= LEAST_LEVELS * abs(value - following)
            if not rests and there > max(CLIPPED_SHARE * count, CLIPPED_RATIO * after):
                found.append(Clipped(column, float(value), float(there / count)))
    most = int(np.argmax(missing_of))
    return Quality(float(missing_of[most]), most, tuple(found), tuple(constant))


@njit(cache=True, nogil=True)
def _ends(samples):  # type: ignore[no-untyped-def]
    """Return how many samples are missing; of both ends and the values next to them, counts."""
    missing = 0
    ends = np.zeros((2, 4))
    for end in range(2):
        sign = 1.0 - 2.0 * end
        first, second = -np.inf, -np.inf
        of_first, of_second = 0, 0
        for n in range(samples.size):
            value = sign * samples[n]
            if value < second:
                continue
            if value > first:
                second, of_second = first, of_first
                first, of_first = value, 1
            elif value == first:
                of_first += 1
            elif value > second:
                second, of_second = value, 1
            elif value == second:
                of_second += 1
            elif end == 0:
                missing += 1
        ends[end, 0], ends[end, 1] = sign * first, of_first
        ends[end, 2], ends[end, 3] = sign * second, of_second
    return missing, ends


MEAN_TOLERANCE: Final = 0.10
"""Of the normal force, which stands for the contact area: no row knows how that grew."""
TOLERANCE: Final = 0.25
MOST_OFF: Final = 0.1
"""Share of the trial that may be off target; of its samples that may be missing."""

REVERSAL_S: Final = 0.15

LEAST_DRIVE: Final = 0.02
"""Amplitude of the drive fraction below which there is none."""

LINE_SHARE: Final = 0.05
"""Of the drive's power, in an undeclared tone; noise has less in any line."""

LOWEST_TONE_HZ: Final = 20.0
"""Of a tone that nobody declared: below it the drive follows the strokes."""

PIECES: Final = 8
"""Of a drive, spread over all of it, in which a tone must be to be one."""

HANN_LINES: Final = 1.5
"""As many lines of the spectrum hold the power of one tone."""

HIGHEST_SHARE: Final = 0.15
"""Lines are looked for up to this share of the sample rate: above lie the carrier's images."""


@dataclass(frozen=True, slots=True)
class Means:
    """Over the sweeps; NaN where nothing was measured."""

    speed_mm_s: float
    force_n: float


def judge(
    trial: Trial, study: StudyInfo, motion: TouchMotion, sweeps: list[Sweep], means: Means
) -> tuple[str, ...]:
    """Return why a trial may not be used: one sentence each, none where it may.

    Parameters
    ----------
    trial : Trial
        As it was recorded.
    study : StudyInfo
        What holds for all trials: carrier, peak voltage, mount.
    motion : TouchMotion
        Of the finger, from `sweeps.smooth`.
    sweeps : list of Sweep
        Steady movements, in time.
    means : Means
        Of speed, force and position over the sweeps.
    """
    return (
        *_samples(trial),
        *judge_standing(trial, sweeps),
        *_speed(trial, motion, sweeps, means.speed_mm_s),
        *_force(trial, sweeps, means.force_n),
        *_drive(trial, study),
    )


def judge_signals(trial: Trial, study: StudyInfo) -> tuple[str, ...]:
    """Return why the signals of a trial may not be used, whatever was asked of the finger.

    Parameters
    ----------
    trial : Trial
        As it was recorded.
    study : StudyInfo
        What holds for all trials: carrier, peak voltage, mount.
    """
    return (*_samples(trial), *_drive(trial, study))


def _samples(trial: Trial) -> Iterator[str]:
    """Judge what is missing, what is clipped and what stands along the screen."""
    channels = {
        "voltage_v": trial.voltage_v,
        "force_n": trial.force_n,
        "accel_m_s2": trial.accel_m_s2,
        "skin_velocity_m_s": trial.skin_velocity_m_s,
    }
    for name, samples in channels.items():
        if samples is None:
            continue
        quality = inspect(samples.reshape(samples.shape[0], -1))
        needed = name in ("voltage_v", "force_n")
        if needed and quality.missing_share > MOST_OFF:
            yield (
                f"{quality.missing_share:.0%} of the samples of {name} are missing in column "
                f"{quality.missing_column}; accepted: {MOST_OFF:.0%}"
            )
        if name != "voltage_v":
            if 0 in quality.constant:
                yield (
                    f"{name}, column 0, holds one and the same value throughout: its sensor is "
                    "dead or not connected; accepted: a channel that varies"
                )
            for clipped in quality.clipped:
                yield (
                    f"{name}, column {clipped.column}, is clipped at {clipped.value:.4g}: "
                    f"{clipped.share:.1%} of its samples stand there; accepted: "
                    f"{CLIPPED_SHARE:.1%}"
                )


def _speed(
    trial: Trial, motion: TouchMotion, sweeps: list[Sweep], mean_mm_s: float
) -> Iterator[str]:
    if not sweeps:
        reported = np.isfinite(trial.position_mm).all(axis=1).sum()
        yield (
            f"there is no steady sweep along the screen in {reported} reports of the position; "
            f"accepted: at least {LEAST_SWEEP_S:g} s and {LEAST_TRAVEL_MM:g} mm one way at a "
            "steady speed"
        )
        return
    target = trial.info.speed_mm_s
    if target > 0.0:  # else none was asked for: steadiness alone counts
        yield from _mean("speed over the sweeps", mean_mm_s, target, "mm/s", TOLERANCE)
    off = np.abs(motion.speed_mm_s - mean_mm_s) > TOLERANCE * mean_mm_s
    inside = (motion.time_s >= 0.0) & (motion.time_s <= _duration_s(trial))
    judged = off & inside & ~_reversing(motion)
    lasting_s: FloatArray = np.minimum(np.gradient(motion.time_s), GAP_S)[judged]
    yield from _excess("speed", "mean", motion.time_s[judged], lasting_s, sweeps, trial)


def _reversing(motion: TouchMotion) -> BoolArray:
    """Return which reports lie close to the end or the beginning of motion at a reversal."""
    along = motion.velocity_mm_s[:, 0]
    brisk = np.flatnonzero(np.abs(along) > rest_mm_s(motion))
    turned = np.diff(np.sign(along[brisk])) != 0.0
    edges = np.unique(motion.time_s[np.concatenate([brisk[:-1][turned], brisk[1:][turned]])])
    padded = np.concatenate([[-np.inf], edges, [np.inf]])
    after = np.searchsorted(edges, motion.time_s) + 1
    distance = np.minimum(padded[after] - motion.time_s, motion.time_s - padded[after - 1])
    close: BoolArray = distance < REVERSAL_S
    return close


def _force(trial: Trial, sweeps: list[Sweep], mean_n: float) -> Iterator[str]:
    target = trial.info.force_n
    if not np.isnan(mean_n):
        yield from _mean("normal force over the sweeps", mean_n, target, "N", MEAN_TOLERANCE)
    off = np.flatnonzero(np.abs(trial.force_n[:, 2] - target) > TOLERANCE * target)
    step_s = 1.0 / trial.info.sample_rate_hz
    off_at_s = off.astype(np.float64) * step_s
    lasting_s = np.full(off.size, step_s)
    yield from _excess("normal force", "target", off_at_s, lasting_s, sweeps, trial)


def _mean(what: str, mean: float, target: float, unit: str, tolerance: float) -> Iterator[str]:
    if not abs(mean - target) <= tolerance * target:
        yield (
            f"the mean {what} is {mean:.3g} {unit}, {mean / target - 1.0:+.1%} from the target "
            f"of {target:g} {unit}; accepted: ±{tolerance:.0%}"
        )


def _excess(
    what: str,
    of: str,
    off_at_s: FloatArray,
    lasting_s: FloatArray,
    sweeps: list[Sweep],
    trial: Trial,
) -> Iterator[str]:
    off_s, duration_s = float(lasting_s.sum()), _duration_s(trial)
    if off_s <= MOST_OFF * duration_s:
        return
    told = (
        f"the {what} is more than {TOLERANCE:.0%} from its {of} for {off_s:.2g} s of "
        f"{duration_s:.3g} s; accepted: {MOST_OFF * duration_s:.2g} s"
    )
    if sweeps:
        begin_s, end_s = sweeps[0].begin_s, sweeps[-1].end_s
        within_s = float(lasting_s[(off_at_s >= begin_s) & (off_at_s <= end_s)].sum())
        if within_s <= MOST_OFF * (end_s - begin_s):
            told += (
                f"; between the first stroke and the last, {within_s:.2g} s: cut off "
                f"what is before {begin_s:.2f} s and after {end_s:.2f} s"
            )
    yield told


def _duration_s(trial: Trial) -> float:
    return float(trial.force_n.shape[0] / trial.info.sample_rate_hz)


def _drive(trial: Trial, study: StudyInfo) -> Iterator[str]:
    declared = trial.info.tones_hz
    if trial.voltage_v is None:
        if declared:
            yield f"a tone of {_listed(declared)} Hz is declared, but there is no voltage_v"
        return
    lowest_hz = 0.0 if declared else LOWEST_TONE_HZ
    line_hz, amplitude, share, resolution_hz = _strongest(trial, study, lowest_hz)
    if declared and amplitude < LEAST_DRIVE / len(declared):
        yield (
            f"a tone of {_listed(declared)} Hz is declared, but the voltage drives with an "
            f"amplitude of {amplitude:.2g} of full drive at most"
        )
    elif declared and min(abs(line_hz - tone) for tone in declared) > 1.5 * resolution_hz:
        yield (
            f"a tone of {_listed(declared)} Hz is declared, but the voltage drives at "
            f"{line_hz:.1f} Hz"
        )
    elif not declared and amplitude >= LEAST_DRIVE and share >= LINE_SHARE:
        if _lasts(trial, study, line_hz, amplitude):
            yield f"no tone is declared, but the voltage drives at {line_hz:.1f} Hz"


def _lasts(trial: Trial, study: StudyInfo, line_hz: float, amplitude: float) -> bool:
    """Return whether a line is in each of some pieces of the whole drive, as a tone is.

    A line of a texture is where the finger's speed puts it, for a part of each stroke.
    """
    assert trial.voltage_v is not None
    length = min(trial.voltage_v.size, LONGEST) // 4
    turning = np.exp(-2j * np.pi * line_hz * np.arange(length) / trial.info.sample_rate_hz)
    for begin in np.linspace(0, trial.voltage_v.size - length, PIECES).astype(np.int64):
        volts = np.nan_to_num(trial.voltage_v[begin : begin + length])
        drive = drive_fraction(volts, study.screen_peak_v)
        if abs(np.mean((drive - drive.mean()) * turning)) < 0.25 * amplitude:
            return False
    return True


def _listed(tones_hz: tuple[float, ...]) -> str:
    return ", ".join(f"{tone:g}" for tone in tones_hz)


def _strongest(
    trial: Trial, study: StudyInfo, lowest_hz: float
) -> tuple[float, float, float, float]:
    """Return frequency, amplitude, share of power of the strongest line; the resolution."""
    assert trial.voltage_v is not None
    drive = drive_fraction(np.nan_to_num(trial.voltage_v[:LONGEST]), study.screen_peak_v)
    spectrum, length = hann_spectrum(drive)
    resolution_hz = trial.info.sample_rate_hz / length
    highest = int(HIGHEST_SHARE * length)
    lowest = max(2, int(np.ceil(lowest_hz / resolution_hz)))
    strongest = lowest + int(np.argmax(spectrum[lowest:highest]))
    amplitude = float(spectrum[strongest])
    whole = float(np.square(spectrum[lowest:highest]).sum()) / HANN_LINES
    share = amplitude**2 / whole if whole > 0.0 else 0.0
    return strongest * resolution_hz, amplitude, share, resolution_hz

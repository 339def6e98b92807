"""The loop-back: whether the monitor reads what the output plays."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from frictus_hardware.arrays import FloatArray
from frictus_service.selftest.playing import PEAK_V, Played
from frictus_service.selftest.report import (
    Measure,
    Outcome,
    SelftestFinding,
    beyond,
    judged,
    lost,
    mean_and_half,
)

TEST: Final = "loop-back"
PERIODS: Final = 20
TONES: Final = 24
LOW_HZ: Final = 30.0
HIGH_HZ: Final = 4_000.0
FOLLOWS: Final = 0.5
"""Share of the monitor's power that must be the drive's, else it is not connected."""
PRESENT: Final = 0.02
"""Gain below which nothing of the drive arrives."""
GAIN_OFF: Final = (0.02, 0.1)
"""Gain errors at which to warn, and to fail; the same of the two below."""
DELAY_SAMPLES: Final = (1.5, 4.0)
RESIDUAL: Final = (0.05, 0.2)
"""Over the drive's rms."""
EARLY_SAMPLES: Final = -0.25
"""No monitor reads a drive before it plays."""


@dataclass(frozen=True, slots=True, eq=False)
class PeriodicTones:
    """Tones that begin anew with every period.

    Attributes
    ----------
    period_v : ndarray, shape (period_samples,)
    bins : ndarray of int, shape (n_tones,)
        Cycles of each tone within a period.
    """

    period_v: FloatArray
    bins: NDArray[np.intp]

    @property
    def drive_v(self) -> FloatArray:
        """What to play: a period to settle in, and those that count."""
        return np.tile(self.period_v, PERIODS + 1)


def tones(sample_rate_hz: float, peak_v: float = PEAK_V) -> PeriodicTones:
    """Return tones of equal amplitude from 30 Hz to 4 kHz, a fifth of the rate at most.

    Parameters
    ----------
    sample_rate_hz : float
        Samples per second of the device's clock.
    peak_v : float
        Largest magnitude.
    """
    period = round(0.1 * sample_rate_hz)
    high_hz = min(HIGH_HZ, 0.2 * sample_rate_hz)
    wanted = np.rint(np.geomspace(LOW_HZ, high_hz, TONES) * period / sample_rate_hz)
    bins = np.unique(wanted.astype(np.intp))
    # Off the mains: with periods of 0.1 s its lines lie at multiples of 5 and 6 cycles.
    bins = bins[(bins % 5 != 0) & (bins % 6 != 0)]
    order = np.arange(bins.size)
    spectrum = np.zeros(period // 2 + 1, dtype=np.complex128)
    # Schroeder's phases keep the peak low: IEEE Trans. Inf. Theory 16 (1970) 85.
    spectrum[bins] = np.exp(-1j * np.pi * order**2 / bins.size)
    wave = np.fft.irfft(spectrum, period)
    return PeriodicTones(peak_v * wave / np.abs(wave).max(), bins)


@dataclass(frozen=True, slots=True)
class LoopBack:
    """How the monitor follows the drive.

    Attributes
    ----------
    gain, gain_half : float
        Monitor over drive, negative if inverted; half of the 95 % interval.
    delay_samples, delay_half : float
        From the sample at which the drive plays to that at which the monitor has it.
    residual_v, residual_half : float
        RMS of what the monitor reads beside that, its mean taken off.
    drive_v : float
        RMS of the drive.
    follows : float
        Share of the monitor's power that is the drive's.
    """

    gain: float
    gain_half: float
    delay_samples: float
    delay_half: float
    residual_v: float
    residual_half: float
    drive_v: float
    follows: float


def compare(
    applied_v: FloatArray, monitor_v: FloatArray, bins: NDArray[np.intp], period_samples: int
) -> LoopBack:
    """Compare drive and monitor, period by period.

    Parameters
    ----------
    applied_v, monitor_v : ndarray, shape (n_periods * period_samples,)
        Two periods or more, in the steady state.
    bins : ndarray of int, shape (n_tones,)
        Cycles of each tone within a period.
    period_samples : int
        Of one period.
    """
    drive = np.fft.rfft(applied_v.reshape(-1, period_samples), axis=1)
    heard = np.fft.rfft(monitor_v.reshape(-1, period_samples), axis=1)
    omega = 2.0 * np.pi * np.arange(drive.shape[1]) / period_samples
    cross = np.zeros_like(drive)
    cross[:, bins] = heard[:, bins] * np.conj(drive[:, bins])
    likeness = np.fft.irfft(cross.mean(axis=0), period_samples)
    lag = int(np.argmax(np.abs(likeness)))
    sign = float(np.sign(likeness[lag])) or 1.0
    lag -= period_samples if lag > period_samples // 2 else 0
    turned = sign * cross[:, bins] * np.exp(1j * omega[bins] * lag)
    weight = np.abs(drive[:, bins]) ** 2
    slope = (weight * omega[bins] * np.angle(turned)).sum(axis=1)
    delays = lag - slope / (weight * omega[bins] ** 2).sum(axis=1)
    delay, delay_half = mean_and_half(delays)
    straight = cross[:, bins] * np.exp(1j * omega[bins] * delay)
    gain, gain_half = mean_and_half(straight.real.sum(axis=1) / weight.sum(axis=1))
    rest = heard - gain * drive * np.exp(-1j * omega * delay)
    residual, residual_half = mean_and_half(_rms(rest, period_samples))
    total = float(_rms(heard, period_samples).mean())
    return LoopBack(
        gain=gain,
        gain_half=gain_half,
        delay_samples=delay,
        delay_half=delay_half,
        residual_v=residual,
        residual_half=residual_half,
        drive_v=float(_rms(drive, period_samples).mean()),
        follows=1.0 - (residual / total) ** 2 if total else 0.0,
    )


def _rms(spectra: NDArray[np.complex128], period_samples: int) -> FloatArray:
    """Return the rms of each period without its mean, by Parseval's theorem."""
    power = np.abs(spectra) ** 2
    power[:, 0] = 0.0
    if period_samples % 2 == 0:
        power[:, -1] /= 2.0
    rms: FloatArray = np.sqrt(2.0 * power.sum(axis=1)) / period_samples
    return rms


def judge_loop_back(played: Played, excitation: PeriodicTones) -> Outcome:
    """Say whether the monitor reads what the output plays.

    Parameters
    ----------
    played : Played
        Of the drive of the excitation.
    excitation : PeriodicTones
        What was played.
    """
    if played.lost_samples:
        return lost(TEST, played.lost_samples)
    period = excitation.period_v.size
    counted = slice(played.start + period, played.start + (PERIODS + 1) * period)
    found = compare(
        played.applied_v[counted], played.monitor_v[counted], excitation.bins, period
    )
    figures = [
        Measure("gain, monitor over drive", found.gain, "", found.gain_half),
        Measure("delay after play_sample", found.delay_samples, "samples", found.delay_half),
        Measure("residual, rms", found.residual_v, "V", found.residual_half),
        Measure("drive, rms", found.drive_v, "V"),
    ]
    fine = (
        f"the monitor reads the drive {100.0 * (found.gain - 1.0):+.2f} ± "
        f"{100.0 * found.gain_half:.1g} %, {found.delay_samples:.2f} ± {found.delay_half:.1g} "
        "samples after it plays"
    )
    return judged(TEST, figures, _remarks(found), fine)


def _remarks(found: LoopBack) -> list[SelftestFinding]:
    if not (found.follows >= FOLLOWS and abs(found.gain) >= PRESENT):
        what = (
            f"the monitor does not follow the drive: {100.0 * max(found.follows, 0.0):.0f} % "
            f"of its power is the drive's, at a gain of {found.gain:.2g}"
        )
        to_do = "connect the monitor's input and switch the amplifier on"
        return [SelftestFinding("fail", what, to_do)]
    remarks = []
    if found.gain < 0.0:
        what = f"the monitor has the wrong polarity (gain {found.gain:.3g})"
        remarks.append(SelftestFinding("fail", what, "swap the two leads of the monitor"))
    off = beyond(abs(abs(found.gain) - 1.0), *GAIN_OFF)
    if off != "ok":
        what = (
            f"the monitor reads {abs(found.gain):.4g} ± {found.gain_half:.1g} times the drive, "
            f"1 ± {GAIN_OFF[0]:g} is expected"
        )
        to_do = "measure the screen's volts; correct monitor.gain or amplifier_gain"
        remarks.append(SelftestFinding(off, what, to_do))
    return [*remarks, *_late(found), *_unlike(found)]


def _late(found: LoopBack) -> list[SelftestFinding]:
    early = found.delay_samples < EARLY_SAMPLES
    late = "fail" if early else beyond(found.delay_samples, *DELAY_SAMPLES)
    if late == "ok":
        return []
    what = (
        f"the monitor has the drive {found.delay_samples:.2f} ± {found.delay_half:.1g} samples "
        f"after it plays, 0 to {DELAY_SAMPLES[0]:g} are expected"
    )
    to_do = "look for a filter in monitor or amplifier; the recorded drive is off by as much"
    return [SelftestFinding(late, what, to_do)]


def _unlike(found: LoopBack) -> list[SelftestFinding]:
    share = found.residual_v / found.drive_v
    unlike = beyond(share, *RESIDUAL)
    if unlike == "ok":
        return []
    what = (
        f"beside the drive the monitor reads {found.residual_v:.3g} V rms, "
        f"{100.0 * share:.0f} % of the drive, {100.0 * RESIDUAL[0]:g} % are expected at most"
    )
    to_do = "see the noise floor; look for distortion and for a narrow amplifier"
    return [SelftestFinding(unlike, what, to_do)]

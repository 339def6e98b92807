"""Spectra of what drove, was felt and moved, in windows of a tenth of a second.

What drives is seldom at the frequencies of the windows: of a tone, or a line of a texture, each
of them has a part, and the response is that at the line's own. A band therefore speaks of the
mean frequency of what it has parts of: by how much that turns in a sample (Auger and Flandrin
1995, reassignment): with the windows' frequencies a tone of 93 Hz at 90 and 100 Hz is off by
0.3 and 0.7 %, and known to 0.002 %.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from frictus_hardware.arrays import ComplexArray, FloatArray
from frictus_service.discovery.evidence.bands import Bands
from frictus_service.discovery.evidence.sweep_speed import with_likeliest_speed
from frictus_service.identification.observation.response import Instrument, drive_fraction
from frictus_service.identification.observation.sweeps import Sweep, SweepThird
from frictus_service.identification.observation.through_mount import ThroughMount
from frictus_service.identification.observation.touch_path import path_of
from frictus_service.study.trial import StudyInfo, Trial

MOST_SKEWED: Final = 2.0
"""Skewness of a band that is told: beyond, it is one line and little else."""
LEAST_HZ: Final = 1.0
"""At 0 Hz a response may be none, of which there is no logarithm."""


@dataclass(frozen=True, slots=True)
class WindowSpectra:
    """Of one segment, instrument removed; arrays of shape (n_windows, n_frequencies).

    Attributes
    ----------
    segment : SweepThird
        It is of.
    message : ndarray of complex or None
        Drive fraction through the mount, as the force.
    force : ndarray of complex
        Along the motion, as the sensor has it.
    skin : ndarray of complex or None
        Skin velocity through the mount.
    message_mean : float
        Of the drive fraction; NaN without.
    message_power : ndarray, shape (n_frequencies,)
        Of the drive fraction itself, summed over windows.
    at_hz, variance_hz2 : ndarray, shape (n_frequencies,)
        Mean and variance of the frequencies of which each of the windows' has a part.
    speed_mm_s, speed_variance : ndarray, shape (n_frequencies,)
        Mean and variance (in mm²/s²) of the finger's speed while that was played: a texture's
        line is high while the finger is fast.
    """

    segment: SweepThird
    message: ComplexArray | None
    force: ComplexArray
    skin: ComplexArray | None
    message_mean: float
    message_power: FloatArray
    at_hz: FloatArray
    variance_hz2: FloatArray
    speed_mm_s: FloatArray
    speed_variance: FloatArray

    @property
    def known(self) -> ComplexArray:
        """What a response is seen through: the message, or the force where none drives."""
        return self.force if self.message is None else self.message

    @property
    def weights(self) -> tuple[FloatArray, FloatArray]:
        """By which frequencies weigh in friction ``S_mF / S_mm``, and in mobility, each (n,).

        Mobility is ``S_mv / S_mF``: where the message has much and the force makes little of
        it, there is little to see the mobility through.
        """
        of_friction = np.square(np.abs(self.known)).sum(axis=0)
        of_mobility = np.abs((self.known.conj() * self.force).sum(axis=0))
        return of_friction, of_mobility

    def place(self, bands: Bands, of: int) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return mean, standard deviation and skewness of the frequency of each band.

        Parameters
        ----------
        bands : Bands
            Of the windows.
        of : int
            0: for friction, 1: for mobility.

        Returns
        -------
        tuple of ndarray, shape (n_bands,)
        """
        weight = self.weights[of]
        centroid_hz = bands.mean(weight, self.at_hz)
        off_hz = self.at_hz - centroid_hz[bands.band]
        spread_hz = np.sqrt(bands.mean(weight, np.square(off_hz) + self.variance_hz2))
        third_hz3 = bands.mean(weight, off_hz * (np.square(off_hz) + 3.0 * self.variance_hz2))
        skewness = third_hz3 / np.maximum(spread_hz**3, np.finfo(float).tiny)
        return centroid_hz, spread_hz, np.clip(skewness, -MOST_SKEWED, MOST_SKEWED)

    def speed(self, bands: Bands) -> tuple[FloatArray, FloatArray]:
        """Return mean and standard deviation of the speed while each band was played.

        Parameters
        ----------
        bands : Bands
            Of the windows.

        Returns
        -------
        tuple of ndarray, shape (n_bands,)
        """
        weight = self.weights[0]
        mean_mm_s = bands.mean(weight, self.speed_mm_s)
        off_mm_s = self.speed_mm_s - mean_mm_s[bands.band]
        variance = bands.mean(weight, np.square(off_mm_s) + self.speed_variance)
        return mean_mm_s, np.sqrt(variance)

    def correction(self, through: ComplexArray, bands: Bands, of: int) -> ComplexArray:
        """Return by what a response is multiplied to have its instrument where it lies.

        Parameters
        ----------
        through : ndarray of complex, shape (n_frequencies,)
            By which it was divided, at the frequencies of the windows.
        bands : Bands
            Of the windows.
        of : int
            0: friction, 1: mobility.

        Returns
        -------
        ndarray of complex, shape (n_bands,)
        """
        taken_hz = bands.mean(self.weights[of], bands.frequency_hz)
        own_hz, *_ = self.place(bands, of)
        taken, own = (np.interp(hz, bands.frequency_hz, through) for hz in (taken_hz, own_hz))
        ratio: ComplexArray = taken / own
        return ratio


@dataclass(frozen=True, slots=True)
class Channels:
    """Of a whole trial; arrays of shape (n_samples, n_columns).

    Attributes
    ----------
    force : ndarray
        Lateral, as the sensor has it.
    drive, mounted_drive : ndarray or None
        Drive fraction, and the same through the mount.
    mounted_skin : ndarray or None
        What the skin's sensor says, through the mount.
    speed_mm_s : ndarray, shape (n_samples,)
        Of the finger; 0 where no reports say it.
    """

    force: FloatArray
    drive: FloatArray | None
    mounted_drive: FloatArray | None
    mounted_skin: FloatArray | None
    speed_mm_s: FloatArray

    @classmethod
    def of(cls, trial: Trial, study: StudyInfo, sweeps: Sequence[Sweep]) -> "Channels":
        """Return the channels of a trial.

        Parameters
        ----------
        trial : Trial
            As it was recorded.
        study : StudyInfo
            What holds for all trials: peak voltage and mount.
        sweeps : sequence of Sweep
            Of the finger in the trial.
        """

        def through(samples: FloatArray) -> FloatArray:
            return ThroughMount(study.mount, trial.info.sample_rate_hz).take(samples)

        skin, drive = trial.skin_velocity_m_s, None
        if trial.accel_m_s2 is not None:
            skin = trial.accel_m_s2[:, :2]
        if trial.voltage_v is not None:
            drive = drive_fraction(trial.voltage_v, study.screen_peak_v)[:, np.newaxis]
        reports, rate_hz = (trial.position_mm, trial.position_t_s), trial.info.sample_rate_hz
        return cls(
            trial.force_n[:, :2],
            drive,
            None if drive is None else through(drive),
            None if skin is None else through(skin.reshape(skin.shape[0], -1)),
            with_likeliest_speed(
                path_of(*reports, trial.force_n.shape[0], rate_hz), *reports, rate_hz, sweeps
            ),
        )


def spectra_of(
    channels: Channels,
    segment: SweepThird,
    rate_hz: float,
    window: int,
    bands: Bands,
    instrument: Instrument,
) -> WindowSpectra | None:
    """Return the spectra of a segment; None where it holds no window without gaps.

    Parameters
    ----------
    channels : Channels
        Of its trial.
    segment : SweepThird
        Part of a sweep.
    rate_hz : float
        Samples per second.
    window : int
        Samples of a window.
    bands : Bands
        Of such windows.
    instrument : Instrument
        At their frequencies, without the mount.
    """
    cut = slice(max(int(segment.begin_s * rate_hz), 0), int(segment.end_s * rate_hz))
    along = np.array(segment.along)
    lines = [channels.force[cut] @ along]
    skin, drive, mounted = channels.mounted_skin, channels.drive, channels.mounted_drive
    # A sensor that says nothing at all takes only what needs it.
    if skin is not None and not (drive is not None and np.isnan(skin[cut]).all()):
        lines.append(skin[cut] @ along if skin.shape[1] > 1 else skin[cut, 0] / along[0])
    has_skin = len(lines) > 1
    if drive is not None and mounted is not None:
        lines += [drive[cut, 0], mounted[cut, 0]]
    speed = channels.speed_mm_s[cut]
    if not np.all(speed > 0.0):
        speed = np.full(speed.size, segment.speed_mm_s)
    cut_up = _windows(np.stack([*lines, speed]), window)
    if not cut_up.shape[1]:
        return None
    cut_up, at_speed = cut_up[:-1], cut_up[-1]
    place = np.rint(bands.frequency_hz * window / rate_hz).astype(np.int64)
    # The message or, where none drives, the force.
    known = cut_up[0] if drive is None else cut_up[-1]
    cut_up = tapered(np.concatenate([cut_up, next_of(known)[np.newaxis]]))
    at_speed = cut_up[0 if drive is None else -2] * at_speed
    found = np.fft.rfft(np.concatenate([cut_up, at_speed[np.newaxis]]), axis=-1)[:, :, place]
    parts = _parts(found[0 if drive is None else -3], found[-2], found[-1], rate_hz, speed)
    force = found[0] / instrument.force
    velocity = found[1] * bands.passing / instrument.skin if has_skin else None
    if drive is None:
        nothing = np.zeros(place.size)
        return WindowSpectra(segment, None, force, velocity, np.nan, nothing, *parts)
    power = np.square(np.abs(found[-4] * instrument.drive)).sum(axis=0)
    message = found[-3] * instrument.drive * bands.passing
    mean = float(np.nanmean(lines[-2]))
    return WindowSpectra(segment, message, force, velocity, mean, power, *parts)


def _parts(
    known: ComplexArray,
    following: ComplexArray,
    at_speed: ComplexArray,
    rate_hz: float,
    speed_mm_s: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return mean and variance of the frequencies of what is known, and of the speed, (n,).

    `following` is what is known a sample later (`next_of`), `at_speed` what is known times the
    speed. Frequencies that differ turn apart: what is left of the sum tells their variance.
    """
    least = np.finfo(float).tiny
    power, later = (
        np.maximum(np.square(np.abs(each)).sum(axis=0), least) for each in (known, following)
    )
    turned = (known.conj() * following).sum(axis=0)
    together = np.clip(np.abs(turned) / (np.sqrt(power) * np.sqrt(later)), least, 1.0)
    variance_hz2 = -2.0 * np.log(together) * (rate_hz / (2.0 * np.pi)) ** 2
    mean_mm_s = (known.conj() * at_speed).real.sum(axis=0) / power
    at_mm_s = np.clip(mean_mm_s, speed_mm_s.min(), speed_mm_s.max())
    square = np.square(np.abs(at_speed)).sum(axis=0) / power
    most = np.square((speed_mm_s.max() - speed_mm_s.min()) / 2.0)
    variance = np.clip(square - np.square(mean_mm_s), 0.0, most)
    return frequency_hz(turned, rate_hz), variance_hz2, at_mm_s, variance


def next_of(windows: FloatArray) -> FloatArray:
    """Return what follows each sample of windows, to be tapered as they are.

    Parameters
    ----------
    windows : ndarray, shape (..., n_samples)
        The last is followed by the first, where the taper is zero.
    """
    following: FloatArray = np.roll(windows, -1, axis=-1)
    return following


def frequency_hz(turned: ComplexArray, rate_hz: float) -> FloatArray:
    """Return the mean frequency of what turns so far from one sample to the next, (n,).

    Parameters
    ----------
    turned : ndarray of complex, shape (n,)
        Sums of the conjugate of spectra times those of what follows each sample; noise alone
        turns by anything.
    rate_hz : float
        Samples per second.
    """
    mean: FloatArray = np.angle(turned) * rate_hz / (2.0 * np.pi)
    return np.maximum(mean, LEAST_HZ)


def _windows(channels: FloatArray, window: int) -> FloatArray:
    """Return the half overlapping windows without gaps, (n_channels, n_windows, window)."""
    if channels.shape[1] < window:
        return np.empty((channels.shape[0], 0, window))
    cut = sliding_window_view(channels, window, axis=1)[:, :: window // 2]
    whole: FloatArray = cut[:, np.isfinite(cut).all(axis=(0, 2))]
    return whole


def tapered(windows: FloatArray) -> FloatArray:
    """Return windows without their straight lines, times Hann's, of unit power.

    Parameters
    ----------
    windows : ndarray, shape (..., n_samples)
    """
    line, hann = _line_and_hann(windows.shape[-1])
    level = windows.mean(axis=-1, keepdims=True)
    slope = (windows @ line / (line @ line))[..., np.newaxis]
    tapered: FloatArray = (windows - level - slope * line) * hann / np.sqrt(hann @ hann)
    return tapered


@lru_cache(maxsize=4)
def _line_and_hann(length: int) -> tuple[FloatArray, FloatArray]:
    hann = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(length) / length)
    return np.linspace(-1.0, 1.0, length), hann

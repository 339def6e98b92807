"""What one trial says: responses at its tones, friction to drive and velocity to friction."""

import math
from dataclasses import dataclass, replace

import numpy as np

from frictus_hardware.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from frictus_service.identification.observation.blocks import BLOCK
from frictus_service.identification.observation.standing import longest_hold_s, stands
from frictus_service.identification.observation.sweeps import SweepThird
from frictus_service.identification.observation.tones import Tones, fit
from frictus_service.study.trial import StudyInfo, Trial, TrialInfo


@dataclass(frozen=True, slots=True)
class ResponseRows:
    """One row per sweep, third of the stroke and tone; arrays of shape (n_rows,).

    Attributes
    ----------
    sweep : ndarray of int
        Number of the sweep in its trial, from 0, in time.
    direction : ndarray of int
        +1 left to right, -1 right to left.
    third : ndarray of int
        0, 1, 2 from the left of the screen to the right.
    speed_mm_s, normal_force_n : ndarray
        Measured means over the segment; the speed without sign.
    position_mm : ndarray
        Middle of the segment on the screen, x.
    tone_hz : ndarray
        Of each row.
    message : ndarray of complex
        Amplitude of the drive fraction at the tone, by least squares on 2 V² / V_pk².
    friction_response : ndarray of complex
        N per unit of drive fraction at the screen: mount, hold and declared skew removed.
    friction_variance : ndarray
        Of its real and of its imaginary part each, from the noise around the tone.
    mobility : ndarray of complex
        Skin velocity per newton of friction on the finger, m/s/N, mount removed; NaN where
        nothing measures the skin.
    mobility_variance : ndarray
        As `friction_variance`.
    """

    sweep: IntArray
    direction: IntArray
    third: IntArray
    speed_mm_s: FloatArray
    normal_force_n: FloatArray
    position_mm: FloatArray
    tone_hz: FloatArray
    message: ComplexArray
    friction_response: ComplexArray
    friction_variance: FloatArray
    mobility: ComplexArray
    mobility_variance: FloatArray


@dataclass(frozen=True, slots=True)
class TrialObservations:
    """What one trial says, and what is wrong with it.

    Attributes
    ----------
    info : TrialInfo
        What was asked of the trial.
    sha256 : str
        Of the trial.
    valid : bool
        Whether it may be used for estimates.
    reasons : tuple of str
        Why not; one sentence each, with figures.
    notes : tuple of str
        What a reader should know of a trial that is used: missing samples and the like.
    mean_speed_mm_s, mean_force_n : float
        Over the sweeps; NaN where nothing was measured.
    rows : ResponseRows
        Empty where there was no drive, or no sweep.
    measured_sha256 : str
        Of the data sets alone: a copy has the same, whatever its attributes are.
    """

    info: TrialInfo
    sha256: str
    valid: bool
    reasons: tuple[str, ...]
    notes: tuple[str, ...]
    mean_speed_mm_s: float
    mean_force_n: float
    rows: ResponseRows
    measured_sha256: str = ""

    def without_mobility(self) -> "TrialObservations":
        """Return what the trial says of friction alone."""
        unknown = np.full(self.rows.mobility.shape, np.nan)
        rows = replace(self.rows, mobility=unknown + 0j, mobility_variance=unknown)
        return replace(self, rows=rows)


def drive_fraction(voltage_v: FloatArray, screen_peak_v: float) -> FloatArray:
    """Return ``2 V² / V_pk²``: the drive fraction, and the carrier's line far above the tones.

    The amplitude of the message comes from this and not from a sideband of the voltage, which
    holds 0.60 of it and grows with its square root.

    Parameters
    ----------
    voltage_v : ndarray, shape (n_samples,)
    screen_peak_v : float
        Screen volts at a drive fraction of 1.
    """
    fraction: FloatArray = np.square(voltage_v * (np.sqrt(2.0) / screen_peak_v))
    return fraction


def hold(frequency_hz: FloatArray, sample_rate_hz: float) -> ComplexArray:
    """Return the response of a DAC that holds each sample until the next.

    Parameters
    ----------
    frequency_hz : ndarray
        Where it is evaluated.
    sample_rate_hz : float
        Samples per second of the device's clock.
    """
    cycles = np.asarray(frequency_hz) / sample_rate_hz
    return np.asarray(np.sinc(cycles) * np.exp(-1j * np.pi * cycles), np.complex128)


def advance(frequency_hz: FloatArray, skew_s: float) -> ComplexArray:
    """Return the response of a sensor that samples so much later than it says.

    Parameters
    ----------
    frequency_hz : ndarray
        Where it is evaluated.
    skew_s : float
        Seconds, positive where it samples later.
    """
    response: ComplexArray = np.exp(2j * np.pi * np.asarray(frequency_hz) * skew_s)
    return response


def channels_of(trial: Trial, study: StudyInfo) -> list[FloatArray]:
    """Return message, force and, where it is measured, skin of a driven trial.

    Parameters
    ----------
    trial : Trial
        With `voltage_v`.
    study : StudyInfo

    Returns
    -------
    list of ndarray, shape (n_samples, n_columns)
        The message; force along x and y; acceleration along x and y, or the skin's velocity
        along x.
    """
    assert trial.voltage_v is not None
    message = drive_fraction(trial.voltage_v, study.screen_peak_v)
    channels = [message[:, np.newaxis], trial.force_n[:, :2]]
    if trial.accel_m_s2 is not None:
        channels.append(trial.accel_m_s2[:, :2])
    elif trial.skin_velocity_m_s is not None:
        channels.append(trial.skin_velocity_m_s[:, np.newaxis])
    return channels


@dataclass(frozen=True, slots=True)
class Instrument:
    """What stands between physics and samples at some frequencies; arrays of shape (n,).

    Attributes
    ----------
    drive : ndarray of complex
        The held DAC.
    force : ndarray of complex
        Mount and skew of the force.
    skin : ndarray of complex
        From skin velocity to the sensor: its skew, and the derivative where it is an
        accelerometer.
    """

    drive: ComplexArray
    force: ComplexArray
    skin: ComplexArray

    @classmethod
    def of(cls, trial: Trial, study: StudyInfo, frequency_hz: FloatArray) -> "Instrument":
        """Return the instrument that a trial was measured with.

        Parameters
        ----------
        trial : Trial
            As it was recorded.
        study : StudyInfo
            What holds for all trials: carrier, peak voltage, mount.
        frequency_hz : ndarray, shape (n,)
        """
        force = advance(frequency_hz, trial.force_skew_s)
        if study.mount is not None:
            force = force * study.mount.frequency_response(frequency_hz)
        skin = advance(frequency_hz, trial.skin_skew_s)
        if trial.accel_m_s2 is not None:
            skin = skin * 2j * np.pi * frequency_hz
        return cls(hold(frequency_hz, trial.info.sample_rate_hz), force, skin)


@dataclass(frozen=True, slots=True)
class WholeBlocks:
    """A segment in whole blocks of samples, the last one excluded."""

    segment: SweepThird
    first: int
    last: int


def rows_of(
    trial: Trial, study: StudyInfo, segments: list[SweepThird], normal_n: FloatArray
) -> tuple[ResponseRows, list[str]]:
    """Return one row per segment and tone, and what was left out.

    Parameters
    ----------
    trial : Trial
        As it was recorded.
    study : StudyInfo
        What holds for all trials: carrier, peak voltage, mount.
    segments : list of SweepThird
        Parts of sweeps in thirds of the stroke.
    normal_n : ndarray, shape (n_blocks,)
        Mean normal force of each block of samples; NaN where it is missing.
    """
    rate_hz = trial.info.sample_rate_hz
    if trial.voltage_v is None or not trial.info.tones_hz:
        return NO_ROWS, []
    tones = Tones(trial.info.tones_hz, rate_hz)
    pieces = [whole_blocks(segment, rate_hz, normal_n.size) for segment in segments]
    least = tones.least_s * rate_hz / BLOCK
    short = [piece.segment for piece in pieces if piece.last - piece.first < least]
    pieces = [piece for piece in pieces if piece.last - piece.first >= least]
    notes = []
    if short:
        longest = max(segment.end_s - segment.begin_s for segment in short)
        notes.append(
            f"{_seconds(short):.2f} s in {len(short)} thirds of sweeps are too short for a "
            f"tone of {min(tones.tones_hz):g} Hz (the longest lasts {longest:.2f} s, needed "
            f"are {tones.least_s:.2f} s: stroke farther or more slowly) and were left out"
        )
    if not pieces:
        return NO_ROWS, notes
    amplitude, variance = _fit_all(trial, study, tones, pieces)
    usable = np.all(np.isfinite(amplitude[:, :2]) & (amplitude[:, :2] != 0.0), axis=(1, 2))
    held = longest_hold_s(tones.tones_hz) * rate_hz

    def standing(samples: FloatArray) -> BoolArray:
        return np.array(
            [stands(samples[p.first * BLOCK : p.last * BLOCK], held) for p in pieces]
        )

    usable &= ~standing(trial.force_n[:, 0])
    if amplitude.shape[1] > 2:
        skin = trial.skin_velocity_m_s if trial.accel_m_s2 is None else trial.accel_m_s2[:, 0]
        assert skin is not None
        dead = standing(skin)
        amplitude[dead, 2] = variance[dead, 2] = np.nan
        if dead.any():
            notes.append(
                f"the skin's sensor stands still in {int(dead.sum())} thirds of sweeps, which "
                "say nothing of mobility"
            )
    if not usable.all():
        missing = [p.segment for p, used in zip(pieces, usable, strict=True) if not used]
        notes.append(
            f"{_seconds(missing):.2f} s in {len(missing)} thirds of sweeps lack their drive, "
            "or more than a fifth of their voltage or force samples, or have a force that "
            "stands still, and were left out"
        )
    kept = [piece for piece, used in zip(pieces, usable, strict=True) if used]
    normal = [_mean(normal_n[piece.first : piece.last]) for piece in kept]
    instrument = Instrument.of(trial, study, np.array(tones.tones_hz))
    return _rows(kept, normal, tones, instrument, amplitude[usable], variance[usable]), notes


def whole_blocks(segment: SweepThird, rate_hz: float, blocks: int) -> WholeBlocks:
    """Return a segment's blocks.

    Parameters
    ----------
    segment : SweepThird
        Part of a sweep in one third of the stroke.
    rate_hz : float
        Of samples.
    blocks : int
        In the trial.
    """
    first = math.ceil(segment.begin_s * rate_hz / BLOCK)
    last = min(int(segment.end_s * rate_hz / BLOCK), blocks)
    return WholeBlocks(segment, first, max(first, last))


def _fit_all(
    trial: Trial, study: StudyInfo, tones: Tones, pieces: list[WholeBlocks]
) -> tuple[ComplexArray, FloatArray]:
    """Return amplitudes and their variances, (n_pieces, n_channels, n_tones)."""
    channels = tones.reduce(channels_of(trial, study))
    found = []
    for piece in pieces:
        weights = projections(piece.segment, channels.columns)
        found.append(fit(tones, channels, weights, piece.first, piece.last))
    return np.stack([f.amplitude for f in found]), np.stack([f.variance for f in found])


def projections(segment: SweepThird, columns: tuple[int, ...]) -> list[tuple[float, ...]]:
    """Return the projection on the motion of each channel that `channels_of` gives.

    Parameters
    ----------
    segment : SweepThird
        Part of a sweep in one third of the stroke.
    columns : tuple of int
        How many columns each channel has; those at the end may be left out.
    """
    along = segment.along
    of_skin = along if columns[2:] == (2,) else (1.0 / along[0],)
    return [(1.0,), along, of_skin][: len(columns)]


def _rows(
    kept: list[WholeBlocks],
    normal_n: list[float],
    tones: Tones,
    instrument: Instrument,
    amplitude: ComplexArray,
    variance: FloatArray,
) -> ResponseRows:
    """Return the responses.

    The sensor under the screen reports the force of the finger on it, so that along the motion
    friction is positive; the finger feels its opposite, and so does the skin.
    """
    driven = amplitude[:, 0] * instrument.drive
    friction = amplitude[:, 1] / instrument.force
    friction_variance = variance[:, 1] / np.square(np.abs(instrument.force))
    mobility = np.full(friction.shape, complex(np.nan, np.nan))
    mobility_variance = np.full(friction.shape, np.nan)
    if amplitude.shape[1] > 2:
        strength = np.square(np.abs(friction))
        with np.errstate(invalid="ignore"):  # NaN where samples of the skin are missing
            mobility = -amplitude[:, 2] / instrument.skin / friction
            mobility_variance = variance[:, 2] / np.square(np.abs(instrument.skin)) / strength
            mobility_variance += np.square(np.abs(mobility)) * friction_variance / strength
    count = len(tones.tones_hz)
    segments = [piece.segment for piece in kept]
    return ResponseRows(
        sweep=np.repeat(np.array([s.sweep for s in segments], dtype=np.int64), count),
        direction=np.repeat(np.array([s.direction for s in segments], dtype=np.int64), count),
        third=np.repeat(np.array([s.third for s in segments], dtype=np.int64), count),
        speed_mm_s=np.repeat(np.array([s.speed_mm_s for s in segments]), count),
        normal_force_n=np.repeat(np.array(normal_n), count),
        position_mm=np.repeat(np.array([s.position_mm for s in segments]), count),
        tone_hz=np.tile(np.array(tones.tones_hz), len(kept)),
        message=amplitude[:, 0].ravel(),
        friction_response=(friction / driven).ravel(),
        friction_variance=(friction_variance / np.square(np.abs(driven))).ravel(),
        mobility=mobility.ravel(),
        mobility_variance=mobility_variance.ravel(),
    )


def _mean(normal_n: FloatArray) -> float:
    measured = normal_n[np.isfinite(normal_n)]
    return float(measured.mean()) if measured.size else np.nan


def _seconds(segments: list[SweepThird]) -> float:
    return sum(segment.end_s - segment.begin_s for segment in segments)


NO_ROWS = ResponseRows(
    sweep=np.empty(0, dtype=np.int64),
    direction=np.empty(0, dtype=np.int64),
    third=np.empty(0, dtype=np.int64),
    speed_mm_s=np.empty(0),
    normal_force_n=np.empty(0),
    position_mm=np.empty(0),
    tone_hz=np.empty(0),
    message=np.empty(0, dtype=np.complex128),
    friction_response=np.empty(0, dtype=np.complex128),
    friction_variance=np.empty(0),
    mobility=np.empty(0, dtype=np.complex128),
    mobility_variance=np.empty(0),
)

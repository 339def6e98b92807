"""What the friction of a trial holds besides the answer at its tones.

Harmonics of the tones, mains lines, power at low frequencies; from every third of every sweep,
also of blank trials.
"""

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from frictus_hardware.arrays import ComplexArray, FloatArray, IntArray
from frictus_service.discovery.evidence.background import Backdrop, Lines, lines_of, low_power
from frictus_service.identification.observation.blocks import BLOCK, BlockSums
from frictus_service.identification.observation.observe import FingerTrajectory
from frictus_service.identification.observation.response import (
    Instrument,
    ResponseRows,
    WholeBlocks,
    channels_of,
    projections,
    whole_blocks,
)
from frictus_service.identification.observation.tones import Amplitudes, fit
from frictus_service.study.trial import StudyInfo, Trial

IN_MESSAGE: Final = 1e-4
"""Share of the tone: a stronger harmonic of the message itself says nothing of the finger."""
SURE: Final = 4.0
"""Standard errors by which it must exceed that."""
SETTLED_S: Final = 0.1
"""Of a trial, left out: what the beginning of the drive excites in the mount rings for long."""
MOST_PAUSE_S: Final = 1.0
"""Between neighbours: the mains is off by 0.05 Hz, and by more than that for moments only."""
NOTHING: Final = complex(np.nan, np.nan)


@dataclass(frozen=True, slots=True)
class HarmonicResponse:
    """What the tones make besides their answers, an entry per row; arrays of shape (n_rows,).

    Attributes
    ----------
    message_mean : ndarray
        Mean of the drive fraction over the segment, tones taken out.
    message_power : ndarray
        Sum over all tones of half the square of the drive fraction's amplitude.
    second, third : ndarray of complex
        Friction at twice and at three times the tone over that at the tone, mount and skew
        removed, with the message's phase (once, twice; hold included) taken out: a square that
        acts at once gives a constant. NaN where it cannot be told from something else.
    second_variance, third_variance : ndarray
        Of real and of imaginary part each, from the noise around the lines.
    centroid_hz, spread_hz, skewness : ndarray
        Mean, standard deviation and skewness of the frequency over what the friction response
        of a row is weighed by: of a band its power; of a tone its frequency, 0 and 0.
    mobility_centroid_hz, mobility_spread_hz, mobility_skewness : ndarray
        The same of the mobility, which is weighed by what the force has of that.
    speed_spread_mm_s : ndarray
        Standard deviation of the speed while a band was measured; 0 of a tone.
    """

    message_mean: FloatArray
    message_power: FloatArray
    second: ComplexArray
    second_variance: FloatArray
    third: ComplexArray
    third_variance: FloatArray
    centroid_hz: FloatArray
    spread_hz: FloatArray
    skewness: FloatArray
    mobility_centroid_hz: FloatArray
    mobility_spread_hz: FloatArray
    mobility_skewness: FloatArray
    speed_spread_mm_s: FloatArray


@dataclass(frozen=True, slots=True)
class Stretches:
    """What does not follow the drive, one entry per third of a sweep; shape (n_stretches,).

    All of it is the friction as the sensor reports it, mount included, along the motion.

    Attributes
    ----------
    sweep, direction, third : ndarray of int
        Where it was.
    speed_mm_s, normal_force_n, position_mm, seconds : ndarray
        As in `ResponseRows`; the length.
    line50_n2, line60_n2 : ndarray
        Power at 50 and 60 Hz of what goes on from a stretch to its neighbours with one phase,
        so that no line, or one that follows the finger, gives zero on average; NaN within 8 Hz
        of a tone, and where the stretch is too short or has no neighbour.
    line50_variance, line60_variance : ndarray
        Of that, were there noise alone.
    low_n2 : ndarray
        Power from 4 to 30 Hz, noise included, trend and tones taken out; NaN in stretches
        shorter than 0.35 s.
    low_variance : ndarray
        Of that, were it Gaussian noise: it goes with its square, so that ln `low_n2` has the
        variance `low_variance / low_n2**2`, which is known before.
    """

    sweep: IntArray
    direction: IntArray
    third: IntArray
    speed_mm_s: FloatArray
    normal_force_n: FloatArray
    position_mm: FloatArray
    seconds: FloatArray
    line50_n2: FloatArray
    line50_variance: FloatArray
    line60_n2: FloatArray
    line60_variance: FloatArray
    low_n2: FloatArray
    low_variance: FloatArray


def spectra_of(
    trial: Trial, study: StudyInfo, course: FingerTrajectory, rows: ResponseRows
) -> tuple[HarmonicResponse, Stretches]:
    """Return harmonics, an entry per row, and stretches, an entry per third of a sweep.

    Parameters
    ----------
    trial : Trial
        As it was recorded.
    study : StudyInfo
        Its mount, its carrier and its screen voltage are used.
    course : FingerTrajectory
        Of the finger in the trial.
    rows : ResponseRows
        Of the trial's observations: the tones of a stretch in turn; some stretches have none.
    """
    info = trial.info
    driven = rows.tone_hz.size > 0
    lines = lines_of(info.tones_hz if driven else (), study.carrier_hz, info.sample_rate_hz)
    samples = channels_of(trial, study)[:2] if driven else [trial.force_n[:, :2]]
    channels = lines.tones.reduce(samples)
    whole = [
        whole_blocks(segment, info.sample_rate_hz, channels.n_blocks)
        for segment in course.segments
    ]
    settled = math.ceil(SETTLED_S * info.sample_rate_hz / BLOCK)
    pieces = [_later(piece, settled) for piece in whole]
    fitted = [_fit(lines, channels, piece) for piece in pieces]
    backdrop = Backdrop.of(lines.tones, channels.n_blocks)
    stretches = _stretches(lines, channels, backdrop, pieces, fitted, course.normal_n)
    if not driven:
        return NO_HARMONICS, stretches
    place = {(s.sweep, s.third): number for number, s in enumerate(course.segments)}
    keys = zip(rows.sweep.tolist(), rows.third.tolist(), strict=True)
    stretch = np.array([place[key] for key in keys])[:: lines.n_tones]
    mean, power = _message(lines, channels, backdrop, [whole[at] for at in stretch], rows)
    ratios = _ratios(trial, study, lines, [fitted[at] for at in stretch])
    tone_hz, none = rows.tone_hz, np.zeros(rows.tone_hz.size)
    alone = (tone_hz, none, none)
    found = HarmonicResponse(mean, power, *ratios[0], *ratios[1], *alone, *alone, none)
    return found, stretches


def _later(piece: WholeBlocks, settled: int) -> WholeBlocks:
    """Return what of a piece lies after so many blocks."""
    first = max(piece.first, settled)
    return replace(piece, first=first, last=max(piece.last, first))


def _fit(lines: Lines, channels: BlockSums, piece: WholeBlocks) -> Amplitudes:
    """Return the amplitudes of the lines, NaN in a piece that is too short for them."""
    seconds = (piece.last - piece.first) * BLOCK / lines.tones.sample_rate_hz
    if seconds < lines.tones.least_s:
        shape = (len(channels.columns), len(lines.tones.tones_hz))
        return Amplitudes(np.full(shape, NOTHING), np.full(shape, np.nan))
    weights = _weights(piece, channels)
    return fit(lines.tones, channels, weights, piece.first, piece.last)


def _weights(piece: WholeBlocks, channels: BlockSums) -> list[tuple[float, ...]]:
    """Return the weights of message and force, or of the force alone."""
    return projections(piece.segment, (1, 2))[2 - len(channels.columns) :]


def _message(
    lines: Lines,
    channels: BlockSums,
    backdrop: Backdrop,
    pieces: list[WholeBlocks],
    rows: ResponseRows,
) -> tuple[FloatArray, FloatArray]:
    """Return mean and power of the message in each row."""
    count = lines.n_tones
    known = rows.message.reshape(-1, count)
    amplitude = np.zeros((known.shape[0], len(lines.tones.tones_hz)), dtype=np.complex128)
    amplitude[:, :count] = known
    mean = [
        _mean(*backdrop.left_of(channels, 0, (1.0,), each, piece))
        for piece, each in zip(pieces, amplitude, strict=True)
    ]
    power = np.square(np.abs(known)).sum(axis=1) / 2.0
    return np.repeat(np.array(mean), count), np.repeat(power, count)


def _ratios(
    trial: Trial, study: StudyInfo, lines: Lines, fitted: list[Amplitudes]
) -> list[tuple[ComplexArray, FloatArray]]:
    """Return, of either order, harmonics and their variances in each row."""
    count = lines.n_tones
    amplitude = np.stack([each.amplitude for each in fitted])  # (n_stretches, 2, n_lines)
    variance = np.stack([each.variance for each in fitted])
    instrument = Instrument.of(trial, study, np.array(lines.tones.tones_hz))
    message = amplitude[:, 0]
    friction = amplitude[:, 1] / instrument.force
    friction_variance = variance[:, 1] / np.square(np.abs(instrument.force))
    driven = message[:, :count] * instrument.drive[:count]
    found: list[tuple[ComplexArray, FloatArray]] = []
    with np.errstate(invalid="ignore", divide="ignore"):  # NaN in stretches that are too short
        turn = driven / np.abs(driven)
        base = np.square(np.abs(friction[:, :count]))
        for turns, places in enumerate(lines.harmonics, 1):
            ratio = friction[:, places] / (friction[:, :count] * turn**turns)
            spread = friction_variance[:, places] / base
            spread += np.square(np.abs(ratio)) * friction_variance[:, :count] / base
            in_message = np.abs(message[:, places]) - SURE * np.sqrt(variance[:, 0, places])
            own = in_message > IN_MESSAGE * np.abs(message[:, :count])
            own |= places < 0
            ratio[own], spread[own] = NOTHING, np.nan
            found.append((ratio.ravel(), spread.ravel()))
    return found


def _mean(total: FloatArray, count: FloatArray) -> float:
    return float(total.sum() / count.sum()) if count.any() else np.nan


def _stretches(
    lines: Lines,
    channels: BlockSums,
    backdrop: Backdrop,
    pieces: list[WholeBlocks],
    fitted: list[Amplitudes],
    normal_n: FloatArray,
) -> Stretches:
    segments = [piece.segment for piece in pieces]
    seconds = np.array([segment.end_s - segment.begin_s for segment in segments])
    line50, line60 = (_mains(lines, place, pieces, fitted) for place in lines.mains)
    low = np.array(
        [
            _low(lines, channels, backdrop, piece, each)
            for piece, each in zip(pieces, fitted, strict=True)
        ]
    ).reshape(-1, 2)
    normal = [normal_n[piece.first : piece.last] for piece in pieces]
    return Stretches(
        sweep=np.array([s.sweep for s in segments], dtype=np.int64),
        direction=np.array([s.direction for s in segments], dtype=np.int64),
        third=np.array([s.third for s in segments], dtype=np.int64),
        speed_mm_s=np.array([s.speed_mm_s for s in segments]),
        normal_force_n=np.array([_mean(np.nan_to_num(n), np.isfinite(n)) for n in normal]),
        position_mm=np.array([s.position_mm for s in segments]),
        seconds=seconds,
        line50_n2=line50[:, 0],
        line50_variance=line50[:, 1],
        line60_n2=line60[:, 0],
        line60_variance=line60[:, 1],
        low_n2=low[:, 0],
        low_variance=low[:, 1],
    )


def _mains(
    lines: Lines, place: int, pieces: list[WholeBlocks], fitted: list[Amplitudes]
) -> FloatArray:
    """Return a mains line's power and its variance in noise alone, (n_pieces, 2).

    The mains goes on from one stretch to the next, whatever the finger does; a line of stick
    and slip, which follows the path, begins each with another phase. So the power is that of a
    stretch with its neighbours in time: half the real part of the product of one amplitude and
    the conjugate of the other, to which noise adds nothing on average (a cross-spectrum;
    Bendat and Piersol, Random Data, chapter 5).
    """
    found = np.full((len(pieces), 2), np.nan)
    if place < 0:
        return found
    line_n = np.array([each.amplitude[-1, place] for each in fitted])
    noise = np.array([each.variance[-1, place] for each in fitted])
    begin, end = (
        np.array([getattr(piece, of) for piece in pieces]) for of in ("first", "last")
    )
    known = np.flatnonzero(np.isfinite(line_n))
    known = known[np.argsort(begin[known])]
    one, next_ = known[:-1], known[1:]
    near = (begin[next_] - end[one]) * BLOCK <= MOST_PAUSE_S * lines.tones.sample_rate_hz
    one, next_ = one[near], next_[near]
    total, count = np.zeros(found.shape), np.zeros((len(pieces), 1))
    along = np.array([piece.segment.along for piece in pieces]).reshape(-1, 2)
    turned = np.sign(np.sum(along[one] * along[next_], axis=1))  # amplitudes are along motion
    together = turned * (line_n[one] * line_n[next_].conj()).real / 2.0
    pairs = np.column_stack([together, noise[one] * noise[next_] / 2.0])
    for ends in (one, next_):
        np.add.at(total, ends, pairs)
        np.add.at(count, ends, 1.0)
    told = count[:, 0] > 0.0
    found[told] = total[told] / count[told]
    found[told, 1] /= count[told, 0]
    return found


def _low(
    lines: Lines,
    channels: BlockSums,
    backdrop: Backdrop,
    piece: WholeBlocks,
    fitted: Amplitudes,
) -> tuple[float, float]:
    amplitude = fitted.amplitude[-1]
    if not np.isfinite(amplitude).all():
        return np.nan, np.nan
    force = len(channels.columns) - 1
    weights = _weights(piece, channels)[-1]
    left, count = backdrop.left_of(channels, force, weights, amplitude, piece)
    lines_hz = np.array(lines.tones.tones_hz)
    return low_power(left, count, lines_hz, lines.tones.sample_rate_hz)


NO_HARMONICS: Final = HarmonicResponse(
    message_mean=np.empty(0),
    message_power=np.empty(0),
    second=np.empty(0, dtype=np.complex128),
    second_variance=np.empty(0),
    third=np.empty(0, dtype=np.complex128),
    third_variance=np.empty(0),
    centroid_hz=np.empty(0),
    spread_hz=np.empty(0),
    skewness=np.empty(0),
    mobility_centroid_hz=np.empty(0),
    mobility_spread_hz=np.empty(0),
    mobility_skewness=np.empty(0),
    speed_spread_mm_s=np.empty(0),
)
NO_STRETCHES: Final = Stretches(
    sweep=np.empty(0, dtype=np.int64),
    direction=np.empty(0, dtype=np.int64),
    third=np.empty(0, dtype=np.int64),
    speed_mm_s=np.empty(0),
    normal_force_n=np.empty(0),
    position_mm=np.empty(0),
    seconds=np.empty(0),
    line50_n2=np.empty(0),
    line50_variance=np.empty(0),
    line60_n2=np.empty(0),
    line60_variance=np.empty(0),
    low_n2=np.empty(0),
    low_variance=np.empty(0),
)

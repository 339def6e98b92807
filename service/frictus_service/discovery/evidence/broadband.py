"""Responses of trials that name no tones, from averaged cross-spectra.

Noise or a texture as message, or no message at all. Windows of a tenth of a second, half
overlapping, within each third of each sweep; all windows and all frequencies of a sixth of an
octave are averaged. With a message m, friction is ``S_mF / S_mm`` (H1) and mobility
``S_mv / S_mF``: noise of force and skin averages out. Without, mobility is ``S_Fv / S_FF``,
which noise of the force makes too small by a share of one minus the coherence at most: bands
are left out of a stretch where it is below nine tenths.

Bendat and Piersol, Random Data, chapters 6 and 9: H1, its variance, chance coherence. Welch
1967: overlapping windows.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Final

import numpy as np

from frictus_hardware.arrays import BoolArray, ComplexArray, FloatArray
from frictus_service.discovery.evidence.bands import WINDOW_S, Bands
from frictus_service.discovery.evidence.spectra import NO_HARMONICS, NOTHING, HarmonicResponse
from frictus_service.discovery.evidence.window_spectra import (
    Channels,
    WindowSpectra,
    spectra_of,
)
from frictus_service.identification.observation.blocks import BLOCK
from frictus_service.identification.observation.images import without_images
from frictus_service.identification.observation.observe import FingerTrajectory
from frictus_service.identification.observation.response import (
    NO_ROWS,
    Instrument,
    ResponseRows,
)
from frictus_service.identification.observation.sweeps import SweepThird
from frictus_service.identification.observation.validity import LEAST_DRIVE
from frictus_service.study.trial import StudyInfo, Trial

CHANCE: Final = 1e-3
"""A band is used in which noise alone would be as coherent over the trial less often,"""
LEAST_OF_FORCE: Final = 0.9
"""and, where no message drives, in the stretch at least so coherent: what is missing may be
bias."""


@dataclass(frozen=True, slots=True)
class _Transfer:
    """A response and its variance per component; arrays of shape (n_bands,)."""

    response: ComplexArray
    variance: FloatArray

    def times(self, factor: ComplexArray) -> "_Transfer":
        return _Transfer(self.response * factor, self.variance * np.square(np.abs(factor)))


@dataclass(frozen=True, slots=True)
class Broadband:
    """What a trial without tones says.

    Attributes
    ----------
    rows : ResponseRows
        One per third of a sweep and band, `tone_hz` the band's mean frequency and `message` the
        amplitude of a tone of its power; friction NaN without a message.
    harmonics : HarmonicResponse
        Mean and power of the message; no harmonics.
    notes : tuple of str
        How strong the evidence is.
    """

    rows: ResponseRows
    harmonics: HarmonicResponse
    notes: tuple[str, ...]


def broadband(trial: Trial, study: StudyInfo, course: FingerTrajectory) -> Broadband:
    """Return the responses of a trial that names no tones.

    Parameters
    ----------
    trial : Trial
        As it was recorded.
    study : StudyInfo
        What holds for all trials: carrier, peak voltage, mount.
    course : FingerTrajectory
        Of the finger in the trial.
    """
    rate_hz = trial.info.sample_rate_hz
    window = 2 * round(WINDOW_S * rate_hz / 2.0)
    bands = Bands.of(window, rate_hz, study.mount)
    instrument = Instrument.of(trial, replace(study, mount=None), bands.frequency_hz)
    channels = Channels.of(trial, study, course.sweeps)
    every = [
        spectra_of(channels, segment, rate_hz, window, bands, instrument)
        for segment in course.segments
    ]
    spectra = [each for each in every if each is not None]
    if not spectra or (spectra[0].message is None and spectra[0].skin is None):
        return Broadband(NO_ROWS, NO_HARMONICS, _nothing(course.segments, bool(spectra)))
    coherence = _coherence(spectra, bands)
    used: BoolArray = np.tile(coherence > _by_chance(spectra, bands), (len(spectra), 1))
    if spectra[0].message is None:
        for each, kept in zip(spectra, used, strict=True):
            kept &= _coherence([each], bands) > np.maximum(
                _by_chance([each], bands), LEAST_OF_FORCE
            )
    drives = spectra[0].message is None or _amplitude(spectra, window) >= LEAST_DRIVE
    notes = _notes(spectra, coherence, np.any(used, axis=0), len(every), drives=drives)
    if not used.any():
        return Broadband(NO_ROWS, NO_HARMONICS, notes)
    rows = [
        _rows(each, bands, instrument, kept, course.normal_n, rate_hz, window)
        for each, kept in zip(spectra, used, strict=True)
    ]
    whole = ResponseRows(
        **{
            f.name: np.concatenate([getattr(r, f.name) for r in rows])
            for f in fields(ResponseRows)
        }
    )
    if spectra[0].message is not None:  # what is not driven is not held
        whole = without_images(whole, trial, study)
    return Broadband(whole, _message(spectra, rows, bands, used), notes)


def _coherence(spectra: Sequence[WindowSpectra], bands: Bands) -> FloatArray:
    """Return the coherence over the trial, of message and force, or of force and skin."""
    cross = np.zeros(bands.centre_hz.size, dtype=np.complex128)
    of_one, of_other = cross.copy(), cross.copy()
    for each in spectra:
        one = each.force if each.message is None else each.message
        other = each.skin if each.message is None else each.force
        assert other is not None
        cross += bands.total(one.conj() * other)
        of_one += bands.total(np.square(np.abs(one)))
        of_other += bands.total(np.square(np.abs(other)))
    power = (of_one * of_other).real
    coherence: FloatArray = np.divide(
        np.square(np.abs(cross)), power, out=np.zeros(power.size), where=power > 0.0
    )
    return coherence


def _by_chance(spectra: Sequence[WindowSpectra], bands: Bands) -> FloatArray:
    """Return the coherence that noise alone has less often than `CHANCE`, (n_bands,)."""
    averages = bands.averages(sum(each.force.shape[0] for each in spectra))
    least: FloatArray = 1.0 - CHANCE ** (1.0 / np.maximum(averages - 1.0, 1e-9))
    return least


def _transfer(
    bands: Bands, known: ComplexArray, cause: ComplexArray, effect: ComplexArray
) -> _Transfer:
    """Return effect over cause, both seen through what is known without noise.

    ``S_ke / S_kc``; the cause itself as the known gives H1. What the response leaves of the
    effect is noise, from which the variance follows.
    """
    through = bands.total(known.conj() * cause)
    response = bands.total(known.conj() * effect) / through
    left = effect - response[bands.band] * cause
    noise = bands.total(np.square(np.abs(left))).real
    power = bands.total(np.square(np.abs(known))).real
    free = bands.averages(known.shape[0]) - 1.0
    with np.errstate(divide="ignore", invalid="ignore"):
        variance = power * noise / np.square(np.abs(through)) / (2.0 * free)
    return _Transfer(response, np.where(free > 0.0, variance, np.nan))


def _rows(
    spectra: WindowSpectra,
    bands: Bands,
    instrument: Instrument,
    used: BoolArray,
    normal_n: FloatArray,
    rate_hz: float,
    window: int,
) -> ResponseRows:
    count = bands.centre_hz.size
    nothing = _Transfer(np.full(count, NOTHING), np.full(count, np.nan))
    friction, mobility, amplitude = nothing, nothing, np.full(count, NOTHING)
    known, shared = spectra.known, instrument.force * bands.passing
    if spectra.message is not None:
        friction = _transfer(bands, known, known, spectra.force)
        friction = friction.times(spectra.correction(shared * instrument.drive, bands, 0))
        power = bands.total(spectra.message_power[np.newaxis]).real
        amplitude = np.sqrt(4.0 * power / known.shape[0] / window)
    if spectra.skin is not None:
        # The sensor reports the force of the finger; the skin feels its opposite.
        mobility = _transfer(bands, known, -spectra.force, spectra.skin)
        mobility = mobility.times(spectra.correction(instrument.skin / shared, bands, 1))
    segment = spectra.segment
    first, last = (int(at * rate_hz / BLOCK) for at in (segment.begin_s, segment.end_s))
    normal = normal_n[first:last][np.isfinite(normal_n[first:last])]
    each = np.ones(np.count_nonzero(used))
    return ResponseRows(
        sweep=np.full(each.size, segment.sweep),
        direction=np.full(each.size, segment.direction),
        third=np.full(each.size, segment.third),
        speed_mm_s=spectra.speed(bands)[0][used],
        normal_force_n=(normal.mean() if normal.size else np.nan) * each,
        position_mm=segment.position_mm * each,
        tone_hz=bands.centre_hz[used],
        message=amplitude[used],
        friction_response=friction.response[used],
        friction_variance=friction.variance[used],
        mobility=mobility.response[used],
        mobility_variance=mobility.variance[used],
    )


def _message(
    spectra: Sequence[WindowSpectra],
    rows: Sequence[ResponseRows],
    bands: Bands,
    used: BoolArray,
) -> HarmonicResponse:
    sizes = [each.tone_hz.size for each in rows]
    power = [np.square(np.abs(each.message)).sum() / 2.0 for each in rows]
    nothing = np.full(sum(sizes), np.nan)
    of_friction, of_mobility = (
        np.concatenate(
            [
                np.array(each.place(bands, of))[:, kept]
                for each, kept in zip(spectra, used, strict=True)
            ],
            axis=1,
        )
        for of in (0, 1)
    )
    speed_spread_mm_s = [
        each.speed(bands)[1][kept] for each, kept in zip(spectra, used, strict=True)
    ]
    return HarmonicResponse(
        message_mean=np.repeat([each.message_mean for each in spectra], sizes),
        message_power=np.repeat(power, sizes),
        second=nothing.astype(np.complex128),
        second_variance=nothing,
        third=nothing.astype(np.complex128),
        third_variance=nothing,
        centroid_hz=of_friction[0],
        spread_hz=of_friction[1],
        skewness=of_friction[2],
        mobility_centroid_hz=of_mobility[0],
        mobility_spread_hz=of_mobility[1],
        mobility_skewness=of_mobility[2],
        speed_spread_mm_s=np.concatenate(speed_spread_mm_s),
    )


def _nothing(segments: Sequence[SweepThird], long_enough: bool) -> tuple[str, ...]:
    """Return why there is no spectrum."""
    if not segments:
        return ()  # there is no steady sweep, which is a reason by itself
    if long_enough:
        return ("broadband: neither a drive nor a skin's sensor goes with the force",)
    longest = max(segment.end_s - segment.begin_s for segment in segments)
    return (
        f"broadband: no third of a sweep holds {WINDOW_S:g} s without gaps, the longest lasts "
        f"{longest:.2f} s: stroke farther or more slowly",
    )


def _amplitude(spectra: Sequence[WindowSpectra], window: int) -> float:
    """Return the amplitude of a tone that has the power of the message."""
    windows = sum(each.force.shape[0] for each in spectra)
    power = sum(float(each.message_power.sum()) for each in spectra)
    return float(np.sqrt(4.0 * power / windows / window))


def _notes(
    spectra: Sequence[WindowSpectra],
    coherence: FloatArray,
    used: BoolArray,
    segments: int,
    *,
    drives: bool,
) -> tuple[str, ...]:
    between = "force and skin" if spectra[0].message is None else "drive and friction"
    from_where = f"{len(spectra)} of {segments} thirds of sweeps"
    if not used.any() and not drives:
        return (
            "broadband: the drive is off or steady, as in a blank trial: it tells of the "
            "background alone",
        )
    if not used.any():
        return (f"broadband: {between} are not coherent in {from_where}; nothing is used",)
    return (
        f"broadband: {used.sum()} of {used.size} bands in {from_where}, mean coherence of "
        f"{between} {coherence[used].mean():.2f}; the other bands are not coherent enough",
    )

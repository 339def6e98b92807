"""Resonances of a mount from how it rings down after a hammer's blows.

After a blow the sensor reports decaying sinusoids. Their poles follow from the shift between
the rows of the signal subspace (ESPRIT: Roy and Kailath 1989), which all blows share: Hankel
matrices of all of them are taken together. Intervals come from leaving out one blow at a time
and from moving the band's ends: close resonances lean on what else the band holds. What changes
from recording to recording no recording shows: `between_recordings` takes several.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from frictus_hardware.arrays import ComplexArray, FloatArray
from frictus_service.errors import ServiceError

LEAST_BLOWS: Final = 3
STARTS_AT: Final = 0.1
"""A blow begins where the envelope passes this share of its highest value,"""
ABOVE_NOISE: Final = 20.0
"""and so many times its median."""
ENVELOPE_S: Final = 1e-3
APART_S: Final = 0.1
"""What follows sooner is the same blow, or a bounce of the hammer."""
SETTLE_PERIODS: Final = 3.0
"""Of the lowest frequency of the band, left out after a blow: hammer and filter still act."""
LAST_PERIODS: Final = 16.0
"""Of the lowest frequency, that are looked at."""
SMALLEST: Final = 1e-3
"""Share of the strongest direction's amplitude; below lies what the model does not describe."""
NOISE_DIRECTION: Final = 2.0
"""Largest power of noise in one direction over its power per sample and the length of a blow:
(1 + sqrt(1/2))² of the columns, which are two thirds of the length."""
OVERSAMPLED: Final = 2.5
"""Sample rate over the band's upper end, once reduced."""
MOST_DAMPED: Final = 0.3
SAME: Final = 0.03
"""Relative distance within which a pole without one blow is the same resonance."""
MOVED: Final = ((0.8, 1.0), (1.2, 1.0), (1.0, 0.8), (1.0, 1.2))
"""Factors on the band's ends: what another analyst might as well have chosen."""
HIGHEST: Final = 0.45
"""End of a band, over the sample rate."""
LEAST_DB: Final = -26.0
"""Of a peak over the highest: weaker ones depend on the band and on where a blow begins."""


class RingDownError(ServiceError, ValueError):
    """The recording shows no resonances; the text says why."""


@dataclass(frozen=True, slots=True)
class Resonance:
    """One resonance, 95 % intervals.

    Attributes
    ----------
    frequency_hz : float
        Natural frequency.
    frequency_ci_hz : tuple of float
        Low and high end: of this recording, or of the mean of all recordings.
    damping_ratio : float
        Of critical damping.
    damping_ratio_ci : tuple of float
        Low and high end, of the same.
    level_db : float
        Height of its peak in the answer to a blow over that of the highest, the mean of all
        blows.
    frequency_se_hz, damping_ratio_se : float
        Standard errors of the two.
    another_frequency_hz, another_damping_ratio : tuple of float or None
        Within which one more recording's estimate lies, in 95 %; None of one recording alone.
    """

    frequency_hz: float
    frequency_ci_hz: tuple[float, float]
    damping_ratio: float
    damping_ratio_ci: tuple[float, float]
    level_db: float
    frequency_se_hz: float
    damping_ratio_se: float
    another_frequency_hz: tuple[float, float] | None = None
    another_damping_ratio: tuple[float, float] | None = None


def estimate_ring_down(
    samples: FloatArray, rate_hz: float, band_hz: tuple[float, float]
) -> list[Resonance]:
    """Return the resonances within a band, by rising frequency, down to -26 dB.

    Only those that stay whichever blow is left out, with a damping that is above zero. Close
    ones are told apart where their decays are long enough for it. The intervals hold within
    this recording: over its blows, and over bands whose ends lie a fifth off. What another day,
    place of the hammer or mounting would change is not in them.

    Parameters
    ----------
    samples : ndarray, shape (n_samples,)
        Of any unit, blow after blow.
    rate_hz : float
        Samples per second.
    band_hz : tuple of float
        From above zero to below half the sample rate.

    Raises
    ------
    RingDownError
        If the band is none, samples are missing, there are fewer than three blows, or nothing
        rings.
    """
    low, high = band_hz
    if not 0.0 < low < high <= HIGHEST * rate_hz:
        raise RingDownError(
            f"the band is {low:g} to {high:g} Hz; accepted: rising, from above 0 to "
            f"{HIGHEST * rate_hz:g} Hz ({HIGHEST:g} of the sample rate)"
        )
    if not np.isfinite(samples).all():
        raise RingDownError("samples are missing or infinite; cut them out")
    seen = _in_band(samples, rate_hz, band_hz)
    count = len(seen.blows)
    if count < LEAST_BLOWS:
        raise RingDownError(
            f"{count} blows are found; accepted: {LEAST_BLOWS} at least, each "
            f"{ABOVE_NOISE:g} times as strong as the noise and {APART_S:g} s from the next"
        )
    without = [seen.poles(left_out=place) for place in range(count)]
    found = list(_resonances(seen, without, list(_elsewhere(samples, rate_hz, band_hz))))
    if not found:
        raise RingDownError(f"nothing rings from {low:g} to {high:g} Hz in {count} blows")
    highest = max(each.level_db for each in found)
    levelled = [replace(each, level_db=each.level_db - highest) for each in found]
    return [each for each in levelled if each.level_db >= LEAST_DB]


NONE: Final = np.empty(0)


@dataclass(frozen=True, slots=True)
class _InBand:
    """What follows the blows, in one band at a reduced rate."""

    band_hz: tuple[float, float]
    rate_hz: float
    blows: list[FloatArray]
    grams: list[FloatArray]
    floor: float

    def poles(self, left_out: int | None = None) -> ComplexArray:
        """Return the poles of all blows, or of all but one."""
        gram = np.sum([one for k, one in enumerate(self.grams) if k != left_out], axis=0)
        return _poles(gram, self.floor, self.rate_hz, self.band_hz)


def _in_band(samples: FloatArray, rate_hz: float, band_hz: tuple[float, float]) -> _InBand:
    reduced, rate_hz = _reduced(samples, rate_hz, band_hz)
    blows, noise = _blows(reduced, rate_hz, band_hz[0])
    floor = sum(
        NOISE_DIRECTION * noise**2 * blow.size / np.square(blow).sum() for blow in blows
    )
    return _InBand(band_hz, rate_hz, blows, [_gram(blow) for blow in blows], float(floor))


def _elsewhere(
    samples: FloatArray, rate_hz: float, band_hz: tuple[float, float]
) -> Iterator[ComplexArray]:
    """Yield the poles in bands whose ends lie elsewhere."""
    for lower, upper in MOVED:
        low, high = lower * band_hz[0], min(upper * band_hz[1], HIGHEST * rate_hz)
        if low < high:
            seen = _in_band(samples, rate_hz, (low, high))
            if len(seen.blows) >= LEAST_BLOWS:
                yield seen.poles()


def _reduced(
    samples: FloatArray, rate_hz: float, band_hz: tuple[float, float]
) -> tuple[FloatArray, float]:
    """Return the band alone at a lower rate, and that rate; without shift in time."""
    from scipy import signal

    sections = signal.butter(4, band_hz, "bandpass", fs=rate_hz, output="sos")
    banded = signal.sosfiltfilt(sections, samples - samples.mean())
    factor = max(int(rate_hz / (OVERSAMPLED * band_hz[1])), 1)
    return banded[::factor], rate_hz / factor


def _blows(
    samples: FloatArray, rate_hz: float, lowest_hz: float
) -> tuple[list[FloatArray], float]:
    """Return what follows each blow, all of the same length, and the noise between blows."""
    width = max(round(ENVELOPE_S * rate_hz), 1)
    envelope = np.sqrt(np.convolve(np.square(samples), np.ones(width) / width, "same"))
    noise = float(np.median(envelope))
    least = max(STARTS_AT * envelope.max(), ABOVE_NOISE * noise)
    above = np.flatnonzero(envelope > least)
    starts = above[np.diff(above, prepend=-np.inf) > APART_S * rate_hz]
    settle = round(SETTLE_PERIODS / lowest_hz * rate_hz)
    length = round(LAST_PERIODS / lowest_hz * rate_hz)
    blows = []
    for start in starts.tolist():
        peak = start + int(np.argmax(envelope[start : start + settle]))
        rings = samples[peak + settle : peak + settle + length]
        if rings.size == length:
            blows.append(rings)
    return blows, noise


def _gram(blow: FloatArray) -> FloatArray:
    """Return the products of the rows of a blow's Hankel matrix, of equal weight for each."""
    rows = blow.size // 3
    hankel = np.lib.stride_tricks.sliding_window_view(blow, blow.size - rows + 1)
    gram: FloatArray = hankel @ hankel.T / np.square(blow).sum()
    return gram


def _poles(
    gram: FloatArray, floor: float, rate_hz: float, band_hz: tuple[float, float]
) -> ComplexArray:
    """Return the poles within the band, rad/s, upper half plane, by rising frequency."""
    values, vectors = np.linalg.eigh(gram)
    signal = vectors[:, values > max(SMALLEST**2 * values[-1], floor)]
    turned = np.linalg.eigvals(np.linalg.lstsq(signal[:-1], signal[1:])[0])
    poles = np.log(turned.astype(np.complex128)) * complex(rate_hz)
    frequency = np.abs(poles) / (2.0 * np.pi)
    damping = -poles.real / np.abs(poles)
    kept = (poles.imag > 0.0) & (frequency >= band_hz[0]) & (frequency <= band_hz[1])
    kept &= (damping > 0.0) & (damping < MOST_DAMPED)
    rising = np.flatnonzero(kept)[np.argsort(frequency[kept])]
    return poles[rising]


def _resonances(
    seen: _InBand, without: Sequence[ComplexArray], elsewhere: Sequence[ComplexArray]
) -> Iterator[Resonance]:
    """Yield those that stay whichever blow is left out; levels not yet over the highest."""
    poles = seen.poles()
    for pole, level_db in zip(poles, _levels(poles, seen.blows, seen.rate_hz), strict=True):
        again = _same(without, pole)
        if len(again) < len(without):
            continue
        moved = _same(elsewhere, pole)
        if not _uncertain(damping_ratio(pole), damping_ratio(again))[0] < damping_ratio(pole):
            continue
        hz, damping = float(natural_hz(pole)), float(damping_ratio(pole))
        off_hz, error_hz = _uncertain(natural_hz(pole), natural_hz(again), natural_hz(moved))
        # By its logarithm: damping is above zero, and so is its interval.
        off, error = _uncertain(
            np.log(damping), np.log(damping_ratio(again)), np.log(damping_ratio(moved))
        )
        yield Resonance(
            hz,
            (hz - off_hz, hz + off_hz),
            damping,
            (damping * float(np.exp(-off)), damping * float(np.exp(off))),
            float(level_db),
            error_hz,
            damping * error,
        )


def natural_hz(poles: ComplexArray | complex) -> FloatArray:
    """Return natural frequencies of poles in rad/s."""
    found: FloatArray = np.abs(poles) / (2.0 * np.pi)
    return found


def damping_ratio(poles: ComplexArray | complex) -> FloatArray:
    """Return damping ratios of poles."""
    found: FloatArray = -np.asarray(poles).real / np.abs(poles)
    return found


def _same(sets: Sequence[ComplexArray], pole: complex) -> ComplexArray:
    """Return the same resonance in other sets of poles, where it is."""
    again = [_closest(other, pole) for other in sets]
    return np.array([each for each in again if each is not None], dtype=np.complex128)


def _closest(poles: ComplexArray, to: complex) -> complex | None:
    if not poles.size:
        return None
    best = complex(poles[np.argmin(np.abs(poles - to))])
    return best if abs(best - to) <= SAME * abs(to) else None


def _uncertain(
    value: FloatArray | float, without: FloatArray, elsewhere: FloatArray = NONE
) -> tuple[float, float]:
    """Return half the 95 % interval and the standard error: of blows (jackknife) and of bands.

    Degrees of freedom of their sum: Welch and Satterthwaite.
    """
    from scipy import stats

    from frictus_service.identification.fit.grouped_errors import freedom_of_sum

    count = without.size
    of_blows = (count - 1) / count * float(np.square(without - without.mean()).sum())
    of_bands = float(np.mean(np.square(elsewhere - value))) if elsewhere.size else 0.0
    variance = of_blows + of_bands
    if variance == 0.0:
        return 0.0, 0.0
    freedom = freedom_of_sum(of_blows, count - 1, of_bands, max(elsewhere.size, 1))
    error = float(np.sqrt(variance))
    return float(stats.t.ppf(0.975, freedom)) * error, error


def _levels(poles: ComplexArray, blows: Sequence[FloatArray], rate_hz: float) -> FloatArray:
    """Return the height of each peak: amplitude over decay, mean of all blows, dB."""
    time_s = np.arange(blows[0].size) / rate_hz
    modes = np.exp(np.multiply.outer(time_s, poles))
    basis = np.column_stack([modes.real, -modes.imag])
    fitted = np.linalg.lstsq(basis, np.column_stack(blows))[0]
    size = np.hypot(fitted[: poles.size], fitted[poles.size :]) / -poles.real[:, np.newaxis]
    levels: FloatArray = 20.0 * np.log10(size.mean(axis=1))
    return levels

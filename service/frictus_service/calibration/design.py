"""Excitations: the paper's single tones, and multisines that ask for the cutoff alone.

A multisine here has odd multiples of 10 Hz only, so that what is not linear shows at the lines
left free: even products of the tones at even multiples, odd products at the odd ones.
"""

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from frictus.messages import Excitation, Tone
from frictus_hardware.arrays import FloatArray
from frictus_service.calibration import coordinates
from frictus_service.calibration.coordinates import Prior
from frictus_service.errors import ExcitationDesignError

RATE_HZ: Final = 20_000.0
BASE_HZ: Final = 10.0
"""Spacing of the lines: a third of a stroke at 100 mm/s lasts 0.23 s, which tells lines apart
that are 4.3 Hz from each other."""
RANGE_HZ: Final = (70.0, 1590.0)
"""Below, friction is loudest; above, the mount resonates at 1714 Hz."""
RESONANCE_HZ: Final = (780.0, 1000.0)
"""Left free: a small error of the mount's 856 Hz is a large one of the response."""
MAINS_HZ: Final = 50.0
BIAS: Final = 0.5
_FLOOR: Final = 0.2
"""Share of the power that is spread evenly, so that other than first order shows."""
_STARTS: Final = 12
_ROUNDS: Final = 200


def paper_tones() -> FloatArray:
    """Return the paper's 15 tones, evenly spaced in the logarithm from 30 Hz to 2 kHz."""
    return np.geomspace(30.0, 2000.0, 15)


def single(tone_hz: float) -> Excitation:
    """Return one tone at full drive, as the paper's trials play it.

    Parameters
    ----------
    tone_hz : float
        Above 0, up to 5000 Hz.
    """
    return Excitation(tones=[Tone(hz=tone_hz, amplitude=BIAS)], bias=BIAS)


def lines(n_tones: int) -> FloatArray:
    """Return lines for a multisine, evenly spaced in the logarithm as nearly as they can be.

    Odd multiples of 10 Hz in `RANGE_HZ`, off the mains' harmonics and the mount's resonance.

    Parameters
    ----------
    n_tones : int
        3 to 24: gain, cutoff and delay are asked for.

    Raises
    ------
    ExcitationDesignError
        If the number is outside.
    """
    if not 3 <= n_tones <= 24:
        raise ExcitationDesignError(f"{n_tones} tones: choose 3 to 24")
    odd = np.arange(1.0, 2.0 * RANGE_HZ[1] / BASE_HZ, 2.0) * BASE_HZ
    free = odd[
        (odd >= RANGE_HZ[0])
        & (odd <= RANGE_HZ[1])
        & (odd % MAINS_HZ != 0.0)
        & ((odd < RESONANCE_HZ[0]) | (odd > RESONANCE_HZ[1]))
    ]
    chosen: list[float] = []
    for wanted in np.geomspace(*RANGE_HZ, n_tones):
        left = np.setdiff1d(free, chosen)
        chosen.append(float(left[np.argmin(np.abs(np.log(left / wanted)))]))
    return np.sort(chosen)


def powers(
    tone_hz: FloatArray, prior: Prior, speeds_mm_s: Sequence[float], precision: float = 0.02
) -> FloatArray:
    """Share power among tones for the least interval of the cutoff.

    c-optimal for ln cutoff with gain and delay unknown but for the prior, in the mean over
    speeds and over people within two standard deviations, under white noise behind the
    response; by the multiplicative algorithm (Silvey, Titterington and Torsney 1978). A fifth
    of the power is spread evenly.

    Parameters
    ----------
    tone_hz : ndarray, shape (n,)
    prior : Prior
        What is known of the person beforehand.
    speeds_mm_s : sequence of float
        At which the person will be measured.
    precision : float
        Half of the 95 % interval of the cutoff over its value that is aimed at: it decides
        whether the prior's delay is precise enough to count.

    Returns
    -------
    ndarray, shape (n,)
        Shares of the sum of squared amplitudes.
    """
    per_power = np.array(
        [_information(tone_hz, cutoff) for cutoff in _expected_cutoffs(prior, speeds_mm_s)]
    )
    known = np.zeros((3, 3))
    power = np.full(tone_hz.size, 1.0 / tone_hz.size)
    for aware in (False, True):
        if aware:  # in units of all the information that the precision takes
            spent = np.mean(_variances(per_power, power, known)) / (precision / 1.96) ** 2
            known[2, 2] = 1.0 / (prior.covariance[3, 3] * spent)
        for _ in range(500):
            inverse = np.linalg.inv(np.einsum("l,clij->cij", power, per_power) + known)
            use = np.einsum("ci,clij,cj->cl", inverse[:, 0], per_power, inverse[:, 0])
            power = power * np.sqrt(np.mean(use / inverse[:, 0, :1], axis=0))
            power /= power.sum()
    return (1.0 - _FLOOR) * power + _FLOOR / tone_hz.size


def multisine(
    rng: np.random.Generator, tone_hz: FloatArray, power: FloatArray | None = None
) -> Excitation:
    """Return tones played at once, as loud as the drive admits, with phases for a low crest.

    From random phases, the peaks are clipped and the amplitudes restored (Van der Ouderaa,
    Schoukens and Renneboog 1988); the lowest crest of several starts is taken.

    Parameters
    ----------
    rng : numpy.random.Generator
        Source of everything random.
    tone_hz : ndarray, shape (n,)
        Odd multiples of 10 Hz.
    power : ndarray, shape (n,), optional
        Shares of the squared amplitudes; equal if not given.

    Returns
    -------
    Excitation
        Drive fraction from 0 to 1 about 0.5; the period is 0.1 s.

    Raises
    ------
    ExcitationDesignError
        If a tone is not an odd multiple of 10 Hz below 5 kHz, or occurs twice.
    """
    harmonic = np.rint(tone_hz / BASE_HZ).astype(np.int64)
    fits = (harmonic * BASE_HZ == tone_hz) & (harmonic % 2 == 1) & (tone_hz < 5000.0)
    if not np.all(fits) or np.unique(harmonic).size != harmonic.size:
        raise ExcitationDesignError(
            f"tones must be different odd multiples of {BASE_HZ:g} Hz below 5000 Hz; "
            f"got {tone_hz.tolist()}"
        )
    shares = np.ones(tone_hz.size) if power is None else power
    phases, peak = _low_crest(rng, harmonic, np.sqrt(shares))
    amplitude = BIAS * (1.0 - 1e-9) * np.sqrt(shares) / peak
    return Excitation(
        tones=[
            Tone(hz=float(hz), amplitude=float(size), phase_rad=float(phase))
            for hz, size, phase in zip(tone_hz, amplitude, phases, strict=True)
        ],
        bias=BIAS,
        period_s=1.0 / BASE_HZ,
    )


def _low_crest(
    rng: np.random.Generator, harmonic: NDArray[np.int64], amplitude: FloatArray
) -> tuple[FloatArray, float]:
    """Return phases and the peak of one period at those amplitudes."""
    n = round(RATE_HZ / BASE_HZ)
    phase = rng.uniform(-np.pi, np.pi, (_STARTS, harmonic.size))
    spectrum = np.zeros((_STARTS, n // 2 + 1), dtype=np.complex128)
    best, lowest = phase[0], np.inf
    for turn in range(_ROUNDS + 1):
        spectrum[:, harmonic] = amplitude * np.exp(1j * phase) * n / 2.0
        wave = np.fft.irfft(spectrum, n)
        peaks = np.max(np.abs(wave), axis=1)
        at = int(np.argmin(peaks))
        if peaks[at] < lowest:
            best, lowest = phase[at].copy(), float(peaks[at])
        level = peaks * (0.75 + 0.24 * turn / _ROUNDS)
        clipped = np.clip(wave, -level[:, np.newaxis], level[:, np.newaxis])
        phase = np.angle(np.fft.rfft(clipped)[:, harmonic])
    return best, lowest


def _expected_cutoffs(prior: Prior, speeds_mm_s: Sequence[float]) -> FloatArray:
    """Return cutoffs from two standard deviations below to two above, at every speed."""
    speeds = np.asarray(speeds_mm_s, dtype=np.float64)
    gradient = coordinates.cutoff_gradient(prior.mean, speeds)
    spread = np.sqrt(np.einsum("vi,ij,vj->v", gradient, prior.covariance, gradient))
    centre = np.log(coordinates.cutoff_hz(prior.mean, speeds))
    people = np.linspace(-2.0, 2.0, 5)[:, np.newaxis]
    expected: FloatArray = np.exp(centre + people * spread).ravel()
    return expected


def _information(tone_hz: FloatArray, cutoff_hz: float) -> FloatArray:
    """Return the information on (ln cutoff, ln gain, delay in s) per power of each tone."""
    strength = cutoff_hz**2 / (cutoff_hz**2 + tone_hz**2)
    columns = np.stack(
        [
            1j * tone_hz / (cutoff_hz + 1j * tone_hz),
            np.ones(tone_hz.size, dtype=np.complex128),
            -2j * np.pi * tone_hz,
        ],
        axis=1,
    )
    product = columns[:, :, np.newaxis] * columns[:, np.newaxis, :].conj()
    information: FloatArray = strength[:, np.newaxis, np.newaxis] * product.real
    return information


def _variances(per_power: FloatArray, power: FloatArray, known: FloatArray) -> FloatArray:
    """Return the variance of ln cutoff for each expected cutoff, at unit power."""
    inverse = np.linalg.inv(np.einsum("l,clij->cij", power, per_power) + known)
    return inverse[:, 0, 0]

"""Which lines a trial's friction holds, and what is left of a channel when they are taken out.

Which lines are fitted together in a trial, and which harmonics of its tones can be trusted.

A harmonic is told from other lines only where nothing else stands near it: another tone, a
product of other tones, an image of the carrier (V² has lines at |2 f_c ± f|, folded by the
sampling), a mains line.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from frictus_hardware.arrays import ComplexArray, FloatArray
from frictus_service.discovery.projection import orthogonal_to
from frictus_service.identification.observation.blocks import BLOCK, RAMP, BlockSums
from frictus_service.identification.observation.response import WholeBlocks
from frictus_service.identification.observation.tones import Tones, trend_degree

MAINS_HZ: Final = (50.0, 60.0)
FROM_MAINS_HZ: Final = 8.0
"""A mains line closer to a tone is not told from it."""
APART_HZ: Final = 20.0
"""From a harmonic to any other line."""
HIGHEST_SHARE: Final = 0.4
"""Of the sample rate: what lies above is not used."""
ORDERS: Final = (2, 3)


@dataclass(frozen=True, slots=True)
class Lines:
    """Frequencies that are fitted together, and which of them are what.

    Attributes
    ----------
    tones : Tones
        All lines: first the trial's tones, then the others.
    n_tones : int
        The first lines of all.
    harmonics : tuple of ndarray of int, shape (n_tones,)
        Places in `tones` of the harmonics of second and third order; -1 where there is none.
    mains : tuple of int
        Places of 50 and 60 Hz; -1 where there is none.
    """

    tones: Tones
    n_tones: int
    harmonics: tuple[NDArray[np.int64], NDArray[np.int64]]
    mains: tuple[int, int]


@lru_cache(maxsize=256)
def lines_of(tones_hz: tuple[float, ...], carrier_hz: float, sample_rate_hz: float) -> Lines:
    """Return the lines that a trial may show.

    Parameters
    ----------
    tones_hz : tuple of float
        Empty for a blank trial.
    carrier_hz, sample_rate_hz : float
        Of the rig.
    """
    own = np.array(tones_hz, dtype=np.float64)
    images = _images(own, carrier_hz, sample_rate_hz)
    fitted = list(tones_hz)

    def place(line_hz: float) -> int:
        fitted.append(line_hz)
        return len(fitted) - 1

    mains = [place(at) if _far(at, own, FROM_MAINS_HZ) else -1 for at in MAINS_HZ]
    around = np.concatenate([own, images, MAINS_HZ])
    made = _products(own)
    harmonics = []
    for order in ORDERS:
        at = [
            place(order * tone)
            if order * tone <= HIGHEST_SHARE * sample_rate_hz
            and _far(order * tone, around, APART_HZ)
            and _products_near(order * tone, made) == 1  # which is the harmonic itself
            else -1
            for tone in tones_hz
        ]
        harmonics.append(np.array(at, dtype=np.int64))
    if any(np.any(at >= 0) for at in harmonics):
        # They leak into harmonics unless they are fitted too. At 0 and at half of the sample
        # rate sine is nothing: there a line has no phase that could be fitted.
        ends = (0.0, sample_rate_hz / 2.0)
        for image in images.tolist():
            if _far(image, np.array([*fitted, *ends]), APART_HZ):
                place(image)
    return Lines(
        Tones(tuple(fitted), sample_rate_hz),
        len(tones_hz),
        (harmonics[0], harmonics[1]),
        (mains[0], mains[1]),
    )


def _far(line_hz: float, others_hz: FloatArray, apart_hz: float) -> bool:
    return bool(np.all(np.abs(others_hz - line_hz) >= apart_hz))


def _images(tones_hz: FloatArray, carrier_hz: float, sample_rate_hz: float) -> FloatArray:
    """Return where the carrier's line of V² and its sidebands fold to."""
    if not tones_hz.size:
        return tones_hz
    lines = 2.0 * carrier_hz + np.concatenate([[0.0], tones_hz, -tones_hz])
    folded: FloatArray = np.abs(lines - sample_rate_hz * np.rint(lines / sample_rate_hz))
    return folded


def _products(tones_hz: FloatArray) -> FloatArray:
    """Return what squares and cubes make of tones: sums of two and of three of ±f, rising."""
    signed = np.concatenate([tones_hz, -tones_hz])
    two = np.add.outer(signed, signed).ravel()
    return np.sort(np.concatenate([two, np.add.outer(two, signed).ravel()]))


def _products_near(line_hz: float, made_hz: FloatArray) -> int:
    low, high = np.searchsorted(made_hz, (line_hz - APART_HZ, line_hz + APART_HZ))
    return int(high - low)


LOW_BAND_HZ: Final = (4.0, 30.0)
LEAST_LOW_S: Final = 0.35
"""Length of a segment in which this band is told from the trend."""
NEAR_HZ: Final = 40.0
"""Lines below this take some of the band's noise with them, which is made up for."""
LEAST_PRESENT: Final = 0.5
"""Share of the samples of a block that must be there."""


@dataclass(frozen=True, slots=True)
class Backdrop:
    """The lines that are taken out, at every block of a trial.

    Attributes
    ----------
    tones : Tones
        Frequencies that are fitted together.
    turned : ndarray of complex, shape (n_lines, n_blocks)
        exp(2 pi i f t) at the middle of each block.
    flat : ndarray, shape (n_lines,)
        Mean of a cosine over a block about its middle.
    """

    tones: Tones
    turned: ComplexArray
    flat: FloatArray

    @classmethod
    def of(cls, tones: Tones, n_blocks: int) -> "Backdrop":
        """Return the lines of a trial of so many blocks."""
        omega = np.array(tones.per_sample)
        middle = BLOCK * np.arange(n_blocks) + (BLOCK - 1) / 2.0
        turned = np.exp(1j * np.multiply.outer(omega, middle))
        return cls(tones, turned, np.cos(np.multiply.outer(omega, RAMP)).mean(axis=1))

    def left_of(
        self,
        channels: BlockSums,
        channel: int,
        weights: Sequence[float],
        amplitude: ComplexArray,
        piece: WholeBlocks,
    ) -> tuple[FloatArray, FloatArray]:
        """Return the sums over blocks of what is left of a channel, and of how many samples.

        Parameters
        ----------
        channels : BlockSums
            Sums over blocks of all channels.
        channel : int
            Number of the channel.
        weights : sequence of float
            With which the channel's columns are added up.
        amplitude : ndarray of complex, shape (n_lines,)
            Fitted in the segment.
        piece : WholeBlocks
            The segment.
        """
        first, last = piece.first, piece.last
        column = sum(channels.columns[:channel])
        columns = channels.sums[column : column + len(weights), first:last, 0]
        lines = (amplitude * self.flat * BLOCK) @ self.turned[:, first:last]
        left = np.asarray(weights) @ columns - lines.real
        count = np.full(last - first, float(BLOCK))
        missing = channels.missing[channel]
        low, high = np.searchsorted(missing, (first * BLOCK, last * BLOCK))
        gone = missing[low:high]
        if gone.size:
            # Missing samples count as zero in the sums, with no line in them.
            phase = np.multiply.outer(gone, np.array(self.tones.per_sample))
            np.add.at(left, gone // BLOCK - first, (np.exp(1j * phase) @ amplitude).real)
            np.subtract.at(count, gone // BLOCK - first, 1.0)
        return left, count


def low_power(
    left: FloatArray, count: FloatArray, lines_hz: FloatArray, sample_rate_hz: float
) -> tuple[float, float]:
    """Return the power from 4 to 30 Hz, and its variance were it Gaussian noise.

    A tapered periodogram of the blocks' means, beside a polynomial trend and the lines in or
    near the band. It is scaled so that white noise, of which trend and lines take a part,
    comes out without bias.

    Parameters
    ----------
    left, count : ndarray, shape (n_blocks,)
        From `Backdrop.left_of`.
    lines_hz : ndarray
        Lines that were taken out.
    sample_rate_hz : float
        Of the samples.

    Returns
    -------
    power_n2, variance : float
        NaN where the segment is shorter than 0.35 s or too much of it is missing.
    """
    rate_hz = sample_rate_hz / BLOCK
    seconds = left.size / rate_hz
    there = count >= LEAST_PRESENT * BLOCK
    if seconds < LEAST_LOW_S or np.mean(there) < 1.0 - LEAST_PRESENT / 2.0:
        return np.nan, np.nan
    time_s = (np.arange(float(left.size)) - (left.size - 1) / 2.0) / rate_hz
    basis = np.linalg.qr(_basis(time_s, lines_hz[lines_hz < NEAR_HZ])[there])[0]
    mean = left[there] / count[there]
    taper = np.square(np.cos(np.pi * time_s[there] / seconds))
    columns = np.zeros((left.size, basis.shape[1] + 2))
    columns[there, 0] = taper * orthogonal_to(basis, mean)
    columns[there, 1] = np.square(taper)
    columns[there, 2:] = taper[:, np.newaxis] * basis
    length = 1 << int(np.ceil(np.log2(2 * left.size)))
    spectra = np.fft.rfft(columns, length, axis=0)
    low, high = (round(edge * length / rate_hz) for edge in LOW_BAND_HZ)
    # Covariance of the periodogram's lines for white noise of variance one.
    apart = np.arange(high - low)
    lag = np.subtract.outer(apart, apart)
    straight = np.where(lag < 0, spectra[-lag, 1].conj(), spectra[lag, 1])
    removed = spectra[low:high, 2:]
    covariance = straight - removed @ removed.conj().T
    expected = float(np.trace(covariance).real)
    band = (LOW_BAND_HZ[1] - LOW_BAND_HZ[0]) / (rate_hz / 2.0)
    power = band * float(np.sum(np.square(np.abs(spectra[low:high, 0])))) / expected
    spread = float(np.sum(np.square(np.abs(covariance)))) / expected**2
    return power, spread * power**2


def _basis(time_s: FloatArray, lines_hz: FloatArray) -> FloatArray:
    """Return trend and lines, (n_blocks, size)."""
    seconds = 2.0 * time_s[-1]
    trend = np.polynomial.legendre.legvander(2.0 * time_s / seconds, trend_degree(seconds))
    turned = 2.0 * np.pi * np.multiply.outer(time_s, lines_hz)
    return np.column_stack([trend, np.cos(turned), np.sin(turned)])

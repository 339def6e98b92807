"""What is left of a channel when the lines are taken out, a value per block of samples."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from frictus_hardware.arrays import ComplexArray, FloatArray
from frictus_service.identification.observation.blocks import BLOCK, RAMP, BlockSums
from frictus_service.identification.observation.response import WholeBlocks
from frictus_service.identification.observation.tones import Tones, trend_degree

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
    columns[there, 0] = taper * (mean - basis @ (basis.T @ mean))
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

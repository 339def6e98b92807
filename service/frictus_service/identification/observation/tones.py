"""Complex amplitudes at exact frequencies in a segment, and the noise around them."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from frictus_hardware.arrays import ComplexArray, FloatArray
from frictus_service.identification.observation.blocks import BLOCK, BlockSums, sum_blocks
from frictus_service.identification.observation.least_squares import solve

TREND_HZ: Final = 2.0
"""The normal force wanders up to here, and friction with it."""

LEAST_PERIODS: Final = 3.0
"""Of the lowest tone, in a segment in which it can be told from the trend."""

LEAST_TURNS: Final = 1.5
"""Of the closest two tones against each other, in a segment in which they can be told apart."""

LEAST_BLOCKS: Final = 8
"""Of samples in a segment, whatever the tones: fewer do not determine the trend."""

MOST_MISSING: Final = 0.2
"""Share of the samples of a segment that may be missing."""


@dataclass(frozen=True, slots=True)
class Tones:
    """Frequencies that are fitted together.

    Attributes
    ----------
    tones_hz : tuple of float
        At least one, all different.
    sample_rate_hz : float
        Samples per second of the device's clock.
    """

    tones_hz: tuple[float, ...]
    sample_rate_hz: float

    @property
    def per_sample(self) -> tuple[float, ...]:
        """Angular frequencies, radians per sample."""
        return tuple(2.0 * np.pi * tone / self.sample_rate_hz for tone in self.tones_hz)

    @property
    def least_s(self) -> float:
        """How long a segment must be to tell the tones from the trend and from each other."""
        tones = sorted(self.tones_hz)
        closest = float(min(np.diff(tones), default=np.inf))
        shortest = LEAST_BLOCKS * BLOCK / self.sample_rate_hz
        return max(LEAST_PERIODS / tones[0], LEAST_TURNS / closest, shortest)

    def reduce(self, channels: Sequence[FloatArray]) -> BlockSums:
        """Return what `fit` needs of the channels of a trial.

        Parameters
        ----------
        channels : sequence of ndarray, shape (n_samples, n_columns)
            Missing samples NaN.
        """
        return sum_blocks(channels, self.per_sample)


@dataclass(frozen=True, slots=True)
class Amplitudes:
    """Of all channels in one segment; arrays of shape (n_channels, n_tones).

    Attributes
    ----------
    amplitude : ndarray of complex
        y = Re(amplitude exp(2 pi i f t)), t from the first sample of the trial; NaN where more
        than a fifth of the samples are missing.
    variance : ndarray
        Of the real and of the imaginary part each, from the noise around the tone.
    """

    amplitude: ComplexArray
    variance: FloatArray


def fit(
    tones: Tones,
    channels: BlockSums,
    weights: Sequence[Sequence[float]],
    first: int,
    last: int,
) -> Amplitudes:
    """Return the amplitudes of all channels in one segment, by least squares beside a trend.

    The degree of the trend follows from the length of the segment, so that it can be a
    sinusoid of 2 Hz.

    Parameters
    ----------
    tones : Tones
        Frequencies that are fitted together.
    channels : BlockSums
        Sums over blocks of all channels.
    weights : sequence of sequences of float
        Per channel, the weights with which its columns are added up.
    first, last : int
        Blocks, the last one excluded; `tones.least_s` at least.
    """
    middle = (first + last) * BLOCK / 2.0 - 0.5
    count = (last - first) * BLOCK
    lacking = [_within(missing, first, last) for missing in channels.missing]
    most = MOST_MISSING * count
    useless = [channel for channel, each in enumerate(lacking) if each.size > most]
    for channel in useless:
        lacking[channel] = lacking[channel][:0]
    omega = np.array(tones.per_sample)
    amplitude, variance = solve(
        channels.sums[:, first:last],
        np.array(channels.columns),
        np.concatenate([np.asarray(each, dtype=np.float64) for each in weights]),
        omega,
        trend_degree(count / tones.sample_rate_hz),
        np.concatenate(lacking) - middle,
        np.array([each.size for each in lacking]),
    )
    amplitude *= np.exp(-1j * omega * middle)
    amplitude[useless] = complex(np.nan, np.nan)
    variance[useless] = np.nan
    return Amplitudes(amplitude, variance)


def trend_degree(seconds: float) -> int:
    """Return the degree of the polynomial that follows what wanders up to `TREND_HZ`.

    Parameters
    ----------
    seconds : float
        Length of the segment.
    """
    return int(np.ceil(np.pi * TREND_HZ * seconds)) + 2


def _within(missing: NDArray[np.int64], first: int, last: int) -> NDArray[np.int64]:
    if not missing.size:
        return missing
    low, high = np.searchsorted(missing, (first * BLOCK, last * BLOCK))
    return missing[low:high]

"""Frequencies of the windows of a spectrum, in bands of a sixth of an octave."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from frictus_hardware.arrays import ComplexArray, FloatArray, IntArray
from frictus_hardware.physics.linear import TransferFunction
from frictus_service.identification.observation.through_mount import ThroughMount

WINDOW_S: Final = 0.1
PER_OCTAVE: Final = 6
EDGE: Final = 2.0 ** (0.5 / PER_OCTAVE)
"""From the middle of a band to its upper end, as a factor."""
RANGE_HZ: Final = (40.0, 2000.0)
MOST_BEND: Final = 0.02
"""By which the mount's response may differ from the geometric mean of its neighbours."""


@dataclass(frozen=True, slots=True)
class Bands:
    """Frequencies of the windows, in bands of a sixth of an octave.

    Attributes
    ----------
    centre_hz : ndarray, shape (n_bands,)
        Means of the frequencies in each band of a grid through 1 kHz; bands that hold none are
        left out.
    frequency_hz : ndarray, shape (n_frequencies,)
        Of the windows, those that lie in a band.
    band : ndarray of int, shape (n_frequencies,)
        Rising.
    passing : ndarray of complex, shape (n_frequencies,)
        What the mount is over what `ThroughMount` does to samples.
    """

    centre_hz: FloatArray
    frequency_hz: FloatArray
    band: IntArray
    passing: ComplexArray

    @classmethod
    def of(cls, window: int, sample_rate_hz: float, mount: TransferFunction | None) -> "Bands":
        """Return the bands of windows of so many samples.

        Parameters
        ----------
        window : int
            Samples of a window.
        sample_rate_hz : float
            Samples per second of the device's clock.
        mount : TransferFunction or None
            Frequencies at which it bends too fast for the window are left out.
        """
        every = np.linspace(0.0, sample_rate_hz / 2.0, window // 2 + 1)[1:-1]
        number = np.rint(PER_OCTAVE * np.log2(every / 1000.0))
        middle = 1000.0 * 2.0 ** (number / PER_OCTAVE)
        within = (middle >= RANGE_HZ[0] / EDGE) & (middle <= RANGE_HZ[1] * EDGE)
        within &= _bend(mount, every, sample_rate_hz / window) <= MOST_BEND
        _, band = np.unique(number[within], return_inverse=True)
        centre = np.bincount(band, every[within]) / np.bincount(band)
        passing = ThroughMount(mount, sample_rate_hz).remainder(every[within])
        return cls(centre, every[within], band.astype(np.int64), passing)

    @property
    def lines(self) -> FloatArray:
        """How many frequencies each band has, shape (n_bands,)."""
        return np.bincount(self.band).astype(np.float64)

    def total(self, spectra: NDArray[np.complex128 | np.float64]) -> ComplexArray:
        """Return the sums over windows and over the frequencies of each band, (n_bands,).

        Parameters
        ----------
        spectra : ndarray, shape (n_windows, n_frequencies)
        """
        starts = np.flatnonzero(np.diff(self.band, prepend=-1))
        summed: ComplexArray = np.add.reduceat(spectra.sum(axis=0), starts).astype(complex)
        return summed

    def mean(self, weight: FloatArray, values: FloatArray) -> FloatArray:
        """Return the mean of values over the frequencies of each band, (n_bands,).

        A response that is averaged over a band is weighed by what each frequency has of what it
        is seen through, and so is what it depends on.

        Parameters
        ----------
        weight, values : ndarray, shape (n_frequencies,)
        """
        total = np.maximum(self.total(weight[np.newaxis]).real, np.finfo(float).tiny)
        mean: FloatArray = self.total((weight * values)[np.newaxis]).real / total
        return mean

    def averages(self, windows: int) -> FloatArray:
        """Return how many independent averages so many half overlapping windows are.

        One frequency of a Hann window counts as 1.9 of those next to it together: its noise
        bandwidth.
        """
        return 0.5 * windows * (self.lines + 0.9)


def _bend(
    mount: TransferFunction | None, frequency_hz: FloatArray, step_hz: float
) -> FloatArray:
    """Return how far the mount's response is from that of its neighbours, as a share."""
    if mount is None:
        return np.zeros(frequency_hz.size)
    at, below, above = (
        mount.frequency_response(frequency_hz + off) for off in (0.0, -step_hz, step_hz)
    )
    bend: FloatArray = np.abs(below * above / np.square(at) - 1.0)
    return bend

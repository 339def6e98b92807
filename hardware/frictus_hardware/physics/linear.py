"""Linear time-invariant parts: transfer functions in s, and their exact sampled simulation."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from frictus_hardware.arrays import FloatArray


@dataclass(frozen=True, slots=True)
class TransferFunction:
    """A rational function of s, rad/s.

    Attributes
    ----------
    numerator, denominator : tuple of float
        Polynomials in s, highest power first. For a simulation the numerator must not be of
        higher order than the denominator, and the last denominator coefficient not zero.
    """

    numerator: tuple[float, ...]
    denominator: tuple[float, ...]

    def __mul__(self, other: "TransferFunction") -> "TransferFunction":
        """Return the two in series."""
        return TransferFunction(
            tuple(np.polymul(self.numerator, other.numerator).tolist()),
            tuple(np.polymul(self.denominator, other.denominator).tolist()),
        )

    def frequency_response(self, frequency_hz: FloatArray) -> NDArray[np.complex128]:
        """Return the response at ``s = 2 pi i f``, f in Hz."""
        s = 2j * np.pi * np.asarray(frequency_hz, dtype=np.float64)
        response: NDArray[np.complex128] = np.polyval(self.numerator, s) / np.polyval(
            self.denominator, s
        )
        return response


@dataclass(frozen=True, slots=True)
class SampledFilter:
    """A transfer function at one sample rate; its state is carried by the caller.

    Attributes
    ----------
    numerator, denominator : ndarray
        Polynomials in 1/z.
    """

    numerator: FloatArray
    denominator: FloatArray

    def at_rest(self, n_channels: int) -> FloatArray:
        """Return the state before a first sample of zero, shape (order, n_channels)."""
        return np.zeros((self.denominator.size - 1, n_channels))

    def run(self, signal_in: FloatArray, state: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Filter along axis 0.

        Parameters
        ----------
        signal_in : ndarray, shape (n_samples, n_channels)
        state : ndarray, shape (order, n_channels)
            From `at_rest` or the run before; it is not changed.

        Returns
        -------
        signal_out : ndarray, shape (n_samples, n_channels)
        state : ndarray, shape (order, n_channels)
        """
        from scipy import signal  # late: it takes a second, and many only need the responses

        out, state = signal.lfilter(
            self.numerator, self.denominator, signal_in, axis=0, zi=state
        )
        return out, state


@lru_cache(maxsize=64)
def sample(transfer: TransferFunction, sample_rate_hz: float) -> SampledFilter:
    """Discretise by first-order hold: exact where the input runs straight between samples.

    Parameters
    ----------
    transfer : TransferFunction
        Proper, in s.
    sample_rate_hz : float

    Raises
    ------
    ValueError
        If the transfer function is improper or has a pole at s = 0.
    """
    order = len(transfer.denominator) - 1
    if len(transfer.numerator) > order + 1 or transfer.denominator[-1] == 0.0:
        raise ValueError("the transfer function must be proper and without a pole at s = 0")
    # In units of its own time scale the coefficients are near 1. In seconds they differ by
    # scale**order, 1e16 for the mount, and the matrix exponential would lose digits.
    scale = abs(transfer.denominator[-1] / transfer.denominator[0]) ** (1.0 / order)
    denominator = _rescale(transfer.denominator, scale)
    numerator = _rescale(transfer.numerator, scale) / denominator[0]
    return _first_order_hold(numerator, denominator / denominator[0], scale / sample_rate_hz)


def _first_order_hold(
    numerator: FloatArray, denominator: FloatArray, step: float
) -> SampledFilter:
    """Return the filter that is exact where the input runs straight from sample to sample.

    The state, in controllable canonical form, and the input move by the exponential of their
    rates together (Franklin, Powell and Workman, Digital Control of Dynamic Systems, 3rd ed.,
    6.3.2).

    Parameters
    ----------
    numerator, denominator : ndarray
        Polynomials in s; proper and monic.
    step : float
        Between samples, in the time that 1/s is in.
    """
    # Late, because many only need the responses; `scipy.signal` would load half of scipy.
    from scipy import linalg

    order = denominator.size - 1
    padded = np.concatenate([np.zeros(order + 1 - numerator.size), numerator])
    output = padded[1:] - padded[0] * denominator[1:]
    rates = np.zeros((order + 2, order + 2))
    rates[0, :order] = -step * denominator[1:]
    rates[1:order, : order - 1] = step * np.eye(order - 1)
    rates[0, order] = step
    rates[order, order + 1] = 1.0
    moves = linalg.expm(rates)[:order]
    move, ramp = moves[:, :order], moves[:, order + 1]
    drive = moves[:, order] - ramp + move @ ramp
    poles = np.asarray(np.poly(move), dtype=np.float64)
    zeros = np.asarray(np.poly(move - np.outer(drive, output)), dtype=np.float64)
    return SampledFilter(zeros + (padded[0] + output @ ramp - 1.0) * poles, poles)


def _rescale(polynomial: tuple[float, ...], scale: float) -> FloatArray:
    powers = np.arange(len(polynomial) - 1, -1, -1)
    return np.asarray(polynomial, dtype=np.float64) * scale**powers

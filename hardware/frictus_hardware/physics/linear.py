"""Linear time-invariant parts: transfer functions, the finger's skin, mount and sensor.

What stands between the screen and its force sensor: tape and sensor, which resonate.

Paper, Appendix B, with two slips mended. The printed response carries an extra s, as from
force to velocity, which would add 45 dB at 30 Hz and 82 dB at 2 kHz to a ratio of two forces.
The printed damping of the tape's pole, 0.0001 rad/s, would let it ring for hours; it is taken
as that of its zero, 92 rad/s.
"""

import math
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

    def frequency_response(self, per_sample: FloatArray) -> NDArray[np.complex128]:
        """Return the response at frequencies in cycles per sample."""
        late = np.arange(self.numerator.size)  # both polynomials have as many coefficients
        back: NDArray[np.complex128] = np.exp(-2j * np.pi * np.multiply.outer(per_sample, late))
        response: NDArray[np.complex128] = (back @ self.numerator) / (back @ self.denominator)
        return response


@lru_cache(maxsize=512)  # a model of 64 effects has 448 filters, asked for in every block
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


@dataclass(frozen=True, slots=True)
class Mobility:
    """``v(s) / F(s) = s / (m s^2 + b s + k)``: friction force to skin velocity.

    The defaults are the paper's example at 40 mm/s and 0.2 N.

    Attributes
    ----------
    mass_kg : float
        m, the moving mass of the finger pad.
    damping_n_s_m : float
        b.
    stiffness_n_m : float
        k.
    """

    mass_kg: float = 0.0015
    damping_n_s_m: float = 1.3
    stiffness_n_m: float = 444.0

    @property
    def velocity(self) -> TransferFunction:
        """Skin velocity per newton of friction, m/s/N."""
        return TransferFunction((1.0, 0.0), self._denominator)

    @property
    def acceleration(self) -> TransferFunction:
        """Skin acceleration per newton of friction, m/s²/N."""
        return TransferFunction((1.0, 0.0, 0.0), self._denominator)

    @property
    def _denominator(self) -> tuple[float, float, float]:
        return (self.mass_kg, self.damping_n_s_m, self.stiffness_n_m)


@dataclass(frozen=True, slots=True)
class Mount:
    """Force of the finger on the screen to force at the sensor, newton to newton.

    The lateral gain at rest is ``(922 / 856)^2 = 1.160``: left in, it makes an estimated gain
    16 % too large.

    Attributes
    ----------
    sensor_hz, sensor_damping_ratio : float
        Resonance of the sensor along the screen.
    tape_zero_hz, tape_pole_hz : float
        The pair that the tape adds.
    tape_damping_rad_s : float
        Coefficient of s of both.
    normal_hz, normal_damping_ratio : float
        Resonance into the screen; its gain at rest is 1.
    """

    sensor_hz: float = 1714.0
    sensor_damping_ratio: float = 0.06
    tape_zero_hz: float = 922.0
    tape_pole_hz: float = 856.0
    tape_damping_rad_s: float = 92.0
    normal_hz: float = 1454.0
    normal_damping_ratio: float = 0.011

    @property
    def lateral(self) -> TransferFunction:
        """Response along the screen, x and y."""
        return _lateral(self)

    @property
    def normal(self) -> TransferFunction:
        """Response into the screen, z."""
        return second_order(self.normal_hz, self.normal_damping_ratio)


@lru_cache(maxsize=16)  # asked for in every block of a simulation
def _lateral(mount: Mount) -> TransferFunction:
    tape = TransferFunction(
        (1.0, mount.tape_damping_rad_s, _rad_s(mount.tape_zero_hz) ** 2),
        (1.0, mount.tape_damping_rad_s, _rad_s(mount.tape_pole_hz) ** 2),
    )
    return second_order(mount.sensor_hz, mount.sensor_damping_ratio) * tape


def with_moved_resonance(mount: TransferFunction, share: float) -> TransferFunction:
    """Return a mount whose highest resonance lies elsewhere.

    The pole pair of highest natural frequency moves to ``1 + share`` times its frequency, with
    the same damping ratio and the same gain at rest. A mount without resonance stays as it is.

    Parameters
    ----------
    mount : TransferFunction
        Force to force, in s.
    share : float
        Above -1.
    """
    poles = np.roots(mount.denominator)
    resonant = poles[poles.imag > 0.0]
    if share == 0.0 or not resonant.size:
        return mount
    pole = resonant[np.argmax(np.abs(resonant))]
    natural, damping = abs(pole) ** 2, -2.0 * pole.real
    rest, _ = np.polydiv(mount.denominator, [1.0, damping, natural])
    times = 1.0 + share
    moved = np.polymul(rest, [1.0, damping * times, natural * times**2])
    numerator = np.asarray(mount.numerator) * times**2
    return TransferFunction(tuple(numerator.tolist()), tuple(moved.tolist()))


def second_order(natural_hz: float, damping_ratio: float) -> TransferFunction:
    """Return a resonance whose gain at rest is 1.

    Parameters
    ----------
    natural_hz : float
        Above zero.
    damping_ratio : float
        Of critical damping.
    """
    natural = _rad_s(natural_hz)
    return TransferFunction((natural**2,), (1.0, 2.0 * damping_ratio * natural, natural**2))


def _rad_s(frequency_hz: float) -> float:
    return 2.0 * math.pi * frequency_hz

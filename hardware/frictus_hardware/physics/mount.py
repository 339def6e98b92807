"""What stands between the screen and its force sensor: tape and sensor, which resonate.

Paper, Appendix B, with two slips mended. The printed response carries an extra s, as from
force to velocity, which would add 45 dB at 30 Hz and 82 dB at 2 kHz to a ratio of two forces.
The printed damping of the tape's pole, 0.0001 rad/s, would let it ring for hours; it is taken
as that of its zero, 92 rad/s.
"""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from frictus_hardware.physics.linear import TransferFunction


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
        return _resonance(self.normal_hz, self.normal_damping_ratio)


@lru_cache(maxsize=16)  # asked for in every block of a simulation
def _lateral(mount: Mount) -> TransferFunction:
    tape = TransferFunction(
        (1.0, mount.tape_damping_rad_s, _rad_s(mount.tape_zero_hz) ** 2),
        (1.0, mount.tape_damping_rad_s, _rad_s(mount.tape_pole_hz) ** 2),
    )
    return _resonance(mount.sensor_hz, mount.sensor_damping_ratio) * tape


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


def _resonance(natural_hz: float, damping_ratio: float) -> TransferFunction:
    natural = _rad_s(natural_hz)
    return TransferFunction((natural**2,), (1.0, 2.0 * damping_ratio * natural, natural**2))


def _rad_s(frequency_hz: float) -> float:
    return 2.0 * math.pi * frequency_hz

"""Signals as the force sensor would have them: sent through the model of the mount.

The friction that is measured went through the mount. Divided out of the spectrum of a tenth of
a second, a mount that rings makes the friction wrong by up to 5 % at the edges of what is
played, where the window mixes more from one side than from the other. Where all that friction
is compared with went through the same mount, the windows do the same to both.
"""

from typing import Final

import numpy as np

from frictus_hardware.arrays import ComplexArray, FloatArray
from frictus_hardware.physics import linear
from frictus_hardware.physics.linear import TransferFunction

SETTLED_S: Final = 0.5
"""After so long of the first values the mount stands still."""
RINGS_S: Final = 0.1
"""So long after a gap what was missing still rings."""


class ThroughMount:
    """Sends channels through a mount, part by part.

    Parameters
    ----------
    mount : TransferFunction
        Between screen and force sensor, lateral, force to force.
    sample_rate_hz : float
        Samples per second of the channels.
    """

    def __init__(self, mount: TransferFunction, sample_rate_hz: float) -> None:
        self._filter = linear.sample(mount, sample_rate_hz)
        self._settled = round(SETTLED_S * sample_rate_hz)
        self._state: FloatArray | None = None

    def begin(self) -> None:
        """Forget what was sent through so far."""
        self._state = None

    def take(self, samples: FloatArray) -> FloatArray:
        """Return samples through the mount; before the first they stood at its values.

        Parameters
        ----------
        samples : ndarray, shape (n_samples, n_channels)
            What follows on what was taken before; none missing.
        """
        if self._state is None:
            still = np.repeat(samples[:1], self._settled, axis=0)
            _, self._state = self._filter.run(still, self._filter.at_rest(samples.shape[1]))
        passed, self._state = self._filter.run(samples, self._state)
        return passed


def remainder(
    mount: TransferFunction | None, sample_rate_hz: float, frequency_hz: FloatArray
) -> ComplexArray:
    """Return what a mount is over what `ThroughMount` does to samples, smooth, shape (n,).

    Parameters
    ----------
    mount : TransferFunction or None
        None: 1 throughout.
    sample_rate_hz : float
        Samples per second.
    frequency_hz : ndarray, shape (n,)
    """
    if mount is None:
        return np.ones(frequency_hz.size, dtype=np.complex128)
    sampled = linear.sample(mount, sample_rate_hz)
    done = sampled.frequency_response(frequency_hz / sample_rate_hz)
    return mount.frequency_response(frequency_hz) / done


def sent_through(
    mount: TransferFunction | None, sample_rate_hz: float, samples: FloatArray
) -> FloatArray:
    """Return whole channels through a mount.

    Parameters
    ----------
    mount : TransferFunction or None
        None: as they are.
    sample_rate_hz : float
        Samples per second.
    samples : ndarray, shape (n_samples, n_channels)
        NaN where missing.

    Returns
    -------
    ndarray, shape (n_samples, n_channels)
        NaN also for `RINGS_S` after what is missing.
    """
    if mount is None or not samples.size:
        return samples
    lacking = ~np.isfinite(samples)
    passed = ThroughMount(mount, sample_rate_hz).take(np.where(lacking, 0.0, samples))
    if lacking.any():
        known = np.arange(samples.shape[0])[:, np.newaxis]
        last = np.maximum.accumulate(np.where(lacking, known, -samples.shape[0]), axis=0)
        passed[known - last <= RINGS_S * sample_rate_hz] = np.nan
    return passed

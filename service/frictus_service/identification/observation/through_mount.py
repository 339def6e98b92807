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
    """Sends channels through a mount, part by part; without a mount they stay as they are.

    Parameters
    ----------
    mount : TransferFunction or None
        Between screen and force sensor, lateral, force to force.
    sample_rate_hz : float
        Samples per second of the channels.
    """

    def __init__(self, mount: TransferFunction | None, sample_rate_hz: float) -> None:
        self._mount, self._rate_hz = mount, sample_rate_hz
        self._filter = None if mount is None else linear.sample(mount, sample_rate_hz)
        self.begin()

    def begin(self) -> None:
        """Forget what was sent through so far."""
        self._state: FloatArray | None = None
        self._lacked: FloatArray | float = -np.inf  # place of what was missing last

    def take(self, samples: FloatArray) -> FloatArray:
        """Return samples through the mount; before the first they stood at its values.

        Parameters
        ----------
        samples : ndarray, shape (n_samples, n_channels)
            What follows on what was taken before; NaN where missing.

        Returns
        -------
        ndarray, shape (n_samples, n_channels)
            NaN also for `RINGS_S` after what is missing.
        """
        if self._filter is None or not samples.size:
            return samples
        lacking = ~np.isfinite(samples)
        known = np.where(lacking, 0.0, samples)
        if self._state is None:
            still = np.repeat(known[:1], round(SETTLED_S * self._rate_hz), axis=0)
            _, self._state = self._filter.run(still, self._filter.at_rest(samples.shape[1]))
        passed, self._state = self._filter.run(known, self._state)
        if lacking.any() or np.any(self._lacked > -np.inf):
            place = np.arange(float(samples.shape[0]))[:, np.newaxis]
            last = np.maximum.accumulate(np.where(lacking, place, self._lacked), axis=0)
            passed[place - last <= RINGS_S * self._rate_hz] = np.nan
            self._lacked = last[-1] - samples.shape[0]
        return passed

    def remainder(self, frequency_hz: FloatArray) -> ComplexArray:
        """Return what the mount is over what is done to samples, smooth, shape (n,).

        Parameters
        ----------
        frequency_hz : ndarray, shape (n,)
        """
        if self._mount is None or self._filter is None:
            return np.ones(frequency_hz.size, dtype=np.complex128)
        done = self._filter.frequency_response(frequency_hz / self._rate_hz)
        return self._mount.frequency_response(frequency_hz) / done

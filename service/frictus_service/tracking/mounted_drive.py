"""The drive as the force sensor would have it: sent through the model of the mount.

The friction that is measured went through the mount. Divided out of the spectrum of a tenth of
a second, a mount that rings makes the friction wrong by up to 5 % at the edges of what is
played, where the window mixes more from one side than from the other. Where drive and
friction went through the same mount, the windows do the same to both.
"""

from typing import Final

import numpy as np

from frictus_hardware.arrays import ComplexArray, FloatArray
from frictus_hardware.physics import linear
from frictus_hardware.physics.linear import TransferFunction
from frictus_service.identification.observation.response import hold

SETTLED_S: Final = 0.5
"""After so long of the first value the mount stands still."""


class MountedDrive:
    """Sends a drive through a mount, part by part.

    Parameters
    ----------
    mount : TransferFunction or None
        Between screen and force sensor, lateral, force to force.
    sample_rate_hz : float
        Samples per second of the drive.
    frequency_hz : ndarray, shape (n,)
        At which spectra of the drive are taken.

    Attributes
    ----------
    remainder : ndarray of complex, shape (n,)
        What the held drive and the mount are over what was done to the samples.
    """

    def __init__(
        self, mount: TransferFunction | None, sample_rate_hz: float, frequency_hz: FloatArray
    ) -> None:
        self.remainder: ComplexArray = hold(frequency_hz, sample_rate_hz)
        self._filter = None if mount is None else linear.sample(mount, sample_rate_hz)
        if mount is not None and self._filter is not None:
            sampled = self._filter.frequency_response(frequency_hz / sample_rate_hz)
            self.remainder = self.remainder * mount.frequency_response(frequency_hz) / sampled
        self._settled = round(SETTLED_S * sample_rate_hz)
        self._state: FloatArray | None = None

    def begin(self) -> None:
        """Forget what was sent through so far."""
        self._state = None

    def take(self, drive: FloatArray) -> FloatArray:
        """Return the drive through the mount; before it began it stood at its first value.

        Parameters
        ----------
        drive : ndarray, shape (n_samples,)
            What follows on what was taken before.
        """
        if self._filter is None:
            return drive
        if self._state is None:
            still = np.full((self._settled, 1), drive[0])
            _, self._state = self._filter.run(still, self._filter.at_rest(1))
        passed, self._state = self._filter.run(drive[:, np.newaxis], self._state)
        return passed[:, 0]

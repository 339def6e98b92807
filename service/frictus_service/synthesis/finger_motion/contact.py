"""Whether a finger touches the screen: by the force within a block, by the touch sensor later.

The force sensor has an offset that drifts; it is estimated while the touch sensor reports no
contact. Where the force contradicts the touch sensor for longer than reports are late, the
force sensor has failed or something else loads the screen: then the touch sensor alone
decides, until both agree again.
"""

import math
from typing import Final

import numpy as np

from frictus_hardware.arrays import FloatArray

PRESSED_N: Final = 0.03
"""Above the offset; a finger that slides presses with 0.05 N at least."""
RELEASED_N: Final = 0.02
NEWEST: Final = 4
"""Only the last part of a block, one over this, says how it is now."""
OFFSET_S: Final = 1.0
"""Within which the offset is learned anew."""
CONTRADICTED_S: Final = 0.2
"""Longer than any touch report takes."""
FORGIVEN: Final = 0.25
"""Of a contradiction, by so much agreement; each contact begins and ends with a short one."""
AGREED_S: Final = 0.5
LARGEST_OFFSET_N: Final = 1.0


class ContactDetector:
    """Follows force and reports; nobody touches to begin with."""

    def __init__(self) -> None:
        self._reported: bool | None = None
        self._pressed = False
        self._offset_n = 0.0
        self._apart_s = 0.0
        self._agreed_s = 0.0
        self._by_force = True
        self._sensed = False

    @property
    def in_contact(self) -> bool:
        """Whether a finger touches."""
        if self._reported is None:
            return False
        return self._pressed if self.by_force else self._reported

    @property
    def by_force(self) -> bool:
        """Whether the force says so, and not the touch sensor."""
        return self._sensed and self._by_force

    def report(self, in_contact: bool) -> None:
        """Take what the touch sensor says."""
        self._reported = in_contact

    def sense(self, normal_n: FloatArray, block_s: float) -> None:
        """Take the normal force of a block.

        Parameters
        ----------
        normal_n : ndarray, shape (n_samples,)
        block_s : float
            Its duration.
        """
        newest = normal_n[-max(1, normal_n.size // NEWEST) :]
        force_n = float(np.add.reduce(newest)) / newest.size
        self._sensed = math.isfinite(force_n) and bool((newest != newest[0]).any())
        if not self._sensed or self._reported is None:
            return
        above_n = force_n - self._offset_n
        self._pressed = above_n > (RELEASED_N if self._pressed else PRESSED_N)
        agrees = self._pressed == self._reported
        self._agreed_s = self._agreed_s + block_s if agrees else 0.0
        self._apart_s = max(self._apart_s + (-FORGIVEN if agrees else 1.0) * block_s, 0.0)
        if self._by_force:
            self._by_force = self._apart_s < CONTRADICTED_S
        elif self._agreed_s > AGREED_S:
            self._by_force, self._apart_s = True, 0.0
        if not self._reported and abs(force_n) < LARGEST_OFFSET_N:
            at_rest = not self._pressed or not self._by_force
            self._offset_n += at_rest * min(block_s / OFFSET_S, 1.0) * above_n

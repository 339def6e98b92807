"""Whether a finger touches the screen: by the force within a block, by the touch sensor later.

The force sensor has an offset that drifts; it is estimated while the touch sensor reports no
contact. Where the force contradicts the touch sensor for longer than reports are late, the
force sensor has failed or something else loads the screen: then the touch sensor alone
decides, until both agree again. But a touch sensor that reports one place again and again has
failed itself as likely, and a finger at rest feels nothing: without a force it is not believed
until the place changes. What loads the screen meanwhile is learned as offset, unless
it was a finger all the time: then the touch sensor finds one without a rise of the force.
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
STILL_S: Final = 0.1
"""Before a force that says otherwise has contradicted the touch sensor for long enough."""
FORGIVEN: Final = 0.25
"""Of a contradiction, by so much agreement; each contact begins and ends with a short one."""
AGREED_S: Final = 0.5
LARGEST_OFFSET_N: Final = 1.0
UNLOADED_S: Final = 0.05
"""Likewise where the force is below the offset: whatever touches the screen only adds to it."""
LATELY_S: Final = 0.25
"""Over which the force without contact is averaged; longer than a report of contact takes."""
LANDED_S: Final = 0.1
"""After a report of contact, within which the force of a finger that has landed has risen."""


class ContactDetector:
    """Follows force and reports; nobody touches to begin with."""

    def __init__(self) -> None:
        self._reported: bool | None = None
        self._still = False
        self._pressed = False
        self._offset_n = 0.0
        self._doubted = False  # since force and touch sensor contradicted, until a landing
        self._sure_offset_n = 0.0  # as it was before
        self._lately_n = 0.0
        self._landing_s: float | None = None
        self._apart_s = 0.0
        self._agreed_s = 0.0
        self._by_force = True
        self._sensed = False

    @property
    def in_contact(self) -> bool:
        """Whether a finger touches."""
        if self._reported is None:
            return False
        if self.by_force:
            return self._pressed
        return self._reported and (self._pressed or not (self._sensed and self._still))

    @property
    def by_force(self) -> bool:
        """Whether the force says so, and not the touch sensor."""
        return self._sensed and self._by_force

    def report(self, in_contact: bool, still: bool = False) -> None:
        """Take what the touch sensor says.

        Parameters
        ----------
        in_contact : bool
            Whether it sees a finger.
        still : bool
            Whether it has seen it at the same place, to the last bit, for `STILL_S`.
        """
        if in_contact and self._reported is False and self._doubted:
            self._landing_s = 0.0
        self._reported = in_contact
        self._still = in_contact and still

    def sense(self, normal_n: FloatArray, block_s: float, reported: bool = True) -> None:
        """Take the normal force of a block.

        Parameters
        ----------
        normal_n : ndarray, shape (n_samples,)
        block_s : float
            Its duration.
        reported : bool
            Whether reports come. Where they have stopped, the last one contradicts nothing: it
            is the touch sensor that has failed.
        """
        newest = normal_n[-max(1, normal_n.size // NEWEST) :]
        force_n = float(np.add.reduce(newest)) / newest.size
        self._sensed = math.isfinite(force_n) and bool((newest != newest[0]).any())
        if not self._sensed or self._reported is None:
            return
        if reported:
            self._follow_landing(force_n, block_s)
        above_n = force_n - self._offset_n
        self._pressed = above_n > (RELEASED_N if self._pressed else PRESSED_N)
        if reported:
            self._compare(force_n, above_n, block_s)

    def _compare(self, force_n: float, above_n: float, block_s: float) -> None:
        """Judge the force by the touch sensor, and learn its offset where nobody touches."""
        agrees = self._pressed == self._reported
        self._agreed_s = self._agreed_s + block_s if agrees else 0.0
        apart = -FORGIVEN if agrees else float(not self._still)
        self._apart_s = max(self._apart_s + apart * block_s, 0.0)
        if self._by_force:
            self._by_force = self._apart_s < CONTRADICTED_S
            self._doubted |= not self._by_force
        elif self._agreed_s > AGREED_S:
            self._by_force, self._apart_s = True, 0.0
        if not self._reported and abs(force_n) < LARGEST_OFFSET_N:
            at_rest = not self._pressed or not self._by_force
            within_s = UNLOADED_S if above_n < -PRESSED_N else OFFSET_S
            self._offset_n += at_rest * min(block_s / within_s, 1.0) * above_n
            self._lately_n += min(block_s / LATELY_S, 1.0) * (force_n - self._lately_n)
            if not self._doubted:
                self._sure_offset_n = self._offset_n

    def _follow_landing(self, force_n: float, block_s: float) -> None:
        """Take the offset back that was learned while the touch sensor saw no finger.

        A finger that lands adds to the force. Where it does not rise, there was one before.
        """
        if self._landing_s is None:
            return
        self._landing_s += block_s
        if not self._reported:
            self._landing_s = None
        elif force_n > self._lately_n + PRESSED_N:
            self._landing_s, self._doubted = None, False
        elif self._landing_s >= LANDED_S:
            self._landing_s, self._doubted = None, False
            self._offset_n = self._sure_offset_n

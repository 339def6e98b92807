"""Position and velocity of a finger, from touch reports and the acceleration of its nail.

Kalman filters with interacting models of the finger estimate position, velocity,
acceleration, and gravity: the nail leans slowly, and 1 degree adds 170 mm/s².

A touch report is tens of milliseconds old when it arrives, an acceleration a few: the
measurements are out of sequence. The states after each block of the last quarter of a second
are kept; a report is applied at the time at which it was measured, and the accelerations
since then are applied again.
"""

from math import ceil
from typing import Final, NamedTuple

import numpy as np
from numba import njit

from frictus_hardware.arrays import FloatArray
from frictus_service.synthesis.finger_motion.interacting_models import (
    DEFAULT,
    MODELS,
    InertialTuning,
    mix,
    propagate,
    reweight,
    transition,
    update,
)
from frictus_service.synthesis.finger_motion.nail_acceleration import Acceleration

REMEMBERED_S: Final = 0.25
"""No report that is older is of use."""
REPORTS: Final = 32
"""As many of them as may come meanwhile."""


class FilterStates(NamedTuple):
    """States of the filters after each of the last blocks, in rings of `n_kept`.

    Attributes
    ----------
    mean : ndarray, shape (n_kept, MODELS, 2 axes, 4)
        Position, velocity, acceleration and gravity, mm and s.
    cov : ndarray, shape (n_kept, MODELS, 2 axes, 4, 4)
    weight : ndarray, shape (n_kept, MODELS)
    time_s : ndarray, shape (n_kept,)
        At which they hold.
    """

    mean: FloatArray
    cov: FloatArray
    weight: FloatArray
    time_s: FloatArray


class InertialFilter:
    """Follows a finger block by block.

    Parameters
    ----------
    block_s : float
        Duration of a block.
    tuning : InertialTuning
        What is assumed of fingers and sensors.

    Attributes
    ----------
    follows : bool
        Whether there is a finger to follow.
    """

    def __init__(self, block_s: float, tuning: InertialTuning = DEFAULT) -> None:
        self._tuning = tuning
        self._stay = tuning.stay ** (block_s / tuning.stay_s)
        kept = self._kept = ceil(REMEMBERED_S / block_s) + 1
        self._states = FilterStates(
            np.zeros((kept, MODELS, 2, 4)),
            np.zeros((kept, MODELS, 2, 4, 4)),
            np.zeros((kept, MODELS)),
            np.zeros(kept),
        )
        # [block, (when; along x, y; their variances)]
        self._accelerations = np.zeros((kept, 5))
        self._reports = np.full((REPORTS, 3), -np.inf)
        self._predicted = np.zeros((2, 2))
        self._blocks = self._oldest = 0
        self.follows = False

    def begin(
        self,
        time_s: float,
        position_mm: tuple[float, float],
        velocity_mm_s: tuple[float, float],
    ) -> None:
        """Begin anew where a finger was; accelerations since then are applied.

        Parameters
        ----------
        time_s : float
            When it was there.
        position_mm, velocity_mm_s : tuple of float
            Along x and y.
        """
        self.follows = self._blocks > 0
        if not self.follows:
            return
        self._reports[:] = -np.inf
        self._reports[-1, 0] = time_s
        self._oldest = max(0, self._blocks - self._kept)
        block = self._block_before(time_s, self._accelerations[:, 0])
        self._oldest = block
        slot = block % self._kept
        _begin(self._tuning, position_mm, velocity_mm_s, slot, self._states)
        self._states.time_s[slot] = time_s
        self._go_on(block + 1)

    def follow(
        self, end_s: float, acceleration: Acceleration | None, reported: bool = True
    ) -> None:
        """Take in a block.

        Parameters
        ----------
        end_s : float
            Its end.
        acceleration : Acceleration or None
            None where nothing is known of it.
        reported : bool
            Whether reports say where the finger is. Without them the acceleration is kept for
            `begin` alone: gravity that changes, as with a hand that is turned above the screen,
            would be summed up to metres per second, and to what is no number.
        """
        row = self._accelerations[self._blocks % self._kept]
        row[0], row[3:] = end_s, np.inf
        self._blocks += 1
        self._oldest = max(self._oldest, self._blocks - self._kept)
        if acceleration is not None:
            row[0] -= acceleration.age_s
        if self.follows and not reported:
            self._go_on(self._blocks - 1)
        if acceleration is not None:
            row[1:3], row[3:] = acceleration.mm_s2, acceleration.variance
        if self.follows and reported:
            self._go_on(self._blocks - 1)

    def observe(self, time_s: float, x_mm: float, y_mm: float) -> None:
        """Apply a report at its own time; one that is older than another, or too old, is not.

        Parameters
        ----------
        time_s : float
            When the finger was there.
        x_mm, y_mm : float
            Where.
        """
        if not (self.follows and time_s > self._reports[-1, 0]):
            return
        self._reports[:-1] = self._reports[1:]
        self._reports[-1] = time_s, x_mm, y_mm
        block = self._block_before(time_s, self._states.time_s)
        self._go_on(block + 1)

    def predict(self, time_s: float) -> FloatArray:
        """Return position and velocity at a time, shape (2 axes, 2); valid until the next."""
        slot = (self._blocks - 1) % self._kept
        _predict(self._tuning, time_s, slot, self._states, self._predicted)
        return self._predicted

    def _block_before(self, time_s: float, times_s: FloatArray) -> int:
        """Return the last block that is not after a time, or the oldest that is remembered."""
        block = self._blocks - 1
        while block > self._oldest and times_s[block % self._kept] > time_s:
            block -= 1
        return block

    def _go_on(self, first: int) -> None:
        """Go from one block to the next, from `first` on."""
        _follow_blocks(
            self._tuning,
            self._stay,
            first,
            self._blocks,
            self._accelerations,
            self._reports,
            self._states,
        )


@njit(cache=True, nogil=True)
def _begin(tuning, position, velocity, slot, states):  # type: ignore[no-untyped-def]
    states.cov[slot] = 0.0
    for m in range(MODELS):
        states.weight[slot, m] = 1.0 / MODELS
        for axis in range(2):
            states.mean[slot, m, axis, 0] = position[axis]
            states.mean[slot, m, axis, 1] = velocity[axis]
            states.mean[slot, m, axis, 2] = 0.0
            states.mean[slot, m, axis, 3] = 0.0
            states.cov[slot, m, axis, 0, 0] = 0.05**2
            states.cov[slot, m, axis, 1, 1] = 80.0**2
            states.cov[slot, m, axis, 2, 2] = tuning.acceleration_mm_s2[m] ** 2
            states.cov[slot, m, axis, 3, 3] = tuning.gravity_mm_s2**2


@njit(cache=True, nogil=True)
def _follow(  # type: ignore[no-untyped-def]
    tuning, stay, before, slot, accelerations, reports, states
):
    """Propagate the states by one block, with the reports within it and its acceleration.

    Parameters
    ----------
    tuning : InertialTuning
        What is assumed of fingers and sensors.
    stay : float
        Probability that a model holds for a block.
    before, slot : int
        Where in the rings both are.
    accelerations : ndarray, shape (n_kept, 5)
    reports : ndarray, shape (REPORTS, 3)
        Time, x and y, by time.
    states : FilterStates
        Those of `slot` are written.
    """
    mean, cov, weight = states.mean[slot], states.cov[slot], states.weight[slot]
    time_s, end_s = states.time_s[before], accelerations[slot, 0]
    mix(
        stay,
        states.mean[before],
        states.cov[before],
        states.weight[before],
        mean,
        cov,
        weight,
    )
    log_likelihood = np.zeros(MODELS)
    for n in range(reports.shape[0]):
        if time_s < reports[n, 0] <= end_s:
            propagate(tuning, reports[n, 0] - time_s, mean, cov)
            time_s = reports[n, 0]
            for m in range(MODELS):
                for axis in range(2):
                    spread = cov[m, axis, 0, 0] + tuning.report_sd_mm**2
                    miss = reports[n, 1 + axis] - mean[m, axis, 0]
                    log_likelihood[m] -= 0.5 * (miss * miss / spread + np.log(spread))
                    update(miss, spread, 0, 0, mean[m, axis], cov[m, axis])
    if end_s > time_s:
        propagate(tuning, end_s - time_s, mean, cov)
        time_s = end_s
    for axis in range(2):
        noise = accelerations[slot, 3 + axis]
        if noise < np.inf:
            for m in range(MODELS):
                spread = noise
                for row in range(2, 4):
                    spread += cov[m, axis, row, 2] + cov[m, axis, row, 3]
                miss = accelerations[slot, 1 + axis] - mean[m, axis, 2] - mean[m, axis, 3]
                log_likelihood[m] -= (
                    0.5 * tuning.likelihood_share * (miss * miss / spread + np.log(spread))
                )
                update(miss, spread, 2, 3, mean[m, axis], cov[m, axis])
    reweight(log_likelihood, weight)
    states.time_s[slot] = time_s


@njit(cache=True, nogil=True)
def _follow_blocks(  # type: ignore[no-untyped-def]
    tuning, stay, first, end, accelerations, reports, states
):
    """Follow the blocks from `first` up to `end`, which a late report makes a dozen."""
    kept = accelerations.shape[0]
    for block in range(first, end):
        before, slot = (block - 1) % kept, block % kept
        _follow(tuning, stay, before, slot, accelerations, reports, states)


@njit(cache=True, nogil=True)
def _predict(tuning, time_s, slot, states, out):  # type: ignore[no-untyped-def]
    ahead_s = max(time_s - states.time_s[slot], 0.0)
    out[:] = 0.0
    total = 0.0
    for m in range(MODELS):
        total += states.weight[slot, m]
    for m in range(MODELS):
        share = states.weight[slot, m] / total
        move = transition(tuning, m, ahead_s)
        for axis in range(2):
            for row in range(2):
                for column in range(3):
                    out[axis, row] += (
                        share * move[row, column] * states.mean[slot, m, axis, column]
                    )

"""The acceleration of a finger, from an accelerometer on its nail.

The sensor also measures how the skin vibrates: while a texture plays, and where friction
reverses at a turn, that is 10 to 100 times the acceleration of the finger as a whole. But the
friction is measured as well, and the skin is a mass on a spring and a damper: its
acceleration is computed from the force and subtracted. Mass, damping, stiffness, and the
delay d between both sensors are estimated all the while: ``F = m a + b v + k x + d dF/dt``,
every term through the same state variable filter (Young 1981), is linear in them. Where the
sensor does not vibrate with the skin, nothing is subtracted.

The rest is averaged over a Hann window. The second difference of the averages contains next
to nothing of the finger's motion: from it follows the variance of their noise. Where they are
noisy all the same, four of them are averaged.
"""

from math import ceil
from typing import Final, NamedTuple

import numpy as np
from numba import njit

from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.linear import Mobility
from frictus_service.synthesis.finger_motion import skin_fit
from frictus_service.synthesis.finger_motion.skin_fit import (
    BEGIN,
    FORGET_S,
    LARGEST_DELAY_S,
    LEFT,
    LINE,
    NOISE,
    RAW,
    RAW_NOISE,
    RESIDUAL,
    SHAKING,
    SUMS,
    TERMS,
)

WINDOW_S: Final = 0.010
"""Averaged over, at least; textures are felt above 20 Hz, a finger moves below."""
BEGIN_N2: Final = 1e-4
"""Variance of the fit's residual at first."""
USUAL_DELAY_S: Final = 5e-4
FOLLOW_DELAY: Final = 0.2
"""Of the delay that was found, by each block."""
UNEXPLAINED: Final = 0.3
"""Share of the shaking that is left by a fit which is worth nothing."""
RELEARN_S: Final = 0.4
"""After so much of that the fit begins anew: a sensor may just have come back."""
PLAUSIBLE: Final = (0.1, 10.0)
"""Of a usual skin; with less stiffness it would pass on a force that does not change."""
SHAKING_M2_S4: Final = 1.0
"""Variance of an acceleration that is worth explaining."""
LEAST_M_S2: Final = 0.05
"""Standard deviation of an average that is always assumed."""
WIDER: Final = np.array([1.0, 3.0, 3.0, 1.0]) / 8.0
WIDER_NOISE: Final = 5.0 / 3.0
"""Variance of white noise through `WIDER`, over that of its second difference."""
QUIETER: Final = 0.2, 0.4
"""Share of the noise that the wider average must leave to be used, and to stay in use."""


class Acceleration(NamedTuple):
    """Average of a finger's acceleration, along x and y.

    Attributes
    ----------
    mm_s2 : ndarray, shape (2,)
        With gravity, as far as the nail leans. Valid until the next block, as `variance`.
    variance : ndarray, shape (2,)
        Of its noise, (mm/s²)².
    age_s : float
        How long before the end of the block it holds.
    """

    mm_s2: FloatArray
    variance: FloatArray
    age_s: float


class NailAcceleration:
    """Follows force and acceleration block by block.

    Parameters
    ----------
    sample_rate_hz : float
        Samples per second of the device's clock.
    block_samples : int
        Samples of every block.
    """

    def __init__(self, sample_rate_hz: float, block_samples: int) -> None:
        self._step_s = 1.0 / sample_rate_hz
        self._block_s = block_samples / sample_rate_hz
        self._largest_delay = min(LARGEST_DELAY_S * sample_rate_hz, LINE - 2.0)
        blocks = max(2, ceil(WINDOW_S / self._block_s))
        window = np.hanning(blocks * block_samples + 2)[1:-1]
        # The newest block weighs as the window's end: row 0 is for a block that ends it.
        self._window = (window / window.sum()).reshape(blocks, block_samples)[::-1].copy()
        self._age_s = 0.5 * blocks * self._block_s
        skin = Mobility()
        self._usual = np.array(
            [skin.mass_kg, skin.damping_n_s_m, skin.stiffness_n_m, USUAL_DELAY_S]
        )
        self._delay = 0.0
        self._forget_fit()
        self.restart()

    @property
    def skin(self) -> Mobility | None:
        """The skin as fitted; None where the nail does not move with the force."""
        if not np.all(self._share[:3] > 0.0):
            return None
        return Mobility(*(self._share * self._usual)[:3].tolist())

    @property
    def delay_s(self) -> float:
        """By which the acceleration is later than the force, as fitted."""
        return self._delay * self._step_s

    def restart(self) -> None:
        """Forget all but the skin: samples are missing."""
        self._filters = np.zeros((2, 3, 3))
        self._lines = np.zeros((2, 2, LINE))
        self._sums = np.zeros((self._window.shape[0], 2, SUMS))
        self._past = np.zeros((2, 2, SUMS))
        self._variances = np.ones((2, 4))
        self._variances[:, RESIDUAL] = BEGIN_N2
        self._averages = np.zeros((6, 2))  # newest first
        self._wider_noise = np.ones(2)
        self._estimate = np.zeros((2, 2))  # the average to use, and its variance
        self._wide = False
        self._unexplained_s = 0.0
        self._blocks = 0

    def follow(self, force_n: FloatArray, accel_m_s2: FloatArray) -> Acceleration | None:
        """Take in a block; return the average that ends with it, None while there is none.

        Parameters
        ----------
        force_n, accel_m_s2 : ndarray, shape (block_samples, 3)
            Of the finger on the screen, and of the nail.
        """
        skin_fit.average(
            force_n,
            accel_m_s2,
            self._step_s,
            self._skin_per_mass(),
            self._delay,
            self._blocks * force_n.shape[0],
            self._lines,
            self._window,
            self._filters,
            self._sums,
        )
        self._blocks += 1
        if not skin_fit.fit(
            self._usual,
            self._block_s,
            self._sums,
            self._past,
            self._share,
            self._share_cov,
            self._variances,
        ):
            self._forget_fit()
            self.restart()
            return None
        self._follow_delay()
        self._judge_fit()
        return self._average()

    def _average(self) -> Acceleration | None:
        """Return the average of the last two blocks, or of four such where that is noisy."""
        self._wide = _take_average(
            min(self._block_s / FORGET_S, 1.0),
            self._sums[0],
            self._variances,
            self._averages,
            self._wider_noise,
            self._wide,
            self._estimate,
        )
        if self._blocks < self._window.shape[0] + 6:
            self._wide = False
            return None
        age_s = self._age_s + max(-self.delay_s, 0.0) + 1.5 * self._block_s * self._wide
        return Acceleration(self._estimate[0], self._estimate[1], age_s)

    def _skin_per_mass(self) -> FloatArray:
        """Return 1 / m, b / m and k / m of the skin as fitted, within what is plausible."""
        low, high = PLAUSIBLE
        mass, damping, stiffness, _ = (
            min(max(share, low), high) * usual
            for share, usual in zip(self._share.tolist(), self._usual.tolist(), strict=True)
        )
        per_mass: FloatArray = np.array([1.0, damping, stiffness]) / mass
        return per_mass

    def _follow_delay(self) -> None:
        """Shift both sensors against one another by a part of the delay that is left."""
        left = FOLLOW_DELAY * float(self._share[3]) * USUAL_DELAY_S / self._step_s
        delay = min(max(self._delay + left, -self._largest_delay), self._largest_delay)
        self._share[3] -= (delay - self._delay) * self._step_s / USUAL_DELAY_S
        self._delay = delay

    def _judge_fit(self) -> None:
        """Begin the fit anew where it has explained nothing for a while, or is no skin's."""
        total = self._variances.sum(axis=0).tolist()
        explained = 6.0 * total[NOISE] < UNEXPLAINED * (total[SHAKING] + SHAKING_M2_S4)
        low, high = PLAUSIBLE
        explained &= all(low < share < high for share in self._share[:3].tolist())
        explained &= abs(self._delay) < self._largest_delay
        self._unexplained_s = 0.0 if explained else self._unexplained_s + self._block_s
        if self._unexplained_s >= RELEARN_S:
            self._forget_fit()
            self._variances[:, RESIDUAL] = BEGIN_N2

    def _forget_fit(self) -> None:
        self._share = np.ones(TERMS)
        self._share[3] = 0.0
        self._share_cov = np.diag(BEGIN**2)
        self._delay = 0.0
        self._unexplained_s = 0.0


@njit(cache=True, nogil=True)
def _take_average(  # type: ignore[no-untyped-def]
    forget, ended, variances, averages, wider_noise, wide, out
):
    """Take up the average that a block has ended; return whether the wider one is used.

    Parameters
    ----------
    forget : float
        Share of the noise of the wider average that one block learns anew.
    ended : ndarray, shape (2 axes, SUMS)
        Of the window that the block ends.
    variances : ndarray, shape (2 axes, 4)
    averages : ndarray, shape (6, 2 axes)
        Newest first. Changed.
    wider_noise : ndarray, shape (2 axes,)
        Variance of the noise of four of them. Changed.
    wide : bool
        Whether the wider one was used.
    out : ndarray, shape (2, 2 axes)
        Written: the average that is used, mm/s^2, and its variance.
    """
    total_noise = 0.0
    for axis in range(2):
        noise, raw_noise = variances[axis, NOISE], variances[axis, RAW_NOISE]
        total_noise += min(noise, raw_noise)
        for age in range(5, 0, -1):
            averages[age, axis] = averages[age - 1, axis]
        averages[0, axis] = ended[axis, LEFT if noise < raw_noise else RAW]
        bend = 0.0
        for age in range(4):
            past = averages[age + 1, axis]
            bend += WIDER[age] * (averages[age, axis] - 2.0 * past + averages[age + 2, axis])
        wider_noise[axis] += forget * (WIDER_NOISE * bend**2 - wider_noise[axis])
    wide = wider_noise[0] + wider_noise[1] < QUIETER[1 if wide else 0] * total_noise
    for axis in range(2):
        if wide:
            average = 0.0
            for age in range(4):
                average += WIDER[age] * averages[age, axis]
            variance = wider_noise[axis]
        else:
            average = averages[0, axis]
            newest = average - 2.0 * averages[1, axis] + averages[2, axis]
            noise = min(variances[axis, NOISE], variances[axis, RAW_NOISE])
            variance = max(noise, 0.05 * newest**2)
        out[0, axis] = 1e3 * average
        out[1, axis] = 1e6 * (variance + LEAST_M_S2**2)
    return wide

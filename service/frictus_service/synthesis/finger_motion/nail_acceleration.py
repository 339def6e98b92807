"""The acceleration of a finger, from an accelerometer on its nail.

The sensor also measures how the skin vibrates: while a texture plays, and where friction
reverses at a turn, that is 10 to 100 times the acceleration of the finger as a whole. The
friction is measured as well, and the skin is a mass on a spring and a damper, ``v / F = s /
(m s² + b s + k)``: its acceleration is computed from the force and subtracted. Mass, damping
and stiffness are estimated continuously: ``a = F / m - (b / m) v - (k / m) x``, every term
through the same state variable filter (Young 1981), is linear in the three coefficients.
Where the sensor does not vibrate with the skin, ``1 / m`` is estimated as 0 and nothing is
subtracted.

The rest is averaged over a Hann window. The second difference of the averages contains next
to nothing of the finger's motion: from it follows the variance of their noise.
"""

from math import ceil
from typing import Final, NamedTuple

import numpy as np
from numba import njit

from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.linear import Mobility

WINDOW_S: Final = 0.010
"""Averaged over, at least; textures are felt above 20 Hz, a finger moves below."""
FILTER_RAD_S: Final = 2.0 * np.pi * 50.0
DAMPING: Final = 1.4 * FILTER_RAD_S
"""Of the state variable filters: a damping ratio of 0.7."""
BEGIN: Final = 0.5
"""Standard deviation of the three numbers at first, over those of a usual skin."""
DRIFT: Final = 0.01
"""By which they may change within a second, of the same."""
UNEXPLAINED: Final = 0.3
"""Share of the shaking that is left by a fit which is worth nothing."""
RELEARN_S: Final = 0.15
"""After so much of that the fit begins anew: a sensor may just have come back."""
LARGEST: Final = 30.0
"""No skin has more of them, of the same; and none has less than 0 of one."""
SHAKING_M2_S4: Final = 1.0
"""Variance of an acceleration that is worth explaining."""
FORGET_S: Final = 0.05
"""Within which noise is judged."""
LEAST_M_S2: Final = 0.05
"""Standard deviation of the average that is always reckoned with."""
SUMS: Final = 5
"""Averages of the acceleration without the skin's, and of what the fit compares."""


class Acceleration(NamedTuple):
    """Average of a finger's acceleration, along x and y.

    Attributes
    ----------
    mm_s2 : ndarray, shape (2,)
        With gravity, as far as the nail leans.
    variance : ndarray, shape (2,)
        Of its noise, (mm/s²)².
    """

    mm_s2: FloatArray
    variance: FloatArray


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
        blocks = max(2, ceil(WINDOW_S / self._block_s))
        window = np.hanning(blocks * block_samples + 2)[1:-1]
        # The newest block weighs as the window's end: row 0 is for a block that ends it.
        self._window = (window / window.sum()).reshape(blocks, block_samples)[::-1].copy()
        skin = Mobility()
        self._usual = np.array([1.0, skin.damping_n_s_m, skin.stiffness_n_m]) / skin.mass_kg
        self._share = np.ones(3)
        self._share_cov = np.eye(3) * BEGIN**2
        self.restart()

    @property
    def age_s(self) -> float:
        """How long before the end of a block its average holds."""
        return float(0.5 * self._window.size * self._step_s)

    @property
    def skin(self) -> Mobility | None:
        """The skin as fitted; None where nothing moves with the force."""
        per_mass, damping, stiffness = (self._share * self._usual).tolist()
        if not min(per_mass, damping, stiffness) > 0.0:
            return None
        return Mobility(1.0 / per_mass, damping / per_mass, stiffness / per_mass)

    def restart(self) -> None:
        """Forget all but the skin: samples are missing."""
        self._filters = np.zeros((2, 3, 3))
        self._sums = np.zeros((self._window.shape[0], 2, SUMS))
        self._past = np.zeros((2, 2, SUMS))
        self._variances = np.ones((2, 3))
        self._unexplained_s = 0.0
        self._blocks = 0

    def follow(self, force_n: FloatArray, accel_m_s2: FloatArray) -> Acceleration | None:
        """Take in a block; return the average that ends with it, None while there is none.

        Parameters
        ----------
        force_n, accel_m_s2 : ndarray, shape (block_samples, 3)
            Of the finger on the screen, and of the nail.
        """
        average = np.empty((2, 2))
        _filter(
            force_n,
            accel_m_s2,
            self._step_s,
            np.clip(self._share, 0.0, LARGEST) * self._usual,
            self._window,
            self._filters,
            self._sums,
        )
        self._blocks += 1
        sound = _fit(
            self._usual,
            self._block_s,
            self._sums,
            self._past,
            self._share,
            self._share_cov,
            self._variances,
            average,
        )
        if not sound:
            self._share[:] = 1.0
            self._share_cov[:] = np.eye(3) * BEGIN**2
            self.restart()
            return None
        self._judge_fit()
        if self._blocks < self._window.shape[0] + 2:
            return None
        return Acceleration(average[0], average[1])

    def _judge_fit(self) -> None:
        """Begin the fit anew where what is subtracted has explained nothing for a while."""
        noise, _, shaking = self._variances.sum(axis=0).tolist()
        explained = 6.0 * noise < UNEXPLAINED * (shaking + SHAKING_M2_S4)
        self._unexplained_s = 0.0 if explained else self._unexplained_s + self._block_s
        if self._unexplained_s >= RELEARN_S:
            self._unexplained_s = 0.0
            self._share_cov[:] = np.eye(3) * BEGIN**2
            self._variances[:, 1] = 1.0


@njit(cache=True, nogil=True)
def _filter(force_n, accel, step, skin, window, filters, sums):  # type: ignore[no-untyped-def]
    """Sum up a block, weighted by the window: see `SUMS`.

    Parameters
    ----------
    force_n, accel : ndarray, shape (n_samples, 3)
    step : float
        From sample to sample, s.
    skin : ndarray, shape (3,)
        1 / m, b / m and k / m.
    window : ndarray, shape (n_blocks, n_samples)
        Row 0 holds the weights of a block that ends the average.
    filters : ndarray, shape (2 axes, 3, 3)
        Skin, and filters of acceleration and force: level, rate and its slope. Changed.
    sums : ndarray, shape (n_blocks, 2 axes, SUMS)
        Of the averages under way, row 0 the one that ends here. Changed.
    """
    n_blocks = window.shape[0]
    for row in range(n_blocks):  # what ends with this block is row 0 from here on
        for axis in range(2):
            for k in range(SUMS):
                sums[row, axis, k] = sums[row + 1, axis, k] if row + 1 < n_blocks else 0.0
    corner = FILTER_RAD_S**2
    for axis in range(2):
        x, dx, ddx = filters[axis, 0, 0], filters[axis, 0, 1], filters[axis, 0, 2]
        slow, dslow, ddslow = filters[axis, 1, 0], filters[axis, 1, 1], filters[axis, 1, 2]
        force, dforce, ddforce = filters[axis, 2, 0], filters[axis, 2, 1], filters[axis, 2, 2]
        for n in range(force_n.shape[0]):
            on_skin, moved = -force_n[n, axis], accel[n, axis]
            x, dx, ddx = _step(skin[0] * on_skin, skin[1], skin[2], step, x, dx, ddx)
            slow, dslow, ddslow = _step(moved, DAMPING, corner, step, slow, dslow, ddslow)
            force, dforce, ddforce = _step(
                on_skin, DAMPING, corner, step, force, dforce, ddforce
            )
            rest = moved - ddx
            for row in range(n_blocks):
                weight = window[row, n]
                sums[row, axis, 0] += weight * rest
                sums[row, axis, 1] += weight * ddslow
                sums[row, axis, 2] += weight * ddforce
                sums[row, axis, 3] -= weight * dslow
                sums[row, axis, 4] -= weight * slow
        filters[axis, 0, 0], filters[axis, 0, 1], filters[axis, 0, 2] = x, dx, ddx
        filters[axis, 1, 0], filters[axis, 1, 1], filters[axis, 1, 2] = slow, dslow, ddslow
        filters[axis, 2, 0], filters[axis, 2, 1], filters[axis, 2, 2] = force, dforce, ddforce


@njit(cache=True, nogil=True, inline="always")
def _step(push, damping, stiffness, step, level, rate, slope):  # type: ignore[no-untyped-def]
    """Return ``y'' = push - damping y' - stiffness y`` a step later, by the trapezoidal rule.

    What it does to the acceleration it does to the force, so that the fit is not off by it.
    """
    half = 0.5 * step
    rate += half * slope
    level += step * rate - half * half * slope
    slope = (push - damping * rate - stiffness * level) / (
        1.0 + half * damping + half * half * stiffness
    )
    return level + half * half * slope, rate + half * slope, slope


@njit(cache=True, nogil=True)
def _fit(  # type: ignore[no-untyped-def]
    usual, block_s, sums, past, share, cov, variances, average
):
    """Write the average that ends here and its variance, and continue the fit of the skin.

    Parameters
    ----------
    usual : ndarray, shape (3,)
        1 / m, b / m and k / m of a usual skin.
    block_s : float
        Duration of a block.
    sums : ndarray, shape (n_blocks, 2 axes, SUMS)
        From `_filter`.
    past : ndarray, shape (2, 2 axes, SUMS)
        The averages of the last two blocks. Changed.
    share, cov : ndarray, shape (3,) and (3, 3)
        The skin over the usual one, and its covariance. Changed.
    variances : ndarray, shape (2 axes, 3)
        Of the averages' noise, of the fit's residual, and of how the nail shakes, m²/s⁴.
        Changed.
    average : ndarray, shape (2, 2)
        Written: the average and its variance along x and y, mm/s².

    Returns
    -------
    bool
        Whether every number is finite.
    """
    cross, gain, bend = np.empty(3), np.empty(3), np.empty(SUMS)
    forget = min(block_s / FORGET_S, 1.0)
    for row in range(3):
        cov[row, row] = min(cov[row, row] + DRIFT**2 * block_s, BEGIN**2)
    for axis in range(2):
        for k in range(SUMS):
            bend[k] = sums[0, axis, k] - 2.0 * past[0, axis, k] + past[1, axis, k]
            past[1, axis, k] = past[0, axis, k]
            past[0, axis, k] = sums[0, axis, k]
        # The second difference of white noise has six times its variance.
        noise = bend[0] * bend[0] / 6.0
        variances[axis, 0] += forget * (noise - variances[axis, 0])
        average[0, axis] = 1e3 * sums[0, axis, 0]
        average[1, axis] = 1e6 * (max(variances[axis, 0], 0.3 * noise) + LEAST_M_S2**2)
        miss = bend[1]
        for row in range(3):
            miss -= share[row] * usual[row] * bend[2 + row]
        spread = variances[axis, 1] + 1e-6
        for row in range(3):
            cross[row] = 0.0
            for column in range(3):
                cross[row] += cov[row, column] * usual[column] * bend[2 + column]
        for row in range(3):
            spread += cross[row] * usual[row] * bend[2 + row]
        variances[axis, 1] += forget * (miss * miss - variances[axis, 1])
        variances[axis, 2] += forget * (bend[1] * bend[1] - variances[axis, 2])
        for row in range(3):
            gain[row] = cross[row] / spread
            share[row] += gain[row] * miss
        for row in range(3):
            for column in range(3):
                cov[row, column] -= gain[row] * cross[column]
    finite = True
    for row in range(3):
        for column in range(row):
            even = 0.5 * (cov[row, column] + cov[column, row])
            cov[row, column] = cov[column, row] = even
        finite = finite and np.isfinite(share[row]) and cov[row, row] > 0.0
    for axis in range(2):
        finite = finite and np.isfinite(average[0, axis]) and np.isfinite(average[1, axis])
    return finite

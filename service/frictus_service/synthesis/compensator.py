"""Plays an inverse block by block, compiled: what undoing a law with effects needs.

The compiled inner loop for a law with effects: what `kernel.invert` alone cannot undo.

Pure functions on arrays, as in `kernel`: they allocate nothing and cannot raise. A state is
carried by the caller.
"""

import numpy as np
from numba import njit

from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.friction import FrictionLaw
from frictus_hardware.physics.schedule import SlidingConditions
from frictus_service.synthesis import kernel
from frictus_service.synthesis.compensation import FORGET_HZ, Inverse
from frictus_service.synthesis.estimator import PredictedMotion
from frictus_service.synthesis.path_compensation import PathInverse


@njit(cache=True, nogil=True)
def invert_scheduled(gain_n, cutoff_hz, motion, speed_range, sample_rate_hz, friction_n, out):  # type: ignore[no-untyped-def]
    """Write the drive at a gain and a cutoff of their own in each sample; return extrapolated.

    As `invert`, but the drive is neither clipped nor counted: more may have to be undone.

    Parameters
    ----------
    gain_n, cutoff_hz : tuple of float
        At the first sample and at the one after the last; linear in between.
    motion : Motion
        Of the finger during the block.
    speed_range : tuple of float
        Slowest and fastest, mm/s, for the count alone.
    sample_rate_hz : float
        Samples per second of the device's clock.
    friction_n : ndarray, shape (n_samples + 1,)
        Target at each sample and at the one after the last, N.
    out : ndarray, shape (n_samples,)
    """
    n_samples = out.size
    extrapolated = 0
    for n in range(n_samples):
        share = n / n_samples
        speed = motion.speed_0 + share * (motion.speed_1 - motion.speed_0)
        if not speed_range[0] <= speed <= speed_range[1]:
            extrapolated += 1
        gain = gain_n[0] + share * (gain_n[1] - gain_n[0])
        cutoff = cutoff_hz[0] + share * (cutoff_hz[1] - cutoff_hz[0])
        decay = np.exp(-2.0 * np.pi * cutoff / sample_rate_hz)
        out[n] = (friction_n[n + 1] - decay * friction_n[n]) / ((1.0 - decay) * gain)
    return extrapolated


@njit(cache=True, nogil=True)
def swap_pairs(zeros, poles, cutoff_hz, sample_rate_hz, state, before, friction_n):  # type: ignore[no-untyped-def]
    """Undo a cascade of pole-zero pairs on a target, in place.

    Each pair ``(1 + s / z) / (1 + s / p)`` becomes ``(1 + s / p) / (1 + s / z)``, which is
    stable as well: ``z / p`` of the input and ``1 - z / p`` of its low-pass at z, whose input
    runs straight from sample to sample.

    Parameters
    ----------
    zeros, poles : ndarray, shape (n_pairs,)
        As multiples of the cutoff.
    cutoff_hz : tuple of float
        At the first sample and at the one after the last; linear in between.
    sample_rate_hz : float
        Samples per second of the device's clock.
    state, before : ndarray, shape (n_pairs,)
        The low-passes and their inputs at the first sample; left as they are at the one after
        the last.
    friction_n : ndarray, shape (n_samples + 1,)
    """
    n_samples = friction_n.size - 1
    for n in range(n_samples + 1):
        cutoff = cutoff_hz[0] + n / n_samples * (cutoff_hz[1] - cutoff_hz[0])
        value = friction_n[n]
        for k in range(zeros.size):
            if n > 0:
                turned = 2.0 * np.pi * cutoff * zeros[k] / sample_rate_hz
                passed = -np.expm1(-turned)
                rise = value - before[k]
                state[k] += passed * (before[k] - state[k]) + (1.0 - passed / turned) * rise
                before[k] = value
            share = zeros[k] / poles[k]
            value = share * value + (1.0 - share) * state[k]
        friction_n[n] = value


@njit(cache=True, nogil=True)
def refill(leak, forget, bias, state, drive):  # type: ignore[no-untyped-def]
    """Add to a drive, in place, what a high-pass takes from it, except bias and slow changes.

    ``1 + w_l s / (s + w_k)^2`` against ``s / (s + w_l)``: the integral of the drive about its
    bias, forgotten below w_k, without which what is constant would ask for ever more.

    Parameters
    ----------
    leak, forget : float
        w_l / fs and w_k / fs.
    bias : tuple of float
        At the first sample and at the one after the last; linear in between.
    state : ndarray, shape (2,)
        The slow part of the drive about its bias, and the integral of the rest.
    drive : ndarray, shape (n_samples,)
    """
    for n in range(drive.size):
        rest = drive[n] - (bias[0] + n / drive.size * (bias[1] - bias[0])) - state[0]
        drive[n] += leak * state[1]
        state[0] += forget * rest
        state[1] += rest - forget * state[1]


@njit(cache=True, nogil=True)
def bound(drive):  # type: ignore[no-untyped-def]
    """Bring a drive into [0, 1] in place; return how many samples were not."""
    clipped = 0
    for n in range(drive.size):
        if not 0.0 <= drive[n] <= 1.0:
            clipped += 1
            drive[n] = 1.0 if drive[n] > 1.0 else 0.0  # NaN becomes 0
    return clipped


@njit(cache=True, nogil=True)
def look_up(table, drive):  # type: ignore[no-untyped-def]
    """Replace a drive in [0, 1] by what a table, even over [0, 1], says of it."""
    steps = table.size - 1
    for n in range(drive.size):
        at = max(min(int(drive[n] * steps), steps - 1), 0)  # NaN is cast to what it may be
        drive[n] = table[at] + (drive[n] * steps - at) * (table[at + 1] - table[at])


Ends = tuple[float, float]


class Inverter:
    """Turns targets into drives.

    Parameters
    ----------
    inverse : Inverse
        What is undone.
    sample_rate_hz : float
        Samples per second of the device's clock.
    block_samples : int
        Samples of one block.
    began_sample : float
        Device sample at which the model came into force: a drift counts from there.
    """

    def __init__(
        self,
        inverse: Inverse,
        sample_rate_hz: float,
        block_samples: int,
        began_sample: float = 0.0,
    ) -> None:
        self.inverse = inverse
        self.began_sample = began_sample
        self._rate_hz = sample_rate_hz
        self._law = law_tuple(inverse.law)
        self._plain = inverse.plain
        pairs = inverse.pairs
        self._zeros, self._poles = np.array(pairs, dtype=float).reshape(-1, 2).T.copy()
        self._passed = np.zeros(len(pairs))
        self._before = np.zeros(len(pairs))
        self._slow = np.zeros(2)
        self._paths = [PathInverse(path, sample_rate_hz) for path in inverse.paths]
        self._wanted = np.zeros(block_samples + 1)
        self._settled = False
        self._next_sample = 0

    def settle(self) -> None:
        """Forget what was played: the next block begins as if nothing but the bias had been."""
        self._settled = False

    def drive(
        self,
        first_sample: int,
        course: PredictedMotion,
        bias_n: Ends,
        target_n: FloatArray,
        out: FloatArray,
    ) -> tuple[int, int]:
        """Write the drive of a block; return clipped and extrapolated samples.

        Parameters
        ----------
        first_sample : int
            Where it is not the block after the last one, the inverter settles.
        course : PredictedMotion
            Predicted motion of the block.
        bias_n : tuple of float
            What is added everywhere, at the first sample and at the one after the last.
        target_n : ndarray, shape (n_samples + 1,)
            The last is that of the sample after the block, N.
        out : ndarray, shape (n_samples,)
            Drive fraction in [0, 1].
        """
        inverse = self.inverse
        if self._plain:
            return kernel.invert(  # type: ignore[no-any-return]
                self._law, course.motion, self._rate_hz, target_n[:-1], target_n[-1], out
            )
        around = self._around(first_sample, course, out.size)
        gain_n, cutoff_hz = map(_both, inverse.along(around))
        self._settled &= first_sample == self._next_sample
        self._next_sample = first_sample + out.size
        if not self._settled:
            self._passed[:] = self._before[:] = bias_n[0]
            self._slow[:] = 0.0
            for path in self._paths:
                path.settle()
        wanted = self._wanted
        wanted[:] = target_n
        swap_pairs(
            self._zeros,
            self._poles,
            cutoff_hz,
            self._rate_hz,
            self._passed,
            self._before,
            wanted,
        )
        extrapolated = invert_scheduled(
            gain_n,
            cutoff_hz,
            course.motion,
            inverse.law.speed_range_mm_s,
            self._rate_hz,
            wanted,
            out,
        )
        bias = bias_n[0] / gain_n[0], bias_n[1] / gain_n[1]
        return self._finish(bias, around, out), extrapolated

    def _finish(self, bias: Ends, around: SlidingConditions, drive: FloatArray) -> int:
        """Undo what happens to the drive before friction follows it; return clipped samples."""
        inverse = self.inverse
        for path in self._paths:
            bias = path.undo(_both(path.path.dose.at(around)), bias, drive)
        if inverse.leak_hz > 0.0:
            per_sample = 2.0 * np.pi / self._rate_hz
            refill(
                inverse.leak_hz * per_sample, FORGET_HZ * per_sample, bias, self._slow, drive
            )
        clipped: int = bound(drive)
        if inverse.drive_table.size:
            look_up(inverse.drive_table, drive)
        # A target that is not finite would stay in the states for good.
        self._settled = bool(np.isfinite(self._passed.sum() + self._slow.sum())) and all(
            path.finite for path in self._paths
        )
        return clipped

    def _around(
        self, first_sample: int, course: PredictedMotion, n_samples: int
    ) -> SlidingConditions:
        """Return the circumstances at the block's first sample and at the one after its last.

        They are within the ranges of the inverse.
        """
        motion = course.motion
        block_s = n_samples / self._rate_hz
        ends = np.array([first_sample, first_sample + n_samples]) - self.began_sample
        x_mm = motion.x_mm, motion.x_mm + 0.5 * (motion.vx_0 + motion.vx_1) * block_s
        return self.inverse.ranges.confine(
            SlidingConditions(
                speed_mm_s=np.array([motion.speed_0, motion.speed_1]),
                normal_force_n=np.array(course.normal_force_n),
                position_mm=np.array(x_mm),
                direction=np.where(np.array([motion.vx_0, motion.vx_1]) < 0.0, -1.0, 1.0),
                minutes=ends / (60.0 * self._rate_hz),
            )
        )


def _both(ends: FloatArray) -> Ends:
    first, last = np.broadcast_to(ends, 2).tolist()
    return first, last


def law_tuple(law: FrictionLaw) -> tuple[float, float, float, float, float]:
    """Return a law as `kernel.invert` takes it."""
    return (law.gain_n, law.cutoff_0_hz, law.slope_hz_per_mm_s, *law.speed_range_mm_s)

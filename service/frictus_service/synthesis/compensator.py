"""Plays an inverse block by block: the state that undoing a law with effects needs."""

import numpy as np

from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.friction import FrictionLaw
from frictus_hardware.physics.schedule import SlidingConditions
from frictus_service.synthesis import compensation_kernels, kernel
from frictus_service.synthesis.compensation import FORGET_HZ, Inverse
from frictus_service.synthesis.estimator import PredictedMotion

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
        gain_n, cutoff_hz = self._along(first_sample, course, out.size)
        self._settled &= first_sample == self._next_sample
        self._next_sample = first_sample + out.size
        if not self._settled:
            self._passed[:] = self._before[:] = bias_n[0]
            self._slow[:] = 0.0
        wanted = self._wanted
        wanted[:] = target_n
        compensation_kernels.swap_pairs(
            self._zeros,
            self._poles,
            cutoff_hz,
            self._rate_hz,
            self._passed,
            self._before,
            wanted,
        )
        extrapolated = compensation_kernels.invert_scheduled(
            gain_n,
            cutoff_hz,
            course.motion,
            inverse.law.speed_range_mm_s,
            self._rate_hz,
            wanted,
            out,
        )
        bias = bias_n[0] / gain_n[0], bias_n[1] / gain_n[1]
        return self._finish(bias, out), extrapolated

    def _finish(self, bias: Ends, drive: FloatArray) -> int:
        """Undo what happens to the drive before friction follows it; return clipped samples."""
        inverse = self.inverse
        if inverse.leak_hz > 0.0:
            per_sample = 2.0 * np.pi / self._rate_hz
            compensation_kernels.refill(
                inverse.leak_hz * per_sample, FORGET_HZ * per_sample, bias, self._slow, drive
            )
        clipped: int = compensation_kernels.bound(drive)
        if inverse.drive_table.size:
            compensation_kernels.look_up(inverse.drive_table, drive)
        # A target that is not finite would stay in the states for good.
        self._settled = bool(np.isfinite(self._passed.sum() + self._slow.sum()))
        return clipped

    def _along(
        self, first_sample: int, course: PredictedMotion, n_samples: int
    ) -> tuple[Ends, Ends]:
        """Return gain and cutoff at the block's first sample and at the one after its last."""
        inverse, motion = self.inverse, course.motion
        block_s = n_samples / self._rate_hz
        ends = np.array([first_sample, first_sample + n_samples]) - self.began_sample
        x_mm = motion.x_mm, motion.x_mm + 0.5 * (motion.vx_0 + motion.vx_1) * block_s
        gain_n, cutoff_hz = inverse.along(
            SlidingConditions(
                speed_mm_s=np.array([motion.speed_0, motion.speed_1]),
                normal_force_n=np.array(course.normal_force_n),
                position_mm=np.array(x_mm),
                direction=np.where(np.array([motion.vx_0, motion.vx_1]) < 0.0, -1.0, 1.0),
                minutes=ends / (60.0 * self._rate_hz),
            )
        )
        return _both(gain_n), _both(cutoff_hz)


def _both(ends: FloatArray) -> Ends:
    first, last = np.broadcast_to(ends, 2).tolist()
    return first, last


def law_tuple(law: FrictionLaw) -> tuple[float, float, float, float, float]:
    """Return a law as `kernel.invert` takes it."""
    return (law.gain_n, law.cutoff_0_hz, law.slope_hz_per_mm_s, *law.speed_range_mm_s)

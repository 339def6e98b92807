"""How late the loop wakes, against deadlines that follow the device's clock."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

KEPT_BLOCKS: Final = 1024
FOLLOW: Final = 1.0 + 2e-4
"""Deadlines are the earliest seen so far, one block after another; they may slip by 200 ppm,
which is more than any device clock is off."""


class Lateness:
    """Rings of fixed size; the loop writes, anybody may read.

    Parameters
    ----------
    clock_hz : float
        Nominal samples of the device per second of this machine's clock.

    Attributes
    ----------
    max_ms : float
        Since the start.
    """

    def __init__(self, clock_hz: float) -> None:
        self._sample_ns = 1e9 / clock_hz
        self._end_sample = 0
        self._late_ms = np.zeros(KEPT_BLOCKS)
        self._margin_ms = np.zeros(KEPT_BLOCKS)
        self._count = 0
        self._deadline_ns: float | None = None
        self._late_in_a_row = 0
        self.max_ms = 0.0

    def restart(self) -> None:
        """Forget the deadline: the device's clock began anew."""
        self._deadline_ns = None
        self._late_in_a_row = 0

    def note(
        self, returned_ns: int, end_sample: int, block_samples: int, margin_samples: int
    ) -> int:
        """Take in a block; return how many in a row came more than a block late.

        Parameters
        ----------
        returned_ns : int
            Monotonic time at which the block was there.
        end_sample : int
            Device index one past the block's last sample.
        block_samples : int
            Length of a block.
        margin_samples : int
            Output still queued when the block was handed over.
        """
        due_ns = float(returned_ns)
        if self._deadline_ns is not None:
            passed_ns = (end_sample - self._end_sample) * self._sample_ns
            due_ns = min(due_ns, self._deadline_ns + passed_ns * FOLLOW)
        self._deadline_ns, self._end_sample = due_ns, end_sample
        late_ns = returned_ns - due_ns
        late_ms = 1e-6 * late_ns
        slot = self._count % KEPT_BLOCKS
        self._late_ms[slot] = late_ms
        self._margin_ms[slot] = 1e-6 * margin_samples * self._sample_ns
        self._count += 1
        self.max_ms = max(self.max_ms, late_ms)
        self._late_in_a_row = (
            self._late_in_a_row + 1 if late_ns > block_samples * self._sample_ns else 0
        )
        return self._late_in_a_row

    def percentiles_ms(self) -> tuple[float, float]:
        """Return the median and the 99th percentile over the last blocks, ms."""
        late = self._kept(self._late_ms)
        if not late.size:
            return 0.0, 0.0
        median, high = np.percentile(late, (50.0, 99.0))
        return float(median), float(high)

    def least_margin_ms(self) -> float:
        """Return the least output still queued over the last blocks, ms."""
        margin = self._kept(self._margin_ms)
        return float(margin.min()) if margin.size else 0.0

    def _kept(self, ring: NDArray[np.float64]) -> NDArray[np.float64]:
        return ring[: min(self._count, KEPT_BLOCKS)].copy()

"""Device samples to time by a line that is bent, never broken: stamps always rise.

The fit of a rig's clock is made anew ten times a second, and it moves by tens of microseconds,
either way: more than a sample period, so stamps taken from successive fits run backwards. Here
each new fit is approached at a bounded rate (slewed, as `adjtime` does).
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

SLEW: Final = 1e-3
"""The line approaches a new fit by so many seconds per second: 0.1 ms in 0.1 s."""
RATE_SHARE: Final = 0.01
"""A fit whose rate is further off the first one is no fit, and is left out."""
LONGEST_NS: Final = 2.0**62
"""How far a sample may be from the beginning: 146 years."""
MAX_BENDS: Final = 64
"""Bends kept: some seconds in which streams may lag behind each other."""


class SlewedClock:
    """One run of a device's sample counter, on the scale of any clock in nanoseconds.

    Parameters
    ----------
    sample : int
        Device index at which the line begins.
    at_ns : int
        Its time.
    ns_per_sample : float
        Above 0.

    Attributes
    ----------
    newest_sample : int
        Highest index that was asked for; what was told up to it is never changed.
    error_ns : float
        How far the line was off the newest fit there, before it began to approach it.
    """

    def __init__(self, sample: int, at_ns: int, ns_per_sample: float) -> None:
        self.newest_sample = sample
        self.error_ns = 0.0
        self._ns_per_sample = ns_per_sample
        # Differences from the beginning stay small, so that float64 keeps nanoseconds.
        self._sample, self._at_ns = sample, at_ns
        self._bends = [(0.0, 0.0, ns_per_sample)]  # samples, ns, ns per sample from there on

    def approach(self, sample: int, at_ns: int, ns_per_sample: float) -> None:
        """Take a new fit; the line bends towards it from the newest sample on.

        Parameters
        ----------
        sample : int
            Device index for which the fit is given.
        at_ns : int
            Its time by the fit.
        ns_per_sample : float
            By the fit; within 1 % of the first one, or the fit is left out.
        """
        if not abs(ns_per_sample / self._ns_per_sample - 1.0) <= RATE_SHARE:  # refuses NaN too
            return
        here = float(self.newest_sample - self._sample)
        here_ns = self._line_ns(here)
        fit_ns = (at_ns - self._at_ns) + (here - (sample - self._sample)) * ns_per_sample
        self.error_ns = here_ns - fit_ns
        slewed = ns_per_sample * (1.0 - SLEW * np.sign(self.error_ns))
        until = here + abs(self.error_ns) / (SLEW * ns_per_sample)
        until_ns = fit_ns + (until - here) * ns_per_sample
        self._bends = [bend for bend in self._bends if bend[0] < here][2 - MAX_BENDS :]
        self._bends += [(here, here_ns, float(slewed)), (until, until_ns, ns_per_sample)]

    def time_ns(self, samples: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the time of samples, rising as they do.

        Parameters
        ----------
        samples : ndarray of int64, shape (n_samples,)
            Device indices of this run.

        Returns
        -------
        ndarray of int64, shape (n_samples,)
            Nanoseconds.
        """
        if samples.size:
            self.newest_sample = max(self.newest_sample, int(samples.max()))
        begins, begins_ns, rates = np.array(self._bends).T
        x = (samples - self._sample).astype(np.float64)
        bend = np.maximum(np.searchsorted(begins, x, side="right") - 1, 0)
        offsets = np.rint(begins_ns[bend] + (x - begins[bend]) * rates[bend])
        offset_ns = np.clip(offsets, -LONGEST_NS, LONGEST_NS).astype(np.int64)
        times_ns: NDArray[np.int64] = self._at_ns + offset_ns
        return times_ns

    def time_of(self, sample: int) -> int:
        """Return the time of one sample, ns.

        Parameters
        ----------
        sample : int
            Device index of this run.
        """
        self.newest_sample = max(self.newest_sample, sample)
        offset_ns = self._line_ns(float(sample - self._sample))
        return self._at_ns + round(min(max(offset_ns, -LONGEST_NS), LONGEST_NS))

    def _line_ns(self, x: float) -> float:
        begin, begin_ns, rate = next(
            (bend for bend in reversed(self._bends) if bend[0] <= x), self._bends[0]
        )
        return begin_ns + (x - begin) * rate

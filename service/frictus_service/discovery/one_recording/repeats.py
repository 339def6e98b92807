"""Samples that stand in more than one trial: a copy is no second measurement."""

from typing import Final

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from frictus_hardware.arrays import FloatArray
from frictus_service.study.trial import Trial

RUN: Final = 16
"""Samples of the force that are compared at once: noise of two bits repeats none by chance."""
LEAST_LEVELS: Final = 4
"""Different values in a run; one that rests repeats itself."""
SHARED: Final = 0.01
"""Of the runs of a trial, from which it is taken to repeat another."""


class SeenSamples:
    """The force of all trials so far, by which a copy or an overlap is noticed.

    Found wherever it begins, as long as no sample was changed: whole trials under another
    name, and windows cut from one recording so that they overlap.
    """

    def __init__(self) -> None:
        self._runs: dict[str, NDArray[np.uint64]] = {}

    def repeated(self, trial: Trial) -> str:
        """Return the sentence that refuses a trial, and remember it; empty where it is new.

        Parameters
        ----------
        trial : Trial
            As it was recorded.
        """
        runs = _runs(trial.force_n[:, 0])
        for name, before in self._runs.items():
            share = float(np.isin(runs, before).mean()) if runs.size else 0.0
            if share > SHARED:
                seconds = share * trial.force_n.shape[0] / trial.info.sample_rate_hz
                return (
                    f"trial {trial.info.id} holds {seconds:.2g} s of trial {name}, sample for "
                    "sample: it is no independent measurement and is not used; give each "
                    "recording once, in windows that do not overlap"
                )
        self._runs[trial.info.id] = np.unique(runs)
        return ""


def _runs(force_n: FloatArray) -> NDArray[np.uint64]:
    """Return a number for each run of samples that varies, equal for equal runs."""
    if force_n.size < RUN:
        return np.empty(0, dtype=np.uint64)
    bits: NDArray[np.uint64] = np.ascontiguousarray(force_n).view(np.uint64)
    changed = np.concatenate([[0], np.cumsum(bits[1:] != bits[:-1])])
    lively = changed[RUN - 1 :] - changed[: changed.size - RUN + 1] >= LEAST_LEVELS
    # Odd factors modulo 2^64: a polynomial hash, whose sums wrap around.
    factors = np.cumprod(np.full(RUN, 0x9E3779B97F4A7C15, dtype=np.uint64))
    mixed = bits ^ (bits >> np.uint64(29))
    hashed: NDArray[np.uint64] = (sliding_window_view(mixed, RUN) @ factors).astype(np.uint64)
    found: NDArray[np.uint64] = hashed[lively]
    return found

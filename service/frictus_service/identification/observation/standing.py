"""Whether a driven channel stands still: at both ends of its range, or as its converter hung.

What stands at one end of a range is clipped (`validity`). A force whose range is too narrow for
either direction jumps from end to end where the finger turns, and so has two values, as a
channel at rest has that a converter's step splits. It shows no error either: its responses come
out as 0, and as certain as rounding is.
"""

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from frictus_hardware.arrays import FloatArray
from frictus_service.identification.observation.sweeps import Sweep
from frictus_service.study.trial import Trial

LEAST_S: Final = 0.05
"""For which a channel that is driven holds no value; a period of its lowest tone, if longer."""
MOST_STANDING: Final = 0.1
"""Share of a third of a sweep, or of all sweeps of a trial."""


def judge_standing(trial: Trial, sweeps: Sequence[Sweep]) -> Iterator[str]:
    """Judge whether the force along the screen stands while tones drive it.

    Parameters
    ----------
    trial : Trial
        As it was recorded.
    sweeps : sequence of Sweep
        Steady movements, in time.
    """
    if not sweeps or not trial.info.tones_hz or trial.voltage_v is None:
        return
    rate_hz, least_s = trial.info.sample_rate_hz, longest_hold_s(trial.info.tones_hz)
    parts = [
        trial.force_n[max(0, round(each.begin_s * rate_hz)) : round(each.end_s * rate_hz), 0]
        for each in sweeps
    ]
    standing = sum(standing_samples(part, least_s * rate_hz) for part in parts)
    share = standing / max(sum(part.size for part in parts), 1)
    if share > MOST_STANDING and np.ptp(trial.force_n[:, 0]) > 0.0:
        yield (
            f"force_n, column 0, stands still for {share:.0%} of the sweeps, {least_s:.2g} s "
            "and more at a time, while a tone drives; accepted: "
            f"{MOST_STANDING:.0%}; widen the range of the sensor or of its converter"
        )


def longest_hold_s(tones_hz: Sequence[float]) -> float:
    """Return for how long a channel that tones drive holds no value.

    Parameters
    ----------
    tones_hz : sequence of float
        At least one.
    """
    return max(LEAST_S, 1.0 / min(tones_hz))


def stands(samples: FloatArray, least: float) -> bool:
    """Return whether a channel tells nothing of what drives it.

    Parameters
    ----------
    samples : ndarray, shape (n_samples,)
        Of a third of a sweep.
    least : float
        Samples of a run.
    """
    return standing_samples(samples, least) > MOST_STANDING * samples.size


def standing_samples(samples: FloatArray, least: float) -> int:
    """Return how many samples are of runs of one and the same value.

    Parameters
    ----------
    samples : ndarray, shape (n_samples,)
        Missing ones NaN: no value.
    least : float
        Samples of a run.
    """
    if not samples.size:
        return 0
    edges = np.flatnonzero(samples[1:] != samples[:-1]) + 1
    runs = np.diff(np.concatenate([[0], edges, [samples.size]]))
    return int(runs[runs >= least].sum())

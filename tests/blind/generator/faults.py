"""What is wrong with the instruments of a study, as its file does not say."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Final

import numpy as np

from frictus_service.study.trial import Trial

FILTER_S: Final = 0.05
"""Time constant by which a touch controller smooths its positions."""
JITTER_S: Final = 0.016
"""Within which a host stamps a report after the next turn of its loop."""
APART_S: Final = 0.02
"""By which reports of a trial come early or late, as two programs start one after the other."""
MISSING: Final = 0.15
"""Share of the reports that are lost, besides two gaps of `GAP_REPORTS`."""
GAP_REPORTS: Final = 8
CROSSTALK: Final = 0.05
"""Of each axis of force in the two others."""
WANDERING_N: Final = (0.02, 0.02, 0.05)
"""Standard deviation of the offset of each axis at the end of a trial."""
COARSE_N: Final = 0.02
"""Step of a force sensor for much larger forces."""


def _filtered_reports(trial: Trial, rng: np.random.Generator) -> Trial:
    smooth = trial.position_mm.copy()
    steps_s = np.diff(trial.position_t_s)
    for n, share in enumerate(1.0 - np.exp(-steps_s / FILTER_S)):
        smooth[n + 1] = smooth[n] + share * (smooth[n + 1] - smooth[n])
    return replace(trial, position_mm=smooth)


def _jittering_stamps(trial: Trial, rng: np.random.Generator) -> Trial:
    late_s = rng.uniform(0.0, JITTER_S, trial.position_t_s.size)
    in_order_s = np.sort(trial.position_t_s + late_s) + 1e-6 * np.arange(late_s.size)
    return replace(trial, position_t_s=in_order_s)


def _started_apart(trial: Trial, rng: np.random.Generator) -> Trial:
    return replace(trial, position_t_s=trial.position_t_s + rng.uniform(-APART_S, APART_S))


def _missing_reports(trial: Trial, rng: np.random.Generator) -> Trial:
    kept = rng.uniform(size=trial.position_t_s.size) >= MISSING
    for first in rng.integers(kept.size, size=2):
        kept[first : first + GAP_REPORTS] = False
    kept[[0, -1]] = True
    return replace(
        trial, position_t_s=trial.position_t_s[kept], position_mm=trial.position_mm[kept]
    )


def _whole_millimetres(trial: Trial, rng: np.random.Generator) -> Trial:
    return replace(trial, position_mm=np.rint(trial.position_mm))


def _crosstalk(trial: Trial, rng: np.random.Generator) -> Trial:
    mixing = np.array([[1.0, CROSSTALK, -CROSSTALK]] * 3)
    mixing[1] = -CROSSTALK, 1.0, CROSSTALK
    mixing[2] = CROSSTALK, -CROSSTALK, 1.0
    return replace(trial, force_n=trial.force_n @ mixing.T)


def _wandering_offsets(trial: Trial, rng: np.random.Generator) -> Trial:
    steps = rng.standard_normal(trial.force_n.shape) / np.sqrt(len(trial.force_n))
    return replace(trial, force_n=trial.force_n + np.cumsum(steps, axis=0) * WANDERING_N)


def _coarse_force(trial: Trial, rng: np.random.Generator) -> Trial:
    return replace(trial, force_n=COARSE_N * np.rint(trial.force_n / COARSE_N))


Fault = Callable[[Trial, np.random.Generator], Trial]

FAULTS: Final[Mapping[str, Fault]] = {
    "filtered_reports": _filtered_reports,
    "jittering_stamps": _jittering_stamps,
    "started_apart": _started_apart,
    "missing_reports": _missing_reports,
    "whole_millimetres": _whole_millimetres,
    "crosstalk": _crosstalk,
    "wandering_offsets": _wandering_offsets,
    "coarse_force": _coarse_force,
}
"""By name: the trial as such a rig records it."""

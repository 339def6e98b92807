"""What `frictus discover` finds in a session afterwards, from what the tracker was given."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from frictus.aligned import AlignedSamples
from frictus.model import Model
from frictus_hardware.physics.linear import Mount
from frictus_service.discovery.document import OneRecording
from frictus_service.discovery.one_recording.analysis import cut, ranked
from frictus_service.discovery.one_recording.windows import LEAST_FOLDS
from frictus_service.study.trial import StudyInfo, Trial, TrialInfo

EVERY: Final = 100
"""Samples from one position to the next: 200 a second, as a touch sensor reports."""
BEGAN: Final = "2026-01-01T00:00:00+00:00"


def discovered(
    parts: Sequence[AlignedSamples], base: Model, screen_peak_v: float
) -> OneRecording | None:
    """Return what ranks first in a session taken as the recording of one trial.

    Parameters
    ----------
    parts : sequence of AlignedSamples
        In order, without a gap.
    base : Model
        What is criticised.
    screen_peak_v : float
        Screen volts at a drive fraction of 1.

    Returns
    -------
    OneRecording or None
        None where too few windows are of steady sliding.
    """
    rows = {
        name: np.concatenate([part.data[name] for part in parts], axis=1).astype(np.float64)
        for name in ("force", "voltage", "render")
    }
    rate_hz = parts[0].sample_rate_hz
    position = rows["render"][:2, ::EVERY].T
    trial = Trial(
        TrialInfo("0", "P01", 0, 0, 60.0, 0.4, (), 2.0 * screen_peak_v, rate_hz, BEGAN),
        rows["voltage"][0],
        rows["force"].T,
        None,
        None,
        position,
        np.arange(position.shape[0]) * EVERY / rate_hz,
    )
    study = StudyInfo("twin", screen_peak_v=screen_peak_v, mount=Mount().lateral)
    windows = cut([trial], study, base)
    if len(windows.evidence) < LEAST_FOLDS:
        return None
    return ranked(windows, study, base)

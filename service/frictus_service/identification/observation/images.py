"""Friction at images of a held drive, which samples take for that at the tone."""

from typing import Final

import numpy as np

from frictus_hardware.arrays import ComplexArray
from frictus_hardware.physics.friction import FrictionLaw, cutoff_hz
from frictus_service.identification.observation.response import Instrument, ResponseRows
from frictus_service.study.trial import StudyInfo, Trial

IMAGES: Final = 20
"""Of the sample rate to either side: they fall with its square."""


def folded(rows: ResponseRows, trial: Trial, study: StudyInfo) -> ComplexArray:
    """Return the sampled friction over that of the tone alone, (n_rows,).

    Without a mount that damps them, images are 4 % at 1.9 kHz of 20 kHz. They lie far above the
    cutoff, of which that of the paper's law is near enough.

    Parameters
    ----------
    rows : ResponseRows
        Tones and speeds.
    trial : Trial
        As it was recorded.
    study : StudyInfo
        Its mount is used.
    """
    images = np.arange(-IMAGES, IMAGES + 1) * trial.info.sample_rate_hz
    at = rows.tone_hz[:, np.newaxis] + images
    instrument = Instrument.of(trial, study, at)
    cutoff = cutoff_hz(FrictionLaw(), rows.speed_mm_s)[:, np.newaxis]
    made = instrument.drive * instrument.force / (1.0 + 1j * at / cutoff)
    found: ComplexArray = made.sum(axis=1) / made[:, IMAGES]
    return found

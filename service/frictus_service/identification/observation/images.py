"""Friction at images of a held drive, which samples take for that at the tone."""

from dataclasses import replace
from typing import Final

import numpy as np

from frictus_hardware.arrays import ComplexArray
from frictus_hardware.physics.friction import FrictionLaw, cutoff_hz
from frictus_hardware.physics.linear import Mobility
from frictus_service.identification.observation.response import Instrument, ResponseRows
from frictus_service.study.trial import StudyInfo, Trial

IMAGES: Final = 20
"""Of the sample rate to either side: they fall with its square."""


def without_images(rows: ResponseRows, trial: Trial, study: StudyInfo) -> ResponseRows:
    """Return rows of the tones alone.

    Without a mount that damps them, images are 4 % of friction at 1.9 kHz of 20 kHz. The skin's
    acceleration passes no mount: at 700 Hz they are 0.9 %, as a delay of 1.6 us would be. They
    lie far above the cutoff and the skin's resonance, of which those of the paper's models are
    near enough.

    Parameters
    ----------
    rows : ResponseRows
        As they were sampled.
    trial : Trial
        As it was recorded.
    study : StudyInfo
        Its mount is used.
    """
    force, skin = folded(rows, trial, study)
    share = force / skin
    return replace(
        rows,
        friction_response=rows.friction_response / force,
        friction_variance=rows.friction_variance / np.square(np.abs(force)),
        mobility=rows.mobility * share,
        mobility_variance=rows.mobility_variance * np.square(np.abs(share)),
    )


def folded(
    rows: ResponseRows, trial: Trial, study: StudyInfo
) -> tuple[ComplexArray, ComplexArray]:
    """Return sampled force, and motion of the skin, over those of the tone alone, (n_rows,).

    Parameters
    ----------
    rows, trial, study
        As for `without_images`.
    """
    images = np.arange(-IMAGES, IMAGES + 1) * trial.info.sample_rate_hz
    at = rows.tone_hz[:, np.newaxis] + images
    instrument = Instrument.of(trial, study, at)
    cutoff = cutoff_hz(FrictionLaw(), rows.speed_mm_s)[:, np.newaxis]
    friction = instrument.drive / (1.0 + 1j * at / cutoff)
    moved = instrument.skin * Mobility().velocity.frequency_response(at)
    force, skin = (
        made.sum(axis=1) / made[:, IMAGES]
        for made in (friction * instrument.force, friction * moved)
    )
    return force, skin

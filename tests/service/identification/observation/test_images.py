"""A held drive has images, and samples fold them onto the tone."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import signal
from tests.service.identification.trials import RATE_HZ, STUDY, Made, trial

from frictus_hardware.physics.friction import FrictionLaw, cutoff_hz
from frictus_service.identification.observation.observe import observe
from frictus_service.identification.observation.response import drive_fraction

SPEED_MM_S = 80.0


@pytest.mark.parametrize("tone_hz", [446.3, 1909.0])
def test_without_a_mount_images_are_removed(tone_hz: float, rng: np.random.Generator) -> None:
    """The samples are those of a first-order lag behind a hold, exactly."""
    measured = trial(Made((tone_hz,), SPEED_MM_S), rng)
    assert measured.voltage_v is not None
    cutoff = float(cutoff_hz(FrictionLaw(), SPEED_MM_S))
    keep = np.exp(-2.0 * np.pi * cutoff / RATE_HZ)
    drive = drive_fraction(measured.voltage_v, STUDY.screen_peak_v)
    friction = signal.lfilter([0.0, 1.0 - keep], [1.0, -keep], drive)
    force = measured.force_n.copy()
    force[:, 0] = np.sign(force[:, 0]) * (0.3 + friction)
    measured = replace(measured, force_n=force, force_skew_s=0.0)
    rows = observe(measured, replace(STUDY, mount=None)).rows
    assert rows.tone_hz.size >= 6
    np.testing.assert_allclose(
        rows.friction_response * (1.0 + 1j * tone_hz / cutoff), 1.0, atol=0.004
    )

"""Errors of the speeds are no speeds at which a cutoff was found."""

from dataclasses import replace

import numpy as np
import pytest
from tests.service.tracking.slides import BANDS, PAPER, slide, speeds

from frictus_service.calibration.coordinates import Prior
from frictus_service.tracking.estimation.batch import Batch
from frictus_service.tracking.estimation.law_estimate import LawEstimate, advanced, updated
from frictus_service.tracking.estimation.speed_spread import ERROR_MM_S, SpeedSpread

ACTUAL_MM_S = 40.0


def test_mean_and_variance_are_those_of_all_windows(rng: np.random.Generator) -> None:
    each = [rng.uniform(20.0, 100.0, n) for n in (1, 7, 10, 3)]
    spread = SpeedSpread()
    for speed_mm_s in each:
        spread = spread.seen(speed_mm_s)
    whole = np.concatenate(each)
    assert spread.windows == whole.size
    assert spread.mean_mm_s == pytest.approx(whole.mean())
    assert spread.variance == pytest.approx(whole.var())
    assert not spread.keeping(whole).any()
    assert spread.attenuation == pytest.approx(ERROR_MM_S**2 / whole.var())


def found(rng: np.random.Generator, batches: int) -> LawEstimate:
    """Return the estimate of a finger at one speed, which is known with errors."""
    estimate = LawEstimate.begin(Prior.weak(), BANDS.centre_hz.size)
    for _ in range(batches):
        windows = slide(rng, PAPER, [ACTUAL_MM_S] * 10)
        off_mm_s = rng.normal(0.0, 0.3, len(windows))
        wrong = [
            replace(window, speed_mm_s=window.speed_mm_s + off, band_speed_mm_s=None)
            for window, off in zip(windows, off_mm_s, strict=True)
        ]
        batch = Batch.of(wrong, BANDS)
        estimate = advanced(estimate, 0.5, new_contact=False).sliding_at(batch.speed_mm_s)
        estimate, _ = updated(estimate, batch.at_speeds_of(estimate.speeds))
    return estimate


def test_a_finger_at_one_speed_tells_no_slope(rng: np.random.Generator) -> None:
    """Its law was flat, more certainly so with each minute: 30 standard deviations off."""
    estimate = found(rng, 120)
    z = (estimate.mean - PAPER) / np.sqrt(np.diag(estimate.covariance))
    assert np.all(np.abs(z[:2]) < 3.0)
    assert np.all(np.abs(estimate.mean - PAPER)[:2] < 0.3)
    # At its own speed the cutoff is known, and far from it hardly better than before.
    assert estimate.half_width[1] > 0.25
    share = (ACTUAL_MM_S - 20.0) / 80.0
    ends = np.exp(estimate.mean[:2]), np.exp(PAPER[:2])
    own, true = ((1.0 - share) * low + share * high for low, high in ends)
    assert own == pytest.approx(true, rel=0.01)


def test_a_finger_at_many_speeds_tells_it_as_before(rng: np.random.Generator) -> None:
    estimate = LawEstimate.begin(Prior.weak(), BANDS.centre_hz.size)
    for _ in range(20):
        batch = Batch.of(slide(rng, PAPER, speeds(rng)), BANDS)
        estimate = estimate.sliding_at(batch.speed_mm_s)
        told = batch.at_speeds_of(estimate.speeds)
        np.testing.assert_array_equal(told.band_speed_mm_s, batch.band_speed_mm_s)
        estimate, _ = updated(estimate, told)
    assert np.all(np.abs(estimate.mean - PAPER)[:2] < 0.02)
    assert np.all(estimate.half_width[:2] < 0.03)

"""The error of a model is that of a rendering which undoes it."""

import numpy as np
import pytest
from tests.service.tracking.slides import BANDS, PAPER, slide, speeds

from frictus_service.tracking.estimation.batch import Batch
from frictus_service.tracking.prequential import PrequentialError


def judged(rng: np.random.Generator, model: np.ndarray) -> PrequentialError:
    error = PrequentialError.begin(BANDS.centre_hz.size)
    for _ in range(20):
        batch = Batch.of(slide(rng, PAPER, speeds(rng)), BANDS)
        error = error.judged(batch, model)
    return error


def test_the_right_model_has_none(rng: np.random.Generator) -> None:
    error = judged(rng, PAPER)
    assert error.rms_db < 0.05
    assert np.all(np.abs(error.band_db) < 3.0 * error.band_half_width_db)


def test_a_gain_shows_in_every_band(rng: np.random.Generator) -> None:
    error = judged(rng, PAPER + np.array([0.0, 0.0, np.log(2.0), 0.0]))
    assert error.band_db == pytest.approx(-6.02, abs=0.1)
    assert error.rms_db == pytest.approx(6.02, abs=0.1)


def test_a_cutoff_shows_in_high_bands(rng: np.random.Generator) -> None:
    error = judged(rng, PAPER + np.array([0.7, 0.7, 0.0, 0.0]))
    assert abs(error.band_db[0]) < 0.1
    assert error.band_db[-1] < -2.0


def test_nothing_is_judged_before_anything_was_felt() -> None:
    error = PrequentialError.begin(BANDS.centre_hz.size)
    assert np.isnan(error.rms_db)
    assert np.isnan(error.band_db).all()
    assert np.isnan(error.band_half_width_db).all()

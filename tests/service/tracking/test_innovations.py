"""Evidence of what a filter cannot foresee is an e-process under the model of the filter."""

from dataclasses import dataclass

import numpy as np
import pytest
from tests.service.tracking.slides import BANDS, PAPER, slide, speeds

from frictus_service.calibration.coordinates import Prior
from frictus_service.tracking.estimation.batch import Batch
from frictus_service.tracking.estimation.finger_filters import COLUMNS, LAW, STATE
from frictus_service.tracking.estimation.law_estimate import LawEstimate, updated
from frictus_service.tracking.evidence.innovations import (
    UNITS,
    WANDERING,
    Nuisance,
    batch_score,
)
from frictus_service.tracking.evidence.sums import log_ratio

pytestmark = pytest.mark.long

BATCHES = 30
STROKE = 2
CONTACT = 10
"""Batches of each."""


@dataclass(frozen=True)
class Evidence:
    """Of one deviation after every batch of a session, nats, and the last sums."""

    log_e: np.ndarray
    score: float
    information: float


def session(rng: np.random.Generator, dose: float, edge: float) -> Evidence:
    """Return the evidence where data are drawn from the filter's own model."""
    filter_ = Nuisance.begin(np.zeros(LAW), np.ones(LAW), 1)
    state = np.append(rng.standard_normal(LAW), off_the_law(rng))
    score = information = 0.0
    log_e = []
    for batch in range(BATCHES):
        contact, stroke = batch % CONTACT == 0, batch % STROKE == 0
        filter_ = filter_.advanced(0.0, contact, stroke)
        if stroke:
            state[LAW + 1 :] = off_the_law(rng)[1:]
        if contact:
            state[LAW] = off_the_law(rng)[0]
        columns = rng.standard_normal((8, STATE + 1)) * 2.0
        columns[:, :STATE] = columns[:, COLUMNS]
        data = columns[:, :STATE] @ state + dose * columns[:, STATE] + rng.standard_normal(8)
        filter_, own, known = filter_.seen(
            columns.T @ data, columns.T @ columns, np.zeros(STATE)
        )
        score, information = score + float(own[0]), information + float(known[0, 0])
        log_e.append(float(log_ratio(np.array(score), np.array(information), edge)))
    return Evidence(np.array(log_e), score, information)


def off_the_law(rng: np.random.Generator) -> np.ndarray:
    """Return what contact and stroke differ by."""
    return rng.multivariate_normal(np.zeros(STATE - LAW), WANDERING)


def test_under_the_model_it_is_one_in_the_mean_and_rarely_ever_large(
    rng: np.random.Generator,
) -> None:
    found = np.array([session(rng, 0.0, 0.0).log_e for _ in range(600)])
    e = np.exp(found[:, -1])
    assert e.mean() < 1.0 + 4.0 * e.std() / np.sqrt(e.size)
    ever = np.mean(found.max(axis=1) > np.log(20.0))
    assert ever < 0.05 + 3.0 * np.sqrt(0.05 * 0.95 / 600)


def test_within_what_is_tolerated_it_is_less_than_one(rng: np.random.Generator) -> None:
    found = np.array([session(rng, 0.15, 0.2).log_e for _ in range(300)])
    e = np.exp(found[:, -1])
    assert e.mean() < 1.0 + 4.0 * e.std() / np.sqrt(e.size)


def test_a_deviation_shows_with_its_size_although_the_filter_follows_it(
    rng: np.random.Generator,
) -> None:
    for dose in (-0.7, 0.7):
        found = session(rng, dose, 0.0)
        assert found.log_e[-1] > 50.0
        assert abs(found.score / found.information - dose) < 0.2


def test_what_is_wholly_nuisance_has_no_information(rng: np.random.Generator) -> None:
    filter_ = Nuisance.begin(np.zeros(LAW), np.full(LAW, 1e3), 1)
    columns = rng.standard_normal((9, STATE))[:, COLUMNS]
    both = np.column_stack([columns, columns[:, 1]])
    _, _, known = filter_.seen(np.zeros(STATE + 1), both.T @ both, np.zeros(STATE))
    assert known[0, 0] < 1e-3


def test_the_score_of_a_batch_points_to_its_law(rng: np.random.Generator) -> None:
    batch = Batch.of(slide(rng, PAPER, speeds(rng)), BANDS)
    estimate, _ = updated(LawEstimate.begin(Prior.weak(), BANDS.centre_hz.size), batch)
    off = PAPER + np.array([0.0, 0.0, 0.1, 20e-6])
    later = Batch.of(slide(rng, off, speeds(rng)), BANDS)
    nothing = np.zeros((*later.cross.shape, 0), dtype=complex)
    score, information, certainty = batch_score(
        later, estimate, nothing, np.zeros(10, dtype=np.int64)
    )
    step = UNITS * np.linalg.solve(information[0], score[0])
    assert np.all(np.abs(estimate.mean + step - off)[2:] < [0.02, 3e-6])
    assert certainty > 1e4

"""Filters side by side: each is exact for its size, and they count as they predict."""

from itertools import product

import numpy as np
import pytest
from scipy.stats import multivariate_normal
from tests.service.tracking.slides import PAPER

from frictus_hardware.arrays import FloatArray
from frictus_service.calibration.coordinates import Prior
from frictus_service.calibration.posterior import ENDS
from frictus_service.tracking.estimation.finger_filters import (
    COMMON,
    CONTACTS,
    FELT,
    LAW,
    NOW,
    PERSON,
    STROKES,
    WALKS,
    FingerFilters,
)

SIZES = list(product(WALKS, CONTACTS, STROKES))
PRIOR = Prior(PAPER, np.diag([0.04, 0.03, 0.02, 1e-9]), 0, "of a test")
NOISE = np.diag([1e-4, 2e-4, 1e-5, 1e-12])
"""Covariance of what one update says of the law."""
MEASURED = np.linalg.inv(NOISE)


def felt(filters: FingerFilters, law: FloatArray) -> FingerFilters:
    """Return the filters after an update that says this law, taken somewhere else."""
    at = law + np.array([0.1, -0.1, 0.05, 1e-5])
    return filters.seen(MEASURED @ (law - at), MEASURED, at)[0]


def test_one_update_is_the_normal_posterior_of_each_size() -> None:
    law = PAPER + np.array([0.1, 0.05, -0.2, 2e-5])
    found = felt(FingerFilters.begin(PRIOR), law)
    for number, (_, contact, (gain, cutoff)) in enumerate(SIZES):
        off = np.zeros((LAW, LAW))
        off[2, 2] = contact**2 + gain**2
        off[:2, :2] = cutoff**2 * ENDS
        total = PRIOR.covariance + off + NOISE
        gained = PRIOR.covariance @ np.linalg.inv(total)
        mean = PAPER + gained @ (law - PAPER)
        covariance = PRIOR.covariance - gained @ PRIOR.covariance
        np.testing.assert_allclose(found.means[number, :LAW], mean, rtol=1e-9)
        np.testing.assert_allclose(
            found.covariances[number, :LAW, :LAW], covariance, rtol=1e-6, atol=1e-16
        )


def test_the_evidence_is_the_density_of_what_was_felt() -> None:
    law, begun = PAPER + np.array([0.02, 0.01, 0.03, 0.0]), FingerFilters.begin(PRIOR)
    density = [
        multivariate_normal(PAPER, FELT @ covariance @ FELT.T + NOISE).logpdf(law)
        for covariance in begun.covariances
    ]
    before = begun.log_evidence
    evidence = before + np.array(density)
    np.testing.assert_allclose(
        felt(begun, law).log_evidence, evidence - evidence.max(), rtol=1e-6, atol=1e-9
    )
    weights = begun.weights.reshape(len(WALKS), len(CONTACTS), len(STROKES))
    np.testing.assert_allclose(weights.sum(axis=(0, 1)), COMMON, rtol=1e-12)
    np.testing.assert_allclose(weights.sum(axis=(0, 2)), COMMON, rtol=1e-12)


@pytest.mark.parametrize("varies", [False, True])
def test_how_much_contacts_differ_is_learned_from_contacts(
    varies: bool, rng: np.random.Generator
) -> None:
    filters = FingerFilters.begin(PRIOR)
    for _ in range(20):
        gain = CONTACTS[1] * rng.standard_normal() if varies else 0.0
        filters = filters.advanced(1.0, new_contact=True)
        noise = rng.multivariate_normal(np.zeros(LAW), NOISE)
        filters = felt(filters, PAPER + np.array([0.0, 0.0, gain, 0.0]) + noise)
    of_contacts = sum(
        weight
        for weight, (_, contact, _) in zip(filters.weights, SIZES, strict=True)
        if contact == CONTACTS[1]
    )
    assert of_contacts > 0.9 if varies else of_contacts < 0.1
    lifted = filters.advanced(1.0, new_contact=True)
    (_, now), (person, of_person) = lifted.of(NOW), lifted.of(PERSON)
    assert np.sqrt(now[2, 2]) > 0.09 if varies else np.sqrt(now[2, 2]) < 0.05
    assert abs(person[2] - PAPER[2]) < 3.0 * np.sqrt(of_person[2, 2])


def test_a_stroke_leaves_the_law_and_a_contact_all_but_its_gain() -> None:
    filters = felt(FingerFilters.begin(PRIOR), PAPER + np.array([0.1, 0.1, 0.2, 0.0]))
    for later in (filters.of_another_stroke(), filters.advanced(0.0, new_contact=True)):
        for before, after in zip(filters.of(PERSON), later.of(PERSON), strict=True):
            np.testing.assert_allclose(after, before, rtol=1e-12)
    stroke = filters.of_another_stroke()
    np.testing.assert_allclose(stroke.of(NOW)[0], filters.of(NOW)[0], rtol=1e-12)


def test_a_filter_that_was_wrong_for_long_comes_back_at_once() -> None:
    filters = FingerFilters.begin(PRIOR)
    steady = np.array([walk[0] < WALKS[-1, 0] for walk, _, _ in SIZES])
    for _ in range(200):
        filters = felt(filters.advanced(0.5, new_contact=False).of_another_stroke(), PAPER)
    assert filters.weights[~steady].sum() < 0.05
    moved = PAPER + np.array([0.3, 0.3, 0.0, 0.0])
    for _ in range(8):
        filters = felt(filters.advanced(0.5, new_contact=False).of_another_stroke(), moved)
    mean, covariance = filters.of(PERSON)
    assert abs(mean[0] - moved[0]) < 3.0 * np.sqrt(covariance[0, 0])


def test_a_finger_that_scatters_is_not_forgotten_for_strokes_that_are_alike(
    rng: np.random.Generator,
) -> None:
    filters = FingerFilters.begin(PRIOR)
    alike = np.array([stroke[1] < STROKES[-1, 1] for _, _, stroke in SIZES])
    for cutoff in (0.0, 0.08, 0.0, 0.0, 0.0):
        noise = rng.multivariate_normal(np.zeros(LAW), 0.01 * NOISE)
        law = PAPER + np.array([cutoff, cutoff, 0.0, 0.0]) + noise
        filters = felt(filters.advanced(0.5, new_contact=False).of_another_stroke(), law)
    assert filters.weights[alike].sum() < 0.01


def test_nothing_that_is_felt_makes_a_covariance_negative(rng: np.random.Generator) -> None:
    filters = FingerFilters.begin(PRIOR)
    for _ in range(500):
        filters = filters.advanced(float(rng.exponential(1.0)), bool(rng.random() < 0.2))
        filters = filters.of_another_stroke() if rng.random() < 0.5 else filters
        filters = felt(filters, PAPER + rng.multivariate_normal(np.zeros(LAW), NOISE))
        assert np.linalg.eigvalsh(filters.covariances * _SCALE).min() > -1e-9


_SCALE = 1.0 / np.outer(*2 * [np.array([1.0, 1.0, 1.0, 1e-4, 1.0, 1.0, 1.0, 1.0])])

"""Between contacts the next one is expected to be like the person, and not like the last."""

import numpy as np
import pytest
from tests.service.tracking.slides import PAPER

from frictus_hardware.arrays import FloatArray
from frictus_service.calibration.coordinates import Prior
from frictus_service.tracking.estimation.finger_filters import CONTACTS, FingerFilters
from frictus_service.tracking.estimation.law_estimate import LawEstimate, advanced
from frictus_service.tracking.policy import Circumstances, held_back

PRIOR = Prior(PAPER, np.diag([0.04, 0.04, 0.36, 1e-9]), 0, "of a test")
MEASURED = np.linalg.inv(np.diag([1e-5, 1e-5, 1e-6, 1e-13]))
"""Information of what one contact says of its law."""
SPEEDS_MM_S = (20.0, 100.0)
SCATTER = float(CONTACTS[-1])


def after(gains: FloatArray) -> LawEstimate:
    """Return the estimate after contacts of these ln gains about PAPER's."""
    estimate = LawEstimate(PRIOR, FingerFilters.begin(PRIOR), np.ones(3), 0.02, 1, 100)
    for gain in gains:
        known = advanced(estimate, 1.0, new_contact=True)
        law = PAPER + np.array([0.0, 0.0, gain, 0.0])
        filters, *_ = known.filters.of_another_stroke().seen(np.zeros(4), MEASURED, law)
        estimate = LawEstimate(PRIOR, filters, np.ones(3), 0.02, 2, 100)
    return estimate


@pytest.mark.parametrize("contacts", [2, 10])
def test_the_mean_of_the_contacts_predicts_the_next_better_than_the_last(
    contacts: int, rng: np.random.Generator
) -> None:
    fingers = 300
    gains = SCATTER * rng.standard_normal((fingers, contacts + 1))
    expected, last = np.zeros(fingers), np.zeros(fingers)
    for number, (*before, _) in enumerate(gains):
        estimate = after(np.array(before))
        last[number] = estimate.mean[2] - PAPER[2]
        expected[number] = advanced(estimate, 0.0, new_contact=True).mean[2] - PAPER[2]
    rms = [np.sqrt(np.mean(np.square(each - gains[:, -1]))) for each in (last, expected)]
    # Of independent gains: the difference of two, and of one from the mean of n others.
    assert rms[0] == pytest.approx(SCATTER * np.sqrt(2.0), rel=0.12)
    assert rms[1] == pytest.approx(SCATTER * np.sqrt(1.0 + 1.0 / contacts), rel=0.12)


def test_a_model_of_the_last_contact_goes_back_to_the_persons(
    rng: np.random.Generator,
) -> None:
    gains = np.append(SCATTER * rng.standard_normal(5), 2.0 * SCATTER)
    estimate = after(gains)
    expected = advanced(estimate, 0.0, new_contact=True)

    def why(in_force: FloatArray, returning: bool) -> str:
        now = Circumstances(returning=returning)
        return held_back(expected, in_force, PRIOR, SPEEDS_MM_S, (), now)

    assert why(estimate.mean, returning=True) == ""
    # The next contact's gain is known no better than contacts are alike: nothing is followed.
    assert "5 % is asked" in why(estimate.mean, returning=False)
    assert "fits as well" in why(expected.mean, returning=True)


def test_a_finger_whose_contacts_are_alike_stays_as_it_is() -> None:
    estimate = after(np.zeros(8))
    expected = advanced(estimate, 0.0, new_contact=True)
    found = held_back(
        expected, estimate.mean, PRIOR, SPEEDS_MM_S, (), Circumstances(returning=True)
    )
    assert "fits as well" in found
    assert np.sqrt(expected.covariance[2, 2]) < 0.02

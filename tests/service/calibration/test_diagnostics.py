"""Diagnostics of a fit, on trials drawn from known laws: they are right where the law is."""

from collections.abc import Sequence

import numpy as np
import pytest

from frictus.model import FirstOrderSpeedLaw, Model
from frictus_hardware.arrays import FloatArray
from frictus_service.calibration import coordinates, design
from frictus_service.calibration.coordinates import Prior
from frictus_service.calibration.diagnostics import (
    FEWEST_TRIALS,
    FOLDS,
    FitDiagnostics,
    HeldOutFit,
    diagnose,
)
from frictus_service.calibration.plan import Ask
from frictus_service.calibration.posterior import estimate
from frictus_service.calibration.precision import Variation, draw
from frictus_service.errors import EstimateError
from frictus_service.identification.observation.response import TrialObservations

from .test_posterior import STEADY, asks_of, somebody

N = 36
N_SPEEDS, N_TONES = 6, 12


def law_at(at: FloatArray) -> Model:
    gain_n, cutoff_0_hz, slope, skew_s = coordinates.to_law(at)
    base = FirstOrderSpeedLaw(gain_n=gain_n, cutoff_0_hz=cutoff_0_hz, slope_hz_per_mm_s=slope)
    return Model(base=base, skew_s=skew_s)


def fitted(observations: Sequence[TrialObservations]) -> Model:
    return law_at(estimate(observations, None).parameters)


def diagnosed(
    rng: np.random.Generator, truth: FloatArray, variation: Variation, n: int = N
) -> FitDiagnostics:
    trials = draw(rng, truth, asks_of(rng, n), variation)
    return diagnose(trials, fitted(trials), fitted)


def of(found: FitDiagnostics) -> HeldOutFit:
    assert found.held_out is not None, found.note
    return found.held_out


@pytest.mark.long
def test_points_lie_about_the_truth_by_their_intervals(rng: np.random.Generator) -> None:
    held = []
    for _ in range(16):  # the points of one speed share their trials, and so their fate
        truth = somebody(rng)
        points = diagnosed(rng, truth, STEADY).points
        assert len(points) == N_SPEEDS * N_TONES
        for point in points:
            assert point.interval_n is not None
            low_n, high_n = point.interval_n
            assert low_n < point.magnitude_n < high_n
            true = coordinates.response(
                truth, np.array(point.speed_mm_s), np.array(point.tone_hz)
            )
            held.append(low_n < abs(true) < high_n)
            apart = np.angle(np.exp(1j * np.radians(point.phase_deg)) / true)
            assert abs(np.degrees(apart)) < 10.0
    assert 0.85 < np.mean(held) <= 1.0


@pytest.mark.long
def test_of_a_law_that_holds_residuals_are_what_the_scatter_makes_of_them(
    rng: np.random.Generator,
) -> None:
    found = [diagnosed(rng, somebody(rng), STEADY) for _ in range(6)]
    assert 0.6 < np.mean([one.standardised for one in found if one.standardised]) < 1.4
    assert all(one.residual_db < 1.0 for one in found)


def test_a_law_that_does_not_hold_is_seen_in_its_residuals(rng: np.random.Generator) -> None:
    trials = draw(rng, somebody(rng), asks_of(rng, N), STEADY)
    right = estimate(trials, None).parameters
    wrong = right - np.array([0.0, np.log(2.0), 0.0, 0.0])  # at 100 mm/s
    good, bad = (diagnose(trials, law_at(at), fitted) for at in (right, wrong))
    assert bad.residual_db > 2.0 * good.residual_db
    assert good.standardised is not None
    assert bad.standardised is not None
    assert bad.standardised > 2.0 * good.standardised
    worst = max(bad.points, key=lambda point: abs(point.residual_db))
    assert worst.speed_mm_s > 80.0


@pytest.mark.long
def test_what_was_not_seen_is_met_less_well_than_what_was_and_better_than_by_a_placeholder(
    rng: np.random.Generator,
) -> None:
    found = []
    for _ in range(6):
        truth = somebody(rng)
        truth[2] += np.log(2.0)
        found.append(of(diagnosed(rng, truth, Variation())))
    assert {one.folds for one in found} == {FOLDS}
    more = [one.held_out_db - one.in_sample_db for one in found]
    assert np.mean(more) > 0.0
    assert max(one.held_out_db for one in found) < 2.0
    assert min(one.placeholder_db for one in found) > 2.5


def test_held_out_is_what_the_gain_scatters_by_where_nothing_else_does(
    rng: np.random.Generator,
) -> None:
    silent = Variation(0.1, 0.0, 0.0, 0.0, 0.0, 1e-7, 0.0)
    found = of(diagnosed(rng, somebody(rng), silent, 60))
    scatter_db = 20.0 * np.log10(np.e) * 0.1
    assert found.in_sample_db == pytest.approx(scatter_db, rel=0.3)
    assert found.in_sample_db < found.held_out_db < 1.1 * found.in_sample_db


def test_trials_of_one_tone_make_points_without_intervals(rng: np.random.Generator) -> None:
    asks = [
        Ask(speed, 0.4, design.single(tone), 7.0, 10.0)
        for speed in (20.0, 100.0)
        for tone in design.paper_tones()
    ]
    trials = draw(rng, somebody(rng), asks, STEADY)
    found = diagnose(trials, fitted(trials), fitted)
    assert {(point.trials, point.interval_n) for point in found.points} == {(1, None)}
    assert found.standardised is None
    assert found.held_out is not None


def test_of_few_trials_nothing_is_held_out_and_that_is_said(rng: np.random.Generator) -> None:
    found = diagnosed(rng, somebody(rng), STEADY, FEWEST_TRIALS - 1)
    assert found.held_out is None
    assert f"takes {FEWEST_TRIALS} valid trials" in found.note
    assert found.points


def test_folds_are_estimated_from_trials_as_they_were_observed(
    rng: np.random.Generator,
) -> None:
    """As the model was: else rows beyond the law's speeds would be discounted twice."""
    trials = draw(rng, somebody(rng), asks_of(rng, N), STEADY)
    given: list[TrialObservations] = []

    def seen(some: Sequence[TrialObservations]) -> Model:
        given.extend(some)
        return fitted(some)

    diagnose(trials, fitted(trials), seen)
    assert {id(one) for one in given} == {id(one) for one in trials}


def test_a_part_that_makes_no_law_is_told(rng: np.random.Generator) -> None:
    def refuse(_: Sequence[TrialObservations]) -> Model:
        raise EstimateError("too few")

    trials = draw(rng, somebody(rng), asks_of(rng, N), STEADY)
    found = diagnose(trials, law_at(Prior.weak().mean), refuse)
    assert found.held_out is None
    assert "no law can be made (too few)" in found.note
    with pytest.raises(EstimateError, match="no valid trial"):
        diagnose([], law_at(Prior.weak().mean), refuse)

"""Fits: against analytic values, the package psignifit, and simulated observers."""

import math
from typing import Any

import numpy as np
import pytest
from psignifit import psignifit

from frictus import ArgumentError
from frictus.experiment import fit, probability
from frictus.experiment.psychometrics.psychometric import ParameterGrid, threshold_of
from frictus.experiment.psychometrics.results import (
    geometric_mean,
    power_law_exponent,
    student_quantile,
)

LEVELS = np.repeat(np.geomspace(0.01, 0.16, 7), 30)


def test_the_function_has_its_analytic_values() -> None:
    assert probability(0.05, 0.05, 3.0, 0.5, 0.02) == pytest.approx(
        0.5 + 0.48 * (1.0 - math.exp(-1.0))
    )
    assert probability(0.0, 0.05, 3.0, 0.1, 0.02) == pytest.approx(0.1)
    assert probability(1e6, 0.05, 3.0, 0.1, 0.02) == pytest.approx(0.98)
    assert probability(0.05, 0.05, 3.0, 0.0, 0.0, "logistic") == pytest.approx(0.5)
    for family in ("weibull", "logistic"):
        threshold = threshold_of(0.03, 2.0, family)
        assert probability(0.03, threshold, 2.0, 0.5, 0.0, family) == pytest.approx(0.75)


def answers(half: float, slope: float, lapse: float, rng: np.random.Generator) -> np.ndarray:
    threshold = threshold_of(half, slope)
    positive: np.ndarray = rng.random(LEVELS.size) < probability(
        LEVELS, threshold, slope, 0.5, lapse
    )
    return positive


def test_a_fit_of_exact_proportions_is_the_function() -> None:
    levels = np.geomspace(0.01, 0.16, 9)
    p = probability(levels, threshold_of(0.04, 2.5), 2.5, 0.5, 0.02)
    many = 2_000
    hits = np.round(many * p).astype(int)
    trials = np.repeat(levels, many)
    positive = np.concatenate([np.arange(many) < hit for hit in hits])
    found = fit(trials, positive)
    assert found.threshold.value == pytest.approx(0.04, rel=0.02)
    assert found.threshold_ml.value == pytest.approx(0.04, rel=0.03)
    assert found.slope.value == pytest.approx(2.5, rel=0.1)
    assert found.threshold.high / found.threshold.low < 1.1
    assert not found.open_ended


@pytest.mark.parametrize(("guess", "lapse"), [(0.5, 0.2), (0.5, 0.02), (0.1, 0.3)])
def test_a_careless_or_liberal_observer_has_the_threshold_that_is_there(
    guess: float, lapse: float
) -> None:
    levels, many = np.append(np.geomspace(0.01, 0.16, 9), 0.0), 500
    p = probability(levels, threshold_of(0.04, 2.5), 2.5, guess, lapse)
    hits = np.round(many * p).astype(int)
    positive = np.concatenate([np.arange(many) < hit for hit in hits])
    for rate in (guess, None):  # known, and from the catch trials
        found = fit(np.repeat(levels, many), positive, rate)
        assert found.threshold.value == pytest.approx(0.04, rel=0.05)
        assert found.threshold.holds(0.04)
        assert found.lapse == pytest.approx(lapse, abs=0.02)


def test_thresholds_agree_with_psignifit(rng: np.random.Generator) -> None:
    steps = {"threshold": 30, "width": 15, "lambda": 8, "gamma": 1, "eta": 5}
    positive = answers(0.035, 2.5, 0.02, rng)
    ours = fit(LEVELS, positive)
    rows = [
        [math.log10(level), int(np.sum(positive[LEVELS == level])), 30]
        for level in np.unique(LEVELS)
    ]
    # A Weibull function of the level is a Gumbel function of its logarithm.
    theirs = psignifit(
        np.array(rows), sigmoid="gumbel", experiment_type="2AFC", grid_steps=steps
    )
    low, high = theirs.confidence_intervals["threshold"]["0.95"]
    width = math.log10(ours.threshold.high / ours.threshold.low)
    difference = math.log10(ours.threshold.value) - theirs.parameter_estimate["threshold"]
    assert abs(difference) < 0.25 * width
    assert 0.5 * width < high - low < 2.0 * width


def test_intervals_hold_the_truth_as_often_as_they_say(rng: np.random.Generator) -> None:
    posterior = likelihood = 0
    for _ in range(100):
        half, slope = 10.0 ** rng.uniform(-1.7, -1.2), 2.5 * 2.0 ** rng.normal(0.0, 0.7)
        found = fit(LEVELS, answers(half, slope, float(rng.uniform(0.0, 0.05)), rng))
        posterior += found.threshold.holds(half)
        likelihood += found.threshold_ml.holds(half)
    # Of 100 at 0.95, fewer than 88 come once in 500 times.
    assert posterior >= 88
    assert likelihood >= 86


def test_more_confidence_is_a_wider_interval(rng: np.random.Generator) -> None:
    positive = answers(0.04, 2.5, 0.02, rng)
    for name in ("threshold", "threshold_ml"):
        narrow = getattr(fit(LEVELS, positive, confidence=0.5), name)
        wide = getattr(fit(LEVELS, positive, confidence=0.99), name)
        assert wide.low < narrow.low < narrow.high < wide.high


def test_catch_trials_tell_the_guess_rate(rng: np.random.Generator) -> None:
    levels = np.concatenate([np.full(200, 0.0), LEVELS])
    threshold = threshold_of(0.04, 2.5)
    positive = rng.random(levels.size) < probability(levels, threshold, 2.5, 0.2, 0.02)
    found = fit(levels, positive, None)
    assert found.guess == pytest.approx(0.2, abs=0.08)
    assert found.threshold.value == pytest.approx(0.04, rel=0.4)


def test_answers_that_bound_nothing_say_so() -> None:
    assert fit([0.1, 0.1, 0.1], [True, True, True]).open_ended
    assert fit([0.1] * 20, [True, False] * 10).open_ended


@pytest.mark.parametrize(
    ("levels", "positive", "more", "says"),
    [
        ([], [], {}, "at least 1"),
        ([0.1], [True, False], {}, "as many"),
        ([-0.1], [True], {}, "0 "),
        ([0.0], [True], {}, "above"),
        ([math.nan], [True], {}, "finite"),
        ([0.1], [True], {"confidence": 1.0}, "0.999"),
        ([0.1], [True], {"guess": math.nan}, "guess"),
    ],
)
def test_what_cannot_be_fitted_is_refused(
    levels: list[float], positive: list[bool], more: dict[str, Any], says: str
) -> None:
    with pytest.raises(ArgumentError, match=says):
        fit(levels, positive, **more)


def test_grids_are_checked() -> None:
    with pytest.raises(ArgumentError, match="above 0"):
        ParameterGrid.of([0.0], [1.0], [0.5], [0.01])
    with pytest.raises(ArgumentError, match="guess"):
        ParameterGrid.of([0.1], [1.0], [0.7], [0.01])


@pytest.mark.parametrize(
    ("freedom", "value"), [(1, 12.706), (2, 4.303), (9, 2.262), (100, 1.984)]
)
def test_student_quantiles(freedom: int, value: float) -> None:
    assert student_quantile(0.975, freedom) == pytest.approx(value, rel=1e-3)


def test_magnitudes_on_a_power_law_have_its_exponent() -> None:
    levels = np.geomspace(0.01, 0.1, 8)
    found = power_law_exponent(levels, 30.0 * levels**0.6)
    assert (found.value, found.low, found.high) == pytest.approx((0.6, 0.6, 0.6))


def test_the_mean_setting_is_geometric() -> None:
    found = geometric_mean([0.01, 0.1])
    assert found.value == pytest.approx(math.sqrt(0.001))
    half = 12.706 * np.std([-2.0, -1.0], ddof=1) / math.sqrt(2.0)
    assert math.log10(found.high) == pytest.approx(-1.5 + half, rel=1e-3)


@pytest.mark.parametrize(
    ("guess", "given", "lapse"), [(0.08, None, 0.02), (0.5, 0.5, 0.135)], ids=["guess", "lapse"]
)
def test_thousands_of_trials_resolve_rates_between_the_steps_of_the_grid(
    guess: float, given: float | None, lapse: float
) -> None:
    half, slope, count = 0.02, 2.67, 1_000
    distinct = np.r_[0.0, np.geomspace(0.004, 0.16, 7)]
    p = probability(distinct, threshold_of(half, slope), slope, guess, lapse)
    right = np.concatenate([np.arange(count) < round(count * share) for share in p])
    found = fit(np.repeat(distinct, count), right, given)  # as often as is expected
    assert (found.guess, found.lapse) == pytest.approx((guess, lapse), abs=0.01)
    for estimate in (found.threshold, found.threshold_ml):
        low, high = np.log10([estimate.low, estimate.high])
        assert abs(np.log10(estimate.value / half)) < 0.1 * (high - low)
    assert found.slope.value == pytest.approx(slope, rel=0.05)

"""Spread from likelihoods: the formula against likelihoods computed the long way."""

import math

import numpy as np
import pytest
from scipy import stats

from frictus_laboratory.reproduction.paper import (
    CONDITIONS,
    LIKELIHOODS,
    PARTICIPANTS,
    STIFFNESS_20_N_M,
    Likelihoods,
)
from frictus_laboratory.reproduction.population import MeasurementSpread, spread_of


def likelihoods(spread: MeasurementSpread) -> Likelihoods:
    """The -2 log-likelihoods that a spread of the paper's participants gives rise to."""
    count = PARTICIPANTS * CONDITIONS
    constant = count * (1.0 + math.log(2.0 * math.pi))
    within, between = spread.residual**2, spread.between**2
    clustered = PARTICIPANTS * math.log(1.0 + CONDITIONS * between / within)
    return Likelihoods(
        reduced=constant + count * math.log(within + between),
        full=constant + count * math.log(within) + clustered,
    )


@pytest.mark.parametrize("name", LIKELIHOODS)
def test_paper_likelihoods_come_back(name: str) -> None:
    found = likelihoods(spread_of(LIKELIHOODS[name]))
    assert found.reduced == pytest.approx(LIKELIHOODS[name].reduced, abs=1e-6)
    assert found.full == pytest.approx(LIKELIHOODS[name].full, abs=1e-6)


def test_formula_is_the_largest_likelihood_of_data(rng: np.random.Generator) -> None:
    people, conditions = 20, 8  # of six, one time in a thousand none seems to differ
    data = rng.normal(0.0, 2.0, (people, 1)) + rng.normal(0.0, 1.0, (people, conditions))
    data -= data.mean()
    within = np.sum((data - data.mean(axis=1, keepdims=True)) ** 2) / (
        people * (conditions - 1)
    )
    between = np.sum(data.mean(axis=1) ** 2) / people - within / conditions
    covariance = np.eye(conditions) * within + between
    density = stats.multivariate_normal(np.zeros(conditions), covariance)
    full = -2.0 * np.sum(density.logpdf(data))
    flat = stats.norm(0.0, math.sqrt(within + between))
    reduced = -2.0 * np.sum(flat.logpdf(data))
    found = spread_of(Likelihoods(reduced, full), people, conditions)
    assert found.residual == pytest.approx(math.sqrt(within), rel=1e-6)
    assert found.between == pytest.approx(math.sqrt(between), rel=1e-6)


def test_spread_of_the_paper_is_of_the_size_of_its_boxes() -> None:
    cutoff, gain = spread_of(LIKELIHOODS["cutoff"]), spread_of(LIKELIHOODS["gain"])
    assert cutoff.residual == pytest.approx(380.0, rel=0.02)
    assert cutoff.between == pytest.approx(184.0, rel=0.02)
    assert gain.residual == pytest.approx(0.0089, rel=0.02)
    assert gain.between == pytest.approx(0.0045, rel=0.02)
    assert spread_of(LIKELIHOODS["mass"]).residual == pytest.approx(0.0021, rel=0.02)


def test_stiffness_at_40_is_the_example_of_the_paper() -> None:
    assert STIFFNESS_20_N_M + 20.0 * 4.036 == pytest.approx(444.0, rel=0.002)


def test_random_intercept_that_gains_nothing_is_refused() -> None:
    alike = likelihoods(MeasurementSpread(1.0, 0.0))
    with pytest.raises(ValueError, match="above 0"):
        spread_of(alike)

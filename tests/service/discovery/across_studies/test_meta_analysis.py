"""Pooling one size over studies: published examples, statsmodels, and what chance gives."""

import numpy as np
import pytest
from scipy import stats
from statsmodels.stats.meta_analysis import combine_effects

from frictus_hardware.arrays import FloatArray
from frictus_service.discovery.across_studies.meta_analysis import StudySizes, pool

KNOWN = 1e12
"""Degrees of freedom of a variance that is known."""

BCG = StudySizes(
    np.array(
        "-0.8893 -1.5854 -1.3481 -1.4416 -0.2175 -0.7861 -1.6209 0.0120 -0.4694 -1.3713 "
        "-0.3394 0.4459 -0.0173".split(),
        dtype=float,
    ),
    np.array(
        "0.3256 0.1946 0.4154 0.0200 0.0512 0.0069 0.2230 0.0040 0.0564 0.0730 0.0124 "
        "0.5325 0.0714".split(),
        dtype=float,
    ),
    np.full(13, KNOWN),
)
"""Log relative risks of 13 trials of a vaccine (Colditz et al. 1994), four digits."""


def drawn(
    rng: np.random.Generator, studies: int, people: int, tau: float = 0.0, mean: float = 0.0
) -> StudySizes:
    """Return studies whose people scatter by 0.5 to 2, each study by its own."""
    own = mean + tau * rng.standard_normal(studies)
    scatter = rng.uniform(0.5, 2.0, (studies, 1))
    values = own[:, np.newaxis] + scatter * rng.standard_normal((studies, people))
    degrees = np.full(studies, people - 1.0)
    return StudySizes(values.mean(axis=1), values.var(axis=1, ddof=1) / people, degrees)


def test_as_published_where_variances_are_known() -> None:
    found = pool(BCG)
    assert found.q == pytest.approx(152.233, rel=5e-3)  # variances have few digits
    low, high = np.square(found.tau_ci95)
    assert low == pytest.approx(0.1197, rel=5e-3)  # Viechtbauer (2007), table III
    assert high == pytest.approx(1.1115, rel=5e-3)


def test_as_statsmodels_where_variances_are_known() -> None:
    theirs = combine_effects(BCG.value, BCG.variance, method_re="iterated", atol=1e-12)
    found = pool(BCG)
    assert found.tau**2 == pytest.approx(theirs.tau2, rel=1e-5)
    assert found.q == pytest.approx(theirs.q, rel=1e-9)
    # At Paule and Mandel's tau the weighted scatter is 1, as Hartung and Knapp's correction.
    assert found.value == pytest.approx(theirs.mean_effect_re, rel=1e-5)
    assert found.standard_error == pytest.approx(theirs.sd_eff_w_re_hksj, rel=1e-4)
    half = stats.t.ppf(0.975, 12) * found.standard_error
    assert found.ci95 == pytest.approx((found.value - half, found.value + half), rel=1e-6)


def test_by_hand() -> None:
    sizes = StudySizes(np.array([1.0, 2.0, 6.0]), np.full(3, 1.0), np.full(3, KNOWN))
    found = pool(sizes)
    # Of equal variances: the mean, Q = sum of squares = 14, and tau squared = 14 / 2 - 1.
    assert found.value == pytest.approx(3.0)
    assert found.q == pytest.approx(14.0)
    assert found.tau**2 == pytest.approx(6.0, rel=1e-6)
    assert found.standard_error == pytest.approx(np.sqrt(7.0 / 3.0), rel=1e-6)
    assert found.i2 == pytest.approx(6.0 / 7.0, rel=1e-6)
    assert found.p_tau == pytest.approx(stats.chi2.sf(14.0, 2), rel=1e-6)
    t = 3.0 / np.sqrt(7.0 / 3.0)
    assert found.p_mean == pytest.approx(2.0 * stats.t.sf(t, 2), rel=1e-6)
    wide = stats.t.ppf(0.975, 1) * np.sqrt(6.0 + 7.0 / 3.0)
    assert found.prediction95 == pytest.approx((3.0 - wide, 3.0 + wide), rel=1e-6)


def test_welch_is_that_of_statsmodels(rng: np.random.Generator) -> None:
    from statsmodels.stats.oneway import anova_generic

    sizes = drawn(rng, 5, 7, tau=0.4)
    welch = anova_generic(
        sizes.value, sizes.variance * 7, np.full(5, 7), use_var="unequal", welch_correction=True
    )
    assert pool(sizes).p_tau == pytest.approx(welch.pvalue, rel=1e-6)


def test_within_the_margin_there_is_nothing(rng: np.random.Generator) -> None:
    sizes = drawn(rng, 12, 8, mean=0.02, tau=0.02)
    precise = StudySizes(
        0.02 + 0.01 * rng.standard_normal(12), sizes.variance * 1e-6, sizes.degrees
    )
    assert pool(precise).p_mean < 0.01
    assert pool(precise).p_tau < 0.01
    assert pool(precise, 0.05).p_mean > 0.5
    assert pool(precise, 0.05).p_tau > 0.5


def test_one_sided_of_what_cannot_be_negative() -> None:
    below = StudySizes(np.array([-1.0, -1.1, -0.9, -1.2]), np.full(4, 0.01), np.full(4, 7.0))
    assert pool(below).p_mean < 0.01
    assert pool(below, positive=True).p_mean > 0.99


def test_two_studies_predict_no_third(rng: np.random.Generator) -> None:
    assert pool(drawn(rng, 2, 8)).prediction95 is None
    with pytest.raises(ValueError, match="1 studies; accepted: 2 or more"):
        pool(drawn(rng, 1, 8))


@pytest.mark.parametrize(("studies", "people"), [(20, 8), (6, 6)])
def test_chance_is_not_significant(studies: int, people: int, rng: np.random.Generator) -> None:
    """Rejections of a 5 % test stay within what chance allows; those of Cochran's Q do not."""
    draws = 400
    found = [pool(drawn(rng, studies, people)) for _ in range(draws)]
    most = stats.binom.ppf(0.9999, draws, 0.065)
    assert sum(each.p_mean <= 0.05 for each in found) <= most
    assert sum(each.p_tau <= 0.05 for each in found) <= most
    cochran = stats.chi2.sf([each.q for each in found], studies - 1)
    assert np.sum(cochran <= 0.05) > most


def test_intervals_hold_the_truth(rng: np.random.Generator) -> None:
    draws, tau = 300, 0.8
    held: FloatArray = np.zeros(3)
    for _ in range(draws):
        found = pool(drawn(rng, 12, 10, tau=tau, mean=1.0))
        assert found.prediction95 is not None
        new = 1.0 + tau * rng.standard_normal()
        ends = ((found.ci95, 1.0), (found.tau_ci95, tau), (found.prediction95, new))
        held += [low <= value <= high for (low, high), value in ends]
    assert np.all(held >= stats.binom.ppf(1e-4, draws, (0.94, 0.94, 0.91)))

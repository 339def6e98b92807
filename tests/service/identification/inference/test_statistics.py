"""Inference across participants, against what is known exactly."""

from itertools import product

import numpy as np
import pytest
from scipy import stats

from frictus_service.identification.fit.estimates import Cells
from frictus_service.identification.inference.effects import (
    Centre,
    across_participants,
    per_participant,
)
from frictus_service.identification.inference.mixed_models import (
    CRITICAL,
    cross_check,
    people_differ,
    random_intercept,
)
from frictus_service.identification.inference.statistics import (
    far_off,
    flip_signs,
    geometric_mean_of,
    holm,
    lognormal_mean_of,
    mean_of,
    p_of_t,
    t_of,
)


def test_t_is_students(rng: np.random.Generator) -> None:
    values = rng.standard_normal(9) + 0.5
    found = stats.ttest_1samp(values, 0.0)
    assert t_of(values[:, np.newaxis])[0] == pytest.approx(found.statistic)
    assert p_of_t(float(found.statistic), 8) == pytest.approx(found.pvalue)
    interval = found.confidence_interval()
    assert mean_of(values).ci95 == pytest.approx((interval.low, interval.high))


def test_geometric_mean_scales_and_refuses(rng: np.random.Generator) -> None:
    values = np.exp(rng.standard_normal(7))
    once, ten = geometric_mean_of(values), geometric_mean_of(10.0 * values)
    assert once is not None
    assert ten is not None
    assert once.ci95 is not None
    assert ten.ci95 == pytest.approx(tuple(10.0 * end for end in once.ci95))
    assert geometric_mean_of(np.append(values, -1.0)) is None


def test_interval_for_skewed_values_holds_their_mean(rng: np.random.Generator) -> None:
    """Student's interval of the same values holds it in 87 %."""
    sigma, n, studies = 0.8, 8, 4000
    held = 0
    for values in np.exp(sigma * rng.standard_normal((studies, n)) - sigma**2 / 2.0):
        found = lognormal_mean_of(values)
        assert found is not None
        assert found.ci95 is not None
        assert found.ci95[0] < found.value < found.ci95[1]
        held += found.ci95[0] < 1.0 < found.ci95[1]
    assert 0.925 < held / studies < 0.97
    assert lognormal_mean_of(np.array([1.0, 0.0])) is None
    assert lognormal_mean_of(np.array([1.0])) is None


def test_sign_flips_are_all_of_them(rng: np.random.Generator) -> None:
    values = rng.normal((1.0, 0.0), 1.0, (7, 2))
    found = flip_signs(values, rng)
    assert found is not None
    flips = np.array(list(product((-1.0, 1.0), repeat=7)))
    t = np.abs(np.array([t_of(sign[:, np.newaxis] * values) for sign in flips]))
    seen = np.abs(t_of(values)) * (1.0 - 1e-9)
    np.testing.assert_allclose(found[0], np.mean(t >= seen, axis=0))
    np.testing.assert_allclose(found[1], np.mean(t.max(axis=1)[:, np.newaxis] >= seen, axis=0))


def test_eight_who_agree_attain_one_in_128(rng: np.random.Generator) -> None:
    found = flip_signs(rng.uniform(1.0, 1.1, (8, 1)), rng)
    assert found is not None
    assert found[0][0] == pytest.approx(1.0 / 128.0)


def test_five_cannot_reach_five_per_cent(rng: np.random.Generator) -> None:
    assert flip_signs(np.ones((5, 1)), rng) is None


def test_max_t_holds_its_level(rng: np.random.Generator) -> None:
    # Fifteen nulls, skewed and correlated: 400 studies, 5 % of which may be wrong.
    wrong = 0
    for _ in range(400):
        shared = rng.standard_normal((8, 1))
        found = flip_signs(
            rng.standard_t(3, (8, 15)) + shared * rng.choice([-1, 1], (8, 1)), rng
        )
        assert found is not None
        wrong += bool(found[1].min() < 0.05)
    assert wrong <= stats.binom.ppf(0.9999, 400, 0.05)


def test_many_participants_are_flipped_at_random(rng: np.random.Generator) -> None:
    values = rng.standard_normal((20, 1)) + 1.0
    found = flip_signs(values, rng)
    assert found is not None
    assert found[0][0] == pytest.approx(stats.ttest_1samp(values[:, 0], 0.0).pvalue, abs=0.01)


def test_holm_by_hand() -> None:
    np.testing.assert_allclose(holm(np.array([0.01, 0.04, 0.03, 0.5])), [0.04, 0.09, 0.09, 0.5])


def test_far_off_names_the_one_that_is() -> None:
    residual = np.array([0.0, 0.0, 0.1, -0.1, 0.12, -0.09, 0.08, 1.0])
    assert np.flatnonzero(far_off(residual, 2, 0.01, 4.0)).tolist() == [7]


def plane(rng: np.random.Generator, n_people: int, between: float, slope_sd: float) -> Cells:
    speed, force = (grid.ravel() for grid in np.meshgrid([20.0, 60.0, 100.0], [0.2, 0.4, 0.6]))
    person = np.repeat(np.arange(n_people), speed.size)
    level = rng.normal(0.0, between, n_people)
    slope = rng.normal(0.0, slope_sd, n_people)
    value = 10.0 + level[person] + slope[person] * (np.tile(speed, n_people) - 60.0)
    value += rng.normal(0.0, 0.1, person.size)
    return Cells(person, np.tile(speed, n_people), np.tile(force, n_people), value)


CENTRE = Centre.of([20.0, 60.0, 100.0], [0.2, 0.4, 0.6])


def test_effects_of_an_exact_plane() -> None:
    speed = np.array([20.0, 20.0, 60.0, 100.0, 100.0])
    force = np.array([0.2, 0.6, 0.4, 0.2, 0.6])
    value = 5.0 + 0.1 * (speed - 60.0) - 2.0 * (force - 0.4)
    value += 0.05 * (speed - 60.0) * (force - 0.4)
    cells = Cells(np.zeros(5, dtype=np.int64), speed, force, value)
    np.testing.assert_allclose(per_participant(cells, CENTRE, 1), [[5.0, 0.1, -2.0, 0.05]])


def test_people_who_lean_each_their_way_are_no_effect(rng: np.random.Generator) -> None:
    """A random intercept alone calls this significant in most studies."""
    wrong = sum(
        (across_participants({"gain": plane(rng, 8, 1.0, 0.01)}, CENTRE, 8, rng)[0].p or 0.0)
        < 0.05
        for _ in range(300)
    )
    assert wrong <= stats.binom.ppf(0.9999, 300, 0.05)


def test_random_intercept_is_that_of_statsmodels(rng: np.random.Generator) -> None:
    from statsmodels.regression.mixed_linear_model import MixedLM

    cells = plane(rng, 10, 1.0, 0.0)
    design = CENTRE.design(cells) / [1.0, 40.0, 0.2, 8.0]
    mine = random_intercept(cells.value, design, cells.person)
    theirs = MixedLM(cells.value, design, groups=cells.person).fit(reml=False)
    assert mine.full == pytest.approx(-2.0 * theirs.llf, abs=1e-3)
    assert mine.residual_variance == pytest.approx(theirs.scale, rel=1e-2)


def test_spread_of_people_is_found_and_its_absence_too(rng: np.random.Generator) -> None:
    there = people_differ("gain", plane(rng, 10, 1.0, 0.0), CENTRE)
    assert there is not None
    assert there.p < 1e-6
    assert 0.2 < there.between_sd < 2.2  # of nine degrees of freedom
    nulls = [people_differ("gain", plane(rng, 10, 0.0, 0.0), CENTRE) for _ in range(200)]
    wrong = sum(one is not None and one.ratio > CRITICAL for one in nulls)
    assert wrong <= stats.binom.ppf(0.9999, 200, 0.05)
    assert sum(one is not None and one.ratio < 1e-6 for one in nulls) > 60


def test_mixed_model_is_not_trusted_without_variance(rng: np.random.Generator) -> None:
    none = cross_check(plane(rng, 8, 0.0, 0.0), CENTRE)
    assert all(check.trusted == (check.why_not is None) for check in none.values())
    some = cross_check(plane(rng, 12, 1.0, 0.01), CENTRE)
    assert some["speed"].trusted
    assert some["speed"].value == pytest.approx(0.0, abs=0.03)


@pytest.mark.long
def test_mixed_model_of_too_little_is_not_trusted_and_not_nan(rng: np.random.Generator) -> None:
    for _ in range(20):
        cells = Cells(
            np.repeat([0, 1], 2),
            np.tile([40.0, 100.0], 2) + rng.normal(0.0, 1.0, 4),
            np.full(4, 0.4),
            np.exp(rng.standard_normal(4)),
        )
        for check in cross_check(cells, Centre.of([40.0, 100.0], [0.4])).values():
            assert check.trusted == (check.why_not is None)

import numpy as np
import pytest

from frictus_service.discovery.inference.significance import (
    critical_t,
    largest_of_flips,
    signs,
)


def test_all_flips_once(rng: np.random.Generator) -> None:
    flips = signs(7, rng)
    assert flips.shape == (128, 7)
    assert np.all(flips[0] == 1.0)
    assert np.unique(flips, axis=0).shape[0] == 128
    assert signs(20, rng).shape[1] == 20


def test_nulls_are_significant_as_often_as_asked(rng: np.random.Generator) -> None:
    """5 % of 400 studies is 20 ± 4.4; the attainable level with 8 units is 6 of 128."""
    flips = signs(8, rng)
    hits = 0
    for _ in range(400):
        scale = rng.uniform(0.2, 5.0, 10)
        estimates = rng.standard_normal((8, 10)) * scale
        found = largest_of_flips(estimates, np.full((8, 10), 1.0 / 0.5**2), flips)
        hits += float(np.min(found.p)) <= 0.05
    assert hits <= 20 + 4 * 4.4


def test_a_real_effect_stands_out_with_its_sign(rng: np.random.Generator) -> None:
    estimates = rng.standard_normal((8, 12))
    estimates[:, 3] -= 6.0
    found = largest_of_flips(estimates, np.ones((8, 12)), signs(8, rng))
    assert found.p[3] == pytest.approx(found.level)
    assert found.t[3] < 0.0
    assert int(np.nanargmin(found.p)) == 3


def test_five_units_are_never_tested(rng: np.random.Generator) -> None:
    estimates = np.full((8, 2), 3.0)
    estimates[:3, 1] = np.nan
    found = largest_of_flips(estimates, np.ones((8, 2)), signs(8, rng))
    assert np.isfinite(found.p[0])
    assert np.isnan(found.p[1])


def test_where_nothing_is_tested_no_t_is_exceeded(rng: np.random.Generator) -> None:
    estimates, flips = rng.standard_normal((8, 2)), signs(8, rng)
    assert np.isfinite(critical_t(estimates, np.ones((8, 2)), flips, 0.05))
    estimates[:3] = np.nan
    assert critical_t(estimates, np.ones((8, 2)), flips, 0.05) == np.inf


def test_signs_and_order_of_units_do_not_matter(rng: np.random.Generator) -> None:
    estimates = rng.standard_normal((8, 5)) + 0.5
    information = rng.uniform(0.5, 2.0, (8, 5))
    flips = signs(8, rng)
    found = largest_of_flips(estimates, information, flips)
    turned = largest_of_flips(-estimates, information, flips)
    order = rng.permutation(8)
    moved = largest_of_flips(estimates[order], information[order], flips)
    np.testing.assert_allclose(turned.p, found.p)
    np.testing.assert_allclose(turned.t, -found.t)
    np.testing.assert_allclose(moved.p, found.p)

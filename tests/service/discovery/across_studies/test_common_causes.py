"""Causes of all studies together: small ones that all share, and those that differ."""

import numpy as np
from scipy import stats
from tests.service.discovery.across_studies.made_studies import studies

from frictus_service.discovery.across_studies.common_causes import (
    choose_causes,
    pool_candidates,
)
from frictus_service.discovery.across_studies.verdicts import verdict_of

KINDS = ("a", "b", "c", "d")


def test_what_no_study_shows_alone(rng: np.random.Generator) -> None:
    sizes = np.tile([0.0, 0.12, 0.0, 0.0], (20, 1))
    made = studies(rng, sizes)
    assert choose_causes(made, KINDS) == (1,)
    (small,) = pool_candidates(made, (1,))[1:2]
    alone = np.abs(small.seen.sizes.value) > small.seen.sizes.simultaneous_half_width
    assert alone.sum() <= 2
    assert verdict_of(small) == "holds_in_all"
    assert small.pooled is not None
    assert abs(small.pooled.value - 0.12) < 4.0 * small.pooled.standard_error


def test_what_differs(rng: np.random.Generator) -> None:
    sizes = np.zeros((9, 4))
    sizes[:, 0] = np.linspace(0.6, 1.4, 9)
    sizes[::3, 1] = 1.0
    sizes[:, 2] = (-1.0) ** np.arange(9)
    made = studies(rng, sizes)
    chosen = choose_causes(made, KINDS)
    assert set(chosen) == {0, 1, 2}
    found = pool_candidates(made, chosen)
    assert [verdict_of(each) for each in found] == [
        "size_differs",
        "in_some_only",
        "opposite_signs",
        "not_shown",
    ]


def test_of_a_kind_only_one_is_chosen(rng: np.random.Generator) -> None:
    made = studies(rng, np.ones((8, 4)))
    assert len(choose_causes(made, ("a", "a", "a", "b"))) == 2


def test_one_study_with_all_of_it_is_no_common_size(rng: np.random.Generator) -> None:
    sizes = np.zeros((10, 4))
    sizes[4, 2] = 2.0
    made = studies(rng, sizes)
    found = pool_candidates(made, (2,))[2]
    assert found.p_mean > 0.05
    assert verdict_of(found) == "in_some_only"


def test_nothing_is_named_where_nothing_is(rng: np.random.Generator) -> None:
    """Family-wise 5 % over means and differences of all candidates."""
    draws = 60
    named = sum(
        bool(choose_causes(studies(rng, np.zeros((8, 4)), differ=0.3), KINDS))
        for _ in range(draws)
    )
    assert named <= stats.binom.ppf(0.9999, draws, 0.06)

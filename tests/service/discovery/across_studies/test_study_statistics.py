"""Condensed units give what whole ones do; sizes are comparable beside the same causes."""

import numpy as np
from tests.service.discovery.across_studies.made_studies import studies, unit

from frictus_service.discovery.across_studies.study_statistics import (
    condense,
    conditional_sizes,
    decode,
    encode,
)
from frictus_service.discovery.inference.joint_gain import joint_gain
from frictus_service.discovery.inference.linear_model import (
    held_out_gain,
    project_out,
    similarity,
)


def test_condensed_units_give_what_whole_ones_do(rng: np.random.Generator) -> None:
    mixing = np.eye(5) + 0.3 * rng.standard_normal((5, 5))
    whole = [unit(rng, np.array([0.0, 1.0, 0.0, -1.0, 0.5]), mixing) for _ in range(7)]
    small = [condense(each) for each in whole]
    assert {each.readings.size for each in small} == {8}  # two own, five effects, readings
    for chosen in ([], [1], [1, 3]):
        one, other = project_out(whole, chosen), project_out(small, chosen)
        np.testing.assert_allclose(one.along, other.along, atol=1e-9)
        np.testing.assert_allclose(one.information, other.information, atol=1e-9)
        np.testing.assert_allclose(held_out_gain(one), held_out_gain(other), atol=1e-6)
        np.testing.assert_allclose(
            similarity(whole, chosen), similarity(small, chosen), atol=1e-9
        )
    np.testing.assert_allclose(joint_gain(whole, [1, 3]), joint_gain(small, [1, 3]), atol=1e-6)


def test_what_is_kept_comes_back(rng: np.random.Generator) -> None:
    (study,) = studies(rng, np.ones((1, 3)))
    again = decode(encode(study))
    np.testing.assert_array_equal(again.own, study.own)
    one, other = project_out(study.units), project_out(again.units)
    np.testing.assert_array_equal(one.along, other.along)
    assert len(again.designed) == len(study.designed)


def test_a_cause_beside_it_makes_sizes_comparable(rng: np.random.Generator) -> None:
    """All studies have a cause of size 1; designs mix it with another to different degrees."""
    mixing = [np.array([[1.0, share], [0.0, 1.0]]) for share in (0.0, 0.8, 1.6)]
    made = studies(rng, np.tile([1.0, 0.0], (3, 1)), people=20, mixing=mixing)
    alone = conditional_sizes(made, ())[1].sizes
    beside = conditional_sizes(made, (0,))[1].sizes
    assert np.ptp(alone.value) > 0.3
    assert np.all(np.abs(beside.value) < 4.0 * np.sqrt(beside.variance))


def test_a_study_whose_design_does_not_show_it_is_not_pooled(rng: np.random.Generator) -> None:
    blind = np.diag([1.0, 0.0])
    made = studies(rng, np.ones((3, 2)), mixing=[np.eye(2), blind, np.eye(2)])
    shown, partly = conditional_sizes(made, ())
    assert shown.studies == (0, 1, 2)
    assert partly.studies == (0, 2)

"""Gains in nats: of the size that a scatter allows, and those of other people as predicted."""

from typing import Any

import numpy as np
import pytest
from scipy import stats

from frictus_hardware.arrays import FloatArray
from frictus_service.discovery.inference.linear_model import Unit
from frictus_service.discovery.inference.predictive_density import UnitCoefficients

PEOPLE = 12
NOISE = 0.1
STUDIES = 100


def people(
    rng: np.random.Generator, mean: float, k: int = 1, n: int = PEOPLE
) -> UnitCoefficients:
    """Return people who scatter by one about a mean."""
    value = mean + rng.normal(0.0, np.hypot(1.0, NOISE), (n, k))
    return UnitCoefficients(value, np.broadcast_to(NOISE**2 * np.eye(k), (n, k, k)))


@pytest.mark.long
@pytest.mark.parametrize(("mean", "k"), [(1.0, 1), (10.0, 1), (100.0, 1), (5.0, 3)])
def test_gains_of_other_people_lie_where_they_are_predicted(
    mean: float, k: int, rng: np.random.Generator
) -> None:
    """Of 100 studies 95 %, within what chance leaves of 90 to 98 %."""
    inside = 0
    for _ in range(STUDIES):
        study = people(rng, mean, k)
        interval = study.interval_of_another(PEOPLE, rng)
        assert interval is not None
        low, high = interval
        inside += bool(low <= study.of_fresh(people(rng, mean, k)).sum() <= high)
    least = stats.binom.ppf(0.001, STUDIES, 0.90)
    most = stats.binom.ppf(0.999, STUDIES, 0.98)
    assert least <= inside <= most


def test_a_mean_a_hundred_times_as_far_off_gains_its_logarithm(
    rng: np.random.Generator,
) -> None:
    near = people(rng, 30.0)
    far = UnitCoefficients(near.value + 99.0 * 30.0, near.noise)
    gained = far.held_out.mean() - near.held_out.mean()
    assert gained == pytest.approx(np.log(100.0), abs=0.1)
    assert 2.0 < near.held_out.mean() < 6.0


def test_units_of_measurement_change_nothing(rng: np.random.Generator) -> None:
    found = people(rng, 3.0, 2)
    scale = np.array([1e-6, 1e4])
    scaled = UnitCoefficients(
        found.value * scale, found.noise * np.multiply.outer(scale, scale)
    )
    np.testing.assert_allclose(scaled.held_out, found.held_out, rtol=1e-6)


def test_nothing_gains_nothing(rng: np.random.Generator) -> None:
    gains = [people(rng, 0.0).held_out.sum() for _ in range(50)]
    assert np.mean(gains) < 0.0
    assert np.mean(np.array(gains) > 1.0) < 0.2


def test_who_says_nothing_has_no_gain(rng: np.random.Generator) -> None:
    found = people(rng, 5.0)
    value: Any = found.value.copy()
    value[3] = np.nan
    nats: FloatArray = UnitCoefficients(value, found.noise).held_out
    assert nats[3] == 0.0
    assert np.isfinite(nats).all()
    assert np.delete(nats, 3).mean() > 1.0


def test_of_one_unit_there_is_no_interval(rng: np.random.Generator) -> None:
    assert people(rng, 5.0, n=1).interval_of_another(8, rng) is None


def test_as_many_effects_as_units_have_an_interval(rng: np.random.Generator) -> None:
    interval = people(rng, 5.0, k=6, n=6).interval_of_another(6, rng)
    assert interval is not None
    assert np.isfinite(interval).all()


def test_who_knows_more_than_any_other_gains_by_what_others_know(
    rng: np.random.Generator,
) -> None:
    """Three know one effect, two the other, and one both: of that one no other knows all."""
    value = np.full((6, 2), np.nan)
    value[:3, 0] = rng.normal(5.0, 0.1, 3)
    value[3:5, 1] = rng.normal(5.0, 0.1, 2)
    value[5] = 5.0
    noise = np.broadcast_to(NOISE**2 * np.eye(2), (6, 2, 2))
    first_only = value.copy()
    first_only[5, 1] = np.nan
    both, alone = (UnitCoefficients(each, noise).held_out for each in (value, first_only))
    assert both[5] == pytest.approx(alone[5])
    assert np.all(both > 0.0)


def units(rng: np.random.Generator, scale: FloatArray) -> list[Unit]:
    """Return people who have two effects, whose coefficients are counted in other units."""
    n, none = 60, np.zeros(2, dtype=np.bool_)
    made = []
    for _ in range(PEOPLE):
        own, effects = rng.normal(size=(n, 1)), rng.normal(size=(n, 2))
        readings = effects @ rng.normal(3.0, 1.0, 2) + rng.normal(size=n)
        nothing = np.zeros((n, 0))
        made.append(
            Unit(readings, own, effects / scale, nothing, scale, np.zeros(0), none, none)
        )
    return made


@pytest.mark.parametrize("factor", [1e-9, 1e-4, 1e4, 1e9])
def test_what_effects_are_counted_in_changes_no_coefficient(factor: float, seed: int) -> None:
    """A delay in seconds has a signature ten thousand times as long as a share of the gain."""
    scale = np.array([1.0, factor])
    plain = UnitCoefficients.of(units(np.random.default_rng(seed), np.ones(2)), [0, 1])
    other = UnitCoefficients.of(units(np.random.default_rng(seed), scale), [0, 1])
    np.testing.assert_allclose(other.value, plain.value * scale, rtol=1e-9)
    np.testing.assert_allclose(other.held_out, plain.held_out, rtol=1e-6)
    assert plain.held_out.mean() > 0.5

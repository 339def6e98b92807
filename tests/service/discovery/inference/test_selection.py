from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from frictus_hardware.arrays import FloatArray
from frictus_service.discovery.inference.joint_gain import fitted_together, joint_gain
from frictus_service.discovery.inference.linear_model import (
    ProjectedUnits,
    Unit,
    held_out_gain,
    joint,
    project_out,
    similarity,
)
from frictus_service.discovery.inference.selection import select
from frictus_service.discovery.inference.significance import PRIOR_DEGREES, signs
from frictus_service.discovery.problem.problem import as_accurate

LEVEL = 0.05


def unit_of(readings: FloatArray, own: FloatArray, effects: FloatArray) -> Unit:
    none = np.zeros(effects.shape[1])
    return Unit(readings, own, effects, effects[:, :0], none, none[:0], none > 0.0, none > 0.0)


def units(
    rng: np.random.Generator,
    size: Sequence[float],
    *,
    n_units: int = 8,
    between: float = 0.3,
    n: int = 120,
) -> list[Unit]:
    """Return units with an own level and slope, and effects of given mean sizes."""
    found = []
    for _ in range(n_units):
        own = np.column_stack([np.ones(n), np.linspace(-1.0, 1.0, n)])
        effects = rng.standard_normal((n, len(size)))
        own_size = np.array(size) * (1.0 + between * rng.standard_normal(len(size)))
        readings = own @ (5.0 * rng.standard_normal(2)) + effects @ own_size
        found.append(unit_of(readings + rng.standard_normal(n), own, effects))
    return found


def chosen(found: Sequence[Unit], rng: np.random.Generator) -> tuple[int, ...]:
    return select(lambda _: found, signs(len(found), rng), LEVEL).effects


def test_what_is_there_is_found_and_nothing_else(rng: np.random.Generator) -> None:
    size = [0.0] * 12
    size[2], size[9] = 0.6, -0.5
    found = [set(chosen(units(rng, size), rng)) for _ in range(40)]
    missed = sum(not each >= {2, 9} for each in found)
    assert missed <= 1  # 1 of 1600 expected: some study draws people who hardly show it
    more = sum(each > {2, 9} for each in found)
    assert more <= 10  # 2 of 40 expected; more than five standard deviations beyond


def test_nothing_is_rarely_something(rng: np.random.Generator) -> None:
    false = sum(bool(chosen(units(rng, [0.0] * 12), rng)) for _ in range(100))
    assert false <= 14  # 5 of 100 expected; four standard deviations more


def test_own_parameters_are_never_an_effect(rng: np.random.Generator) -> None:
    found = [
        unit_of(unit.readings, unit.own, np.column_stack([unit.own[:, 1], unit.effects]))
        for unit in units(rng, [0.0, 0.0])
    ]
    assert np.isnan(project_out(found).estimates[:, 0]).all()


def test_estimates_are_those_of_one_regression(rng: np.random.Generator) -> None:
    found = units(rng, [0.4, -0.7, 0.0])
    together = joint(found, [0, 1])
    for unit, row in zip(found, together, strict=True):
        columns = np.column_stack([unit.own, unit.effects[:, :2]])
        expected = np.linalg.lstsq(columns, unit.readings, rcond=None)[0][2:]
        assert row == pytest.approx(expected)


def test_held_out_gain_is_what_others_predict(rng: np.random.Generator) -> None:
    found = units(rng, [0.5])
    left = project_out(found)
    gain = held_out_gain(left)[:, 0]
    value, noise = left.estimates[:, 0], 1.0 / left.information[:, 0]
    for place, own in enumerate(value):
        others = np.delete(value, place)
        noisy = PRIOR_DEGREES * np.delete(noise, place).mean() + np.sum(
            np.square(others - others.mean())
        )
        spread = np.sqrt(noisy / (PRIOR_DEGREES + others.size - 1) * (1.0 + 1.0 / others.size))
        expected = stats.norm.logpdf(own, others.mean(), spread) - stats.norm.logpdf(
            own, 0.0, spread
        )
        assert gain[place] == pytest.approx(expected)
    assert gain.sum() > 0.0


def test_on_nothing_the_held_out_gain_is_below_zero(rng: np.random.Generator) -> None:
    gains = [held_out_gain(project_out(units(rng, [0.0] * 12))).sum(axis=0) for _ in range(20)]
    assert np.mean(gains) < 0.0


def test_alike_is_seen_after_own_parameters_are_gone(rng: np.random.Generator) -> None:
    found = []
    for unit in units(rng, [0.0, 0.0]):
        twin = unit.effects[:, 0] + 3.0 * unit.own[:, 1]
        effects = np.column_stack([unit.effects, twin])
        found.append(unit_of(unit.readings, unit.own, effects))
    cosines = similarity(found)
    assert cosines[0, 2] == pytest.approx(1.0)
    assert abs(cosines[0, 1]) < 0.3


def test_who_shows_nothing_of_an_effect_hides_it_in_nobody(rng: np.random.Generator) -> None:
    """Nor does it change how accurately others measure it."""
    people = [*units(rng, [0.6, 0.0]), *units(rng, [0.6, 0.0], n_units=1)]
    people[-1].effects[:, 0] = 0.0
    best = np.full(people[0].readings.size, 0.01)
    people = [replace(unit, accuracy=as_accurate(unit.effects, best)) for unit in people]
    with_all, without = project_out(people), project_out(people[:-1])
    assert with_all.margin[0] == pytest.approx(without.margin[0])
    assert 0.0 < without.margin[0] < 0.1
    one, other = (
        left.significance(signs(len(left.along), rng)) for left in (with_all, without)
    )
    assert one.t[0] == pytest.approx(other.t[0])
    assert one.p[0] < 0.05


def test_who_says_nothing_adds_nothing_to_gains(rng: np.random.Generator) -> None:
    people = units(rng, [0.3, 0.4], between=0.0)
    silent = replace(people[0], effects=np.zeros_like(people[0].effects))
    gain = joint_gain(people, [0, 1])
    with_silent = joint_gain([*people, *[silent] * 8], [0, 1])
    np.testing.assert_allclose(with_silent, [*gain, *[0.0] * 8])
    alone = held_out_gain(project_out([*people, silent]))[:, 0]
    np.testing.assert_allclose(joint_gain([*people, silent], [0]), alone)


def test_who_cannot_tell_two_effects_apart_says_neither(rng: np.random.Generator) -> None:
    people = units(rng, [0.9, 0.4, 0.3], between=0.0)
    alike = people[0].effects.copy()
    alike[:, 1] = 2.0 * alike[:, 0]
    blind = replace(people[0], effects=alike)
    value, _ = fitted_together([*people, blind], [0, 1, 2])
    np.testing.assert_array_equal(np.isnan(value[-1]), [True, True, False])
    assert np.isfinite(value[:-1]).all()
    # What it tells of the third is beside what the two together are.
    whole = replace(blind, effects=alike[:, 1:])
    np.testing.assert_allclose(
        value[-1, 2], fitted_together([whole] * 2, [0, 1])[0][0, 1], rtol=1e-6
    )


def test_gains_together_know_no_units_of_coefficients(rng: np.random.Generator) -> None:
    """In s, the variance of a delay is less than rounding of that of a slope in Hz s/mm."""
    people = units(rng, [0.3, 0.4])
    scale = np.array([1e8, 0.1])
    scaled = [replace(unit, effects=unit.effects * scale) for unit in people]
    np.testing.assert_allclose(joint_gain(scaled, [0, 1]), joint_gain(people, [0, 1]))


@pytest.mark.parametrize("share", [0.03, 1e-4, 1e-9])
def test_who_hardly_shows_an_effect_weighs_nothing(
    share: float, rng: np.random.Generator
) -> None:
    """A coefficient of its own would scatter as much more as its signature is less."""
    people = units(rng, [0.6, 0.4], between=0.0)
    hardly = replace(people[0], effects=people[0].effects * np.array([share, 1.0]))
    some, every = project_out(people), project_out([*people, hardly])
    for one, other in zip(some.tested, every.tested, strict=True):
        np.testing.assert_array_equal(one[:, 0], other[:-1, 0])
    assert not every.information[-1, 0]
    gain = joint_gain([*people, hardly], [0])
    np.testing.assert_allclose(gain, [*joint_gain(people, [0]), 0.0])
    assert every.significance(signs(9, rng)).p[0] < 0.05


def test_gains_of_one_who_is_far_off_are_exact(rng: np.random.Generator) -> None:
    """What all sum up to, less what is far off, is rounding."""
    value = rng.normal(0.5, 0.1, (9, 1))
    near = held_out_gain(of_values(value))[-1, 0]
    value[-1] *= 1e12
    others = value[:-1]
    off, mean = value[-1, 0], others.mean()
    spread = PRIOR_DEGREES + np.square(others - mean).sum()
    spread *= (1.0 + 1.0 / others.size) / (PRIOR_DEGREES + others.size - 1)
    far = held_out_gain(of_values(value))[-1, 0]
    assert far == pytest.approx((off * mean - 0.5 * mean**2) / spread)
    assert far > near


def of_values(value: FloatArray) -> ProjectedUnits:
    none = np.zeros(value.shape[1])
    return ProjectedUnits(value, np.ones_like(value), none, none > 0.0, none > 0.0)


def test_who_did_three_of_many_trials_hides_nothing(rng: np.random.Generator) -> None:
    """The coefficient of the last is known 15 times worse than everybody else's."""
    shown = 0
    for _ in range(20):
        (vague,) = units(rng, [0.5], n_units=1, n=9)
        vague = replace(vague, effects=vague.effects / 5.0)
        found = [*units(rng, [0.5], n_units=8, between=0.2), vague]
        left = project_out(found)
        assert np.flatnonzero(np.isnan(left.estimates[:, 0])).tolist() == [8]
        shown += bool(left.significance(signs(9, rng)).p[0] <= LEVEL)
    assert shown == 20


def test_six_always_count(rng: np.random.Generator) -> None:
    found = units(rng, [0.5], n_units=5) + units(rng, [0.5], n_units=2, n=9)
    estimates = project_out(found).estimates[:, 0]
    assert np.isfinite(estimates[:5]).all()
    assert np.isfinite(estimates).sum() == 6

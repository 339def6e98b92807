"""Which effects are undone, and why the others are not: for every one there is."""

from dataclasses import replace

import numpy as np
import pytest

from frictus_hardware.errors import EffectParameterError
from frictus_hardware.physics.effects import EFFECTS, KNOWN, EffectDefinition, extended
from frictus_hardware.physics.friction import FrictionLaw
from frictus_hardware.physics.simulator import Simulator
from frictus_service.synthesis.compensability import REASONS, inverse_of
from frictus_service.synthesis.compensation import Inverse, Ranges

LAW = FrictionLaw()


def small(effect: EffectDefinition) -> dict[str, float]:
    """A small dose; the middle of what else there is."""
    dose, *others = effect.parameters
    rest = {
        p.name: p.default if p.default is not None else 0.5 * (p.low + p.high) for p in others
    }
    return {dose.name: 4.0 * dose.step} | rest


@pytest.mark.parametrize("id_", EFFECTS)
def test_every_effect_is_undone_or_it_is_said_why_not(id_: str) -> None:
    inverse = inverse_of(LAW, [(id_, small(EFFECTS[id_]))])
    assert inverse.plain == (id_ in inverse.not_rendered)
    assert not (id_ in inverse.not_rendered and id_ in inverse.limits)


@pytest.mark.parametrize("id_", KNOWN)
@pytest.mark.parametrize("range_mm_s", [(0.0, 0.0), (0.0, 0.5), (0.0, 100.0)])
def test_a_model_that_is_valid_at_rest_has_an_inverse(
    id_: str, range_mm_s: tuple[float, float]
) -> None:
    law = replace(LAW, speed_range_mm_s=range_mm_s)
    for sign in (1.0, -1.0):
        dose, *_ = KNOWN[id_].parameters
        value = max(sign * 4.0 * dose.step, dose.low)
        inverse = inverse_of(law, [(id_, {dose.name: value})], Ranges((0.0, 0.6)))
        bounding = inverse.bounding
        assert 0.1 * LAW.gain_n < bounding.gain_n < 2.0 * LAW.gain_n
        assert 0.1 * LAW.cutoff_0_hz < bounding.cutoff_0_hz <= LAW.cutoff_0_hz
        assert 1.0 <= inverse.swing < 2.0


def test_the_reasons_stand_at_parts_that_a_simulator_has() -> None:
    assert set(REASONS) <= {name for name in Simulator.__slots__}


@pytest.mark.parametrize("id_", EFFECTS)
def test_an_effect_of_no_size_changes_nothing_and_needs_no_word(id_: str) -> None:
    effect = EFFECTS[id_]
    nothing = small(effect) | {effect.parameters[0].name: 0.0}
    inverse = inverse_of(LAW, [(id_, nothing)])
    assert inverse.plain
    assert inverse.remarks == ()
    assert inverse.bounding == LAW
    assert inverse.swing == 1.0


def test_an_unknown_effect_is_left_out_and_named() -> None:
    known = ("direction_asymmetry", {"share": 0.1})
    inverse = inverse_of(LAW, [("of_tomorrow", {"x": 1.0}), known])
    assert inverse.not_rendered == {"of_tomorrow": "this version does not know it"}
    assert not inverse.plain


def test_a_parameter_out_of_range_is_refused() -> None:
    with pytest.raises(EffectParameterError, match="share"):
        inverse_of(LAW, [("direction_asymmetry", {"share": 2.0})])


def test_a_map_that_folds_and_two_leaks_have_no_inverse() -> None:
    # Each alone keeps the order of drives; together they do not.
    folded = [("residual_quadratic", {"share": 0.2}), ("amplitude_compression", {"share": 0.1})]
    inverse = inverse_of(LAW, folded)
    assert set(inverse.not_rendered) == {id_ for id_, _ in folded}
    assert inverse.plain
    twice = inverse_of(LAW, [("charge_leakage", {"corner_hz": 1.0})] * 2)
    assert "charge_leakage" in twice.not_rendered
    assert twice.plain


def test_the_drive_table_is_the_inverse_of_the_map(rng: np.random.Generator) -> None:
    effects = [
        ("residual_quadratic", {"share": float(rng.uniform(-0.1, 0.1))}),
        ("amplitude_compression", {"share": float(rng.uniform(-0.1, 0.05))}),
    ]
    table = inverse_of(LAW, effects).drive_table
    drive_map = extended(Simulator(), effects).drive_map
    wanted = np.linspace(0.0, 1.0, table.size)
    np.testing.assert_allclose(table * drive_map.factor(table), wanted, atol=1e-6)


def test_the_bounding_law_asks_for_most_everywhere(rng: np.random.Generator) -> None:
    inverse = inverse_of(
        LAW,
        [
            ("speed_dependent_gain", {"exponent": float(rng.uniform(-0.5, 0.5))}),
            ("position_dependent_gain", {"per_mm": float(rng.uniform(-0.01, 0.01))}),
            ("force_dependent_cutoff", {"exponent": float(rng.uniform(-0.4, 0.4))}),
            ("speed_dependent_cutoff", {"slope_hz_per_mm_s": float(rng.uniform(-9.0, 9.0))}),
        ],
    )
    everywhere = inverse.ranges.everywhere(LAW.speed_range_mm_s)
    gain_n, cutoff_hz = inverse.along(everywhere)
    bounding = inverse.bounding
    bound_hz = bounding.cutoff_0_hz + bounding.slope_hz_per_mm_s * everywhere.speed_mm_s
    assert np.all(gain_n >= bounding.gain_n * (1.0 - 1e-12))
    assert np.all(cutoff_hz >= bound_hz * (1.0 - 1e-12))


def test_effects_hold_still_beyond_what_was_measured() -> None:
    ranges = Ranges(force_n=(0.3, 0.5), x_mm=(0.0, 70.0))
    inverse = inverse_of(
        LAW,
        [("force_dependent_gain", {"exponent": 0.3}), ("gain_drift", {"per_minute": -0.02})],
        ranges,
    )
    at_edge = ranges.confine(ranges.everywhere(LAW.speed_range_mm_s))
    beyond = replace(
        at_edge,
        normal_force_n=np.where(at_edge.normal_force_n > 0.4, 3.0, 0.0),
        minutes=np.full_like(at_edge.minutes, 1e6),
    )
    edge = replace(
        at_edge,
        normal_force_n=np.where(at_edge.normal_force_n > 0.4, 0.5, 0.3),
        minutes=np.full_like(at_edge.minutes, ranges.minutes[1]),
    )
    for far, near in zip(inverse.along(beyond), inverse.along(edge), strict=True):
        np.testing.assert_array_equal(far, near)


def test_a_law_alone_is_plain() -> None:
    assert Inverse(LAW).plain
    assert inverse_of(LAW, []).plain

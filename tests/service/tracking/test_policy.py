"""What is put in force: each bound alone holds a change back, and says so."""

from dataclasses import replace

import numpy as np
import pytest
from tests.service.tracking.played import parts, tracker
from tests.service.tracking.slides import known

from frictus.messages import LawNow
from frictus.model import Effect, FirstOrderSpeedLaw
from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.twin import Signals
from frictus_service.calibration import coordinates
from frictus_service.calibration.coordinates import Prior
from frictus_service.errors import EstimateError
from frictus_service.synthesis.compensability import placeholder_model
from frictus_service.tracking.estimation.law_estimate import (
    HIGHEST_HZ,
    RESPONSE_WITHIN,
    LawEstimate,
)
from frictus_service.tracking.evidence.signatures import (
    EFFECT_CAUSES,
    INSTRUMENT,
    NOT_FITTED,
    SHAPED,
)
from frictus_service.tracking.model_in_force import ModelInForce
from frictus_service.tracking.policy import (
    ANOTHER_FINGER,
    DELAY_WITHIN_S,
    KNOWN_WITHIN,
    WATCHED_AGAIN,
    WATCHED_WINDOWS,
    Circumstances,
    Conclusion,
    adapted,
    concluded,
    difference_db,
    goes_back,
    held_back,
    loosest_half_width,
)
from frictus_service.tracking.tracker import Tracker

PRIOR = Prior.weak()
IN_FORCE = PRIOR.mean
SPEEDS_MM_S = (20.0, 100.0)
FREE = Circumstances()


def estimate(off: FloatArray, sd: float = 0.01) -> LawEstimate:
    covariance = np.diag([sd**2, sd**2, sd**2, 1e-12])
    return LawEstimate(PRIOR, known(IN_FORCE + off, covariance), np.ones(3), 0.02, 5, 50)


TWICE = np.array([np.log(2.0), np.log(2.0), 0.0, 0.0])


def told(known: LawEstimate, now: Circumstances = FREE, wrong: tuple[str, ...] = ()) -> str:
    return held_back(known, IN_FORCE, PRIOR, SPEEDS_MM_S, wrong, now)


def test_a_finger_that_is_known_and_another_is_put_in_force() -> None:
    assert told(estimate(TWICE)) == ""


@pytest.mark.parametrize(
    ("now", "why"),
    [
        (replace(FREE, source="excitation"), "excitation"),
        (replace(FREE, compensated=False), "compensation mode"),
        (replace(FREE, guided=True), "trial"),
        (replace(FREE, since_change_s=1.5), "1.5 s ago"),
        (replace(FREE, since_felt_s=9.0), "last felt 9 s ago"),
    ],
)
def test_what_the_rig_does_holds_it_back(now: Circumstances, why: str) -> None:
    assert why in told(estimate(TWICE), now)


def test_what_was_learned_and_what_the_rig_does_make_one_conclusion(felt: Signals) -> None:
    found, as_set = tracker(), placeholder_model()
    early = concluded(found, as_set, as_set, PRIOR, FREE)
    assert early.model is None
    assert "nothing was felt yet" in early.held_back
    for part in parts(felt):
        found.take(part)
    law = values_at(found)
    first = concluded(found, as_set, as_set, PRIOR, FREE)
    assert first.held_back == ""
    assert first.model is not None
    assert isinstance(first.model.base, FirstOrderSpeedLaw)
    assert first.model.base.gain_n == pytest.approx(law.gain_n.value, rel=1e-6)
    assert "dB off, as" in first.reason

    found.put_in_force(ModelInForce.of("adapted", first.model))
    following = replace(FREE, adapted=True)
    settled = concluded(found, first.model, as_set, PRIOR, following)
    assert settled == Conclusion("the model in force fits as well")
    found.new_fingers += 1  # as where nothing that was known fits any more
    back = concluded(found, first.model, as_set, PRIOR, following)
    assert back.model is as_set
    assert back.reason == ANOTHER_FINGER
    # What was not adapted, and what was set before nobody knows, stays.
    assert concluded(found, first.model, as_set, PRIOR, FREE).model is None
    assert concluded(found, first.model, None, PRIOR, following).model is None


def values_at(found: Tracker) -> LawNow:
    law = found.state(1).law
    assert law is not None
    return law


@pytest.mark.parametrize(
    ("now", "back"),
    [
        (FREE, False),
        (replace(FREE, doubted=True), True),
        (replace(FREE, doubted=True, suspected=("delay",)), True),
        (replace(FREE, doubted=True, source="excitation"), False),
        (replace(FREE, doubted=True, compensated=False), False),
        (replace(FREE, doubted=True, guided=True), False),
        (replace(FREE, doubted=True, since_change_s=1.5), False),
    ],
)
def test_another_finger_brings_back_what_was_set(now: Circumstances, back: bool) -> None:
    assert goes_back(now) is back


def test_what_is_wrong_with_the_rig_holds_it_back() -> None:
    assert "delay" in told(estimate(TWICE), wrong=("delay",))
    suspicion = replace(FREE, suspected=("mount_resonance_shift",))
    assert "may be wrong (mount_resonance_shift)" in told(estimate(TWICE), suspicion)


def test_friction_that_comes_later_than_any_finger_makes_it_holds_it_back() -> None:
    """A mount that shifted looks like gain and cutoff, with some textures, and always late."""
    half = estimate(TWICE).half_width[3]
    for sign in (-1.0, 1.0):
        late = TWICE + np.array([0.0, 0.0, 0.0, sign * (DELAY_WITHIN_S + 1.01 * half)])
        why = told(estimate(late))
        assert "check the mount" in why
        assert f"{1e6 * abs(late[3]):.0f} us {'later' if sign > 0 else 'earlier'} than" in why
        near = TWICE + np.array([0.0, 0.0, 0.0, sign * (DELAY_WITHIN_S + 0.99 * half)])
        assert told(estimate(near)) == ""  # its interval still holds what is believed


def test_a_response_of_another_shape_is_not_fitted_by_gain_and_cutoff() -> None:
    """With some textures a mount that has shifted looks like another order of the roll-off."""
    shaped = {name for name, of in zip(EFFECT_CAUSES, SHAPED, strict=True) if of}
    assert shaped <= NOT_FITTED
    assert INSTRUMENT < NOT_FITTED
    for cause in NOT_FITTED - INSTRUMENT:
        why = told(estimate(TWICE), wrong=(cause,))
        assert cause in why
        assert "check the mount" in why


def test_what_is_not_known_well_holds_it_back() -> None:
    # The half width of a normal estimate is 1.96 standard deviations, and of a cutoff a little
    # more (`RESPONSE_WITHIN`).
    assert told(estimate(TWICE, sd=0.97 * KNOWN_WITHIN / 1.96)) == ""
    assert "5 % is asked" in told(estimate(TWICE, sd=1.01 * KNOWN_WITHIN / 1.96))
    nothing = replace(estimate(TWICE), updates=0)
    assert "nothing was felt yet" in told(nothing)
    # However many windows made the estimate, those count in which the rig was watched.
    early = replace(FREE, watched=WATCHED_WINDOWS - 1)
    assert "a rig that is wrong shows itself" in told(estimate(TWICE), early)
    # The mount does not change with the finger.
    again = replace(FREE, watched_before=WATCHED_WINDOWS, watched=WATCHED_AGAIN)
    assert told(estimate(TWICE), again) == ""
    sooner = replace(again, watched=WATCHED_AGAIN - 1)
    assert f"in {WATCHED_AGAIN}" in told(estimate(TWICE), sooner)


def test_only_the_speeds_that_were_explored_count() -> None:
    filters = known(IN_FORCE + TWICE, np.diag([1e-4, 1.0, 1e-4, 1e-12]))
    one_end = replace(estimate(TWICE), filters=filters)
    least = RESPONSE_WITHIN * np.hypot(np.exp((IN_FORCE + TWICE)[0]) / HIGHEST_HZ, 1.0)
    expected = 1.96 * np.hypot(0.01, least)
    assert loosest_half_width(one_end, (20.0, 20.0)) == pytest.approx(expected, rel=1e-3)
    assert loosest_half_width(one_end, (20.0, 100.0)) == pytest.approx(1.96, rel=1e-3)


def test_a_finger_unlike_all_others_is_not_believed() -> None:
    sd = float(np.sqrt(PRIOR.covariance[2, 2]))
    assert told(estimate(np.array([0.0, 0.0, 2.9 * sd, 0.0]))) == ""
    assert "gain is 3.1 standard" in told(estimate(np.array([0.0, 0.0, 3.1 * sd, 0.0])))


def test_a_model_that_fits_stays(rng: np.random.Generator) -> None:
    sd = 0.02
    changed = [
        told(estimate(np.append(sd * rng.standard_normal(3), 0.0), sd)) == ""
        for _ in range(2_000)
    ]
    # Chi-squared with three degrees of freedom exceeds 16 with a chance of 0.11 %.
    assert np.sum(changed) <= 10
    # Known without error, a difference that is not felt is left as it is.
    assert "fits as well" in told(estimate(np.array([0.0, 0.0, 0.005, 0.0]), sd=1e-4))


def test_a_model_with_effects_is_left_alone() -> None:
    assert "effects" in held_back(estimate(TWICE), None, PRIOR, SPEEDS_MM_S, (), FREE)


def test_a_gain_is_a_difference_in_decibels_at_any_speed() -> None:
    off = np.array([0.0, 0.0, 0.1, 0.0])
    expected = 0.1 * 20.0 / np.log(10.0)
    assert difference_db(IN_FORCE + off, IN_FORCE, SPEEDS_MM_S) == pytest.approx(expected)


def test_only_gain_and_cutoff_become_others() -> None:
    model = placeholder_model().model_copy(update={"skew_s": 1e-4})
    known = estimate(TWICE + np.array([0.0, 0.0, 0.1, 5e-5]))
    found = adapted(model, known, {"windows": 50})
    law = found.base
    assert isinstance(law, FirstOrderSpeedLaw)
    at = coordinates.from_law(law.gain_n, law.cutoff_0_hz, law.slope_hz_per_mm_s, 0.0)
    np.testing.assert_allclose(at[:3], known.mean[:3], rtol=1e-12)
    assert found.skew_s == model.skew_s
    assert found.validity == model.validity
    assert not found.placeholder
    assert found.provenance["source"] == "live"


def test_an_estimate_that_is_no_law_makes_no_model() -> None:
    steep = estimate(np.array([-3.0, 1.0, 0.0, 0.0]))  # would be negative at rest
    with pytest.raises(EstimateError, match="at rest"):
        adapted(placeholder_model(), steep, {})
    with_effect = placeholder_model().model_copy(update={"effects": [Effect(id="x")]})
    assert adapted(with_effect, estimate(TWICE), {}).effects == with_effect.effects

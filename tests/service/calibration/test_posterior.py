"""One person's law from trials: exact where it must be, honest where it cannot be."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from frictus.model import Covariance, Validity
from frictus_hardware.arrays import FloatArray
from frictus_service.calibration import coordinates, design
from frictus_service.calibration.coordinates import Prior
from frictus_service.calibration.plan import Ask
from frictus_service.calibration.posterior import Posterior, estimate
from frictus_service.calibration.precision import Variation, draw, quick_asks
from frictus_service.errors import EstimateError
from frictus_service.identification.observation.response import TrialObservations

SPEEDS = np.array([20.0, 60.0, 100.0])
SILENT = Variation(
    trial_gain=0.0,
    segment_gain=0.0,
    condition_cutoff=0.0,
    sensor_n=1e-7,
    friction_share=0.0,
)
STEADY = Variation(condition_cutoff=0.0)


def somebody(rng: np.random.Generator) -> FloatArray:
    person = Prior.weak().mean + rng.normal(0.0, [0.08, 0.08, 0.3, 0.0])
    person[:2] += rng.normal(0.0, 0.2)  # both ends together: a cutoff at rest there always is
    person[3] = rng.uniform(-50e-6, 250e-6)
    return person


def asks_of(rng: np.random.Generator, n: int, record_s: float = 2.5) -> list[Ask]:
    tones = design.lines(12)
    power = design.powers(tones, Prior.weak(), (20.0, 100.0))
    return quick_asks(rng, design.multisine(rng, tones, power), n, record_s)


def changed(
    trials: Sequence[TrialObservations], factor: NDArray[np.complex128] | complex
) -> list[TrialObservations]:
    out = []
    for trial in trials:
        rows = replace(
            trial.rows,
            friction_response=trial.rows.friction_response * factor,
            friction_variance=trial.rows.friction_variance * np.abs(factor) ** 2,
        )
        out.append(replace(trial, rows=rows))
    return out


def misses(found: Posterior, truth: FloatArray) -> FloatArray:
    return np.log(found.cutoff_hz(SPEEDS) / coordinates.cutoff_hz(truth, SPEEDS))


def test_without_noise_the_law_comes_back(rng: np.random.Generator) -> None:
    truth = somebody(rng)
    found = estimate(draw(rng, truth, asks_of(rng, 4), SILENT), None)
    # Rows beyond the law's speeds, here on the line, are taken midway to a cutoff that is held.
    np.testing.assert_allclose(found.parameters, truth, rtol=1e-3, atol=1e-8)


@pytest.mark.parametrize("beyond", ["held", "straight"])
def test_how_a_finger_goes_on_beyond_the_law_bends_nothing_between(
    beyond: str, rng: np.random.Generator
) -> None:
    """A seventh of all rows up to 7 % beyond: the line between was off by 8 %, known to 9 %."""
    truth = somebody(rng)
    trials = []
    for one in draw(rng, truth, asks_of(rng, 48), SILENT):
        speed = one.rows.speed_mm_s * rng.uniform(0.97, 1.07, one.rows.speed_mm_s.size)
        felt = np.clip(speed, 20.0, 100.0) if beyond == "held" else speed
        response = coordinates.response(truth, felt, one.rows.tone_hz)
        rows = replace(one.rows, speed_mm_s=speed, friction_response=response)
        trials.append(replace(one, rows=rows))
    found = estimate(trials, Prior.weak())
    speeds = np.array([20.0, 30.0, 60.0, 90.0, 100.0])
    expected = coordinates.cutoff_hz(truth, speeds)
    np.testing.assert_allclose(found.cutoff_hz(speeds), expected, rtol=0.005)
    assert np.all(found.relative_width(speeds) < 0.01)


def test_tones_played_together_do_not_feel_the_gain(rng: np.random.Generator) -> None:
    truth = somebody(rng)
    loose = replace(SILENT, trial_gain=0.2, segment_gain=0.1)
    found = estimate(draw(rng, truth, asks_of(rng, 6), loose), None)
    np.testing.assert_allclose(misses(found, truth), 0.0, atol=1e-4)
    assert found.spread.segment == pytest.approx(0.1, rel=0.6)


def test_single_tones_are_fitted_by_the_same_estimator(rng: np.random.Generator) -> None:
    truth = somebody(rng)
    asks = [
        Ask(speed, 0.4, design.single(tone), 7.0, 10.0)
        for speed in (20.0, 100.0)
        for tone in design.paper_tones()
    ]
    found = estimate(draw(rng, truth, asks, STEADY), None)
    assert np.all(np.abs(misses(found, truth)) < 4.0 * found.relative_width(SPEEDS))
    assert found.spread.trial == pytest.approx(0.1, rel=0.7)


def measured(rng: np.random.Generator, trial: TrialObservations) -> TrialObservations:
    """Return a trial of which the speed of a stretch is known within half a mm/s."""
    rows = trial.rows
    off_mm_s = 0.5 * rng.standard_normal((rows.sweep.max() + 1, 3))[rows.sweep, rows.third]
    return replace(trial, rows=replace(rows, speed_mm_s=rows.speed_mm_s + off_mm_s))


def test_speeds_that_are_measured_with_errors_flatten_no_law(rng: np.random.Generator) -> None:
    steady = replace(Variation(), speed=0.0, sensor_n=2e-4, friction_share=0.005)
    for _ in range(3):
        truth = Prior.weak().mean + rng.normal(0.0, 0.1) * np.array([1.0, 1.0, 0.0, 0.0])
        drawn = draw(rng, truth, asks_of(rng, 48), steady)
        found = estimate([measured(rng, trial) for trial in drawn], Prior.weak())
        assert np.all(np.abs(misses(found, truth)) < 2.0 * found.relative_width(SPEEDS))
        assert found.relative_width(SPEEDS).max() < 0.06
        assert found.mixture.wandering < 0.1  # 0.05 was drawn


def test_gain_and_delay_act_on_nothing_else(rng: np.random.Generator) -> None:
    trials = draw(rng, somebody(rng), asks_of(rng, 8), STEADY)
    found = estimate(trials, None)
    louder = estimate(changed(trials, 2.0), None)
    shift = np.array([0.0, 0.0, np.log(2.0), 0.0])
    np.testing.assert_allclose(louder.parameters - found.parameters, shift, atol=3e-4)
    late = [
        changed([trial], np.exp(-2j * np.pi * trial.rows.tone_hz * 40e-6))[0]
        for trial in trials
    ]
    later = estimate(late, None)
    assert later.parameters[3] - found.parameters[3] == pytest.approx(40e-6, abs=1e-6)
    np.testing.assert_allclose(later.parameters[:3], found.parameters[:3], atol=3e-4)


def test_the_order_of_trials_does_not_matter(rng: np.random.Generator) -> None:
    trials = draw(rng, somebody(rng), asks_of(rng, 8), Variation())
    first, second = estimate(trials, None), estimate(trials[::-1], None)
    np.testing.assert_allclose(first.parameters, second.parameters, rtol=1e-6, atol=1e-10)


def test_bad_stretches_do_not_decide(rng: np.random.Generator) -> None:
    truth = somebody(rng)
    trials = draw(rng, truth, asks_of(rng, 12), STEADY)
    clean = estimate(trials, None)
    rows = trials[3].rows
    bad = (rows.sweep == 0) & (rows.third == 0)
    wild = np.where(bad, rows.friction_response * np.exp(0.5j), rows.friction_response)
    trials[3] = replace(trials[3], rows=replace(rows, friction_response=wild))
    found = estimate(trials, None)
    assert np.all(np.abs(misses(found, truth)) < 0.02)
    assert np.all(clean.relative_width(SPEEDS) < 0.02)


def test_more_trials_tell_more(rng: np.random.Generator) -> None:
    trials = draw(rng, somebody(rng), asks_of(rng, 30), Variation())
    few, many = (estimate(trials[:n], None).relative_width(SPEEDS).max() for n in (4, 30))
    assert many < few


def test_one_speed_needs_a_prior(rng: np.random.Generator) -> None:
    asks = [replace(ask, speed_mm_s=30.0) for ask in asks_of(rng, 4)]
    trials = draw(rng, somebody(rng), asks, replace(Variation(), speed=0.0))
    with pytest.raises(EstimateError, match="two speeds"):
        estimate(trials, None)
    low, _, high = estimate(trials, Prior.weak()).relative_width(SPEEDS)
    assert high > 2.0 * low


def test_a_prior_that_the_trials_contradict_is_dropped(rng: np.random.Generator) -> None:
    truth = somebody(rng)
    trials = draw(rng, truth, asks_of(rng, 8), STEADY)
    elsewhere = truth + np.array([0.0, 0.0, 0.0, 300e-6])
    sure = Prior(elsewhere, np.diag([0.2, 0.2, 0.3, 1e-6]) ** 2, 10, "of another rig")
    found = estimate(trials, sure)
    assert "contradict" in found.note
    assert "of another rig" in found.note
    np.testing.assert_array_equal(found.parameters, estimate(trials, None).parameters)


def test_a_fitting_prior_narrows_the_interval(rng: np.random.Generator) -> None:
    truth = somebody(rng)
    trials = draw(rng, truth, asks_of(rng, 6), Variation())
    near = Prior(truth, np.diag([0.002, 0.002, 0.3, 1e-5]) ** 2, 10, "near")
    with_prior, alone = (estimate(trials, p).relative_width(SPEEDS) for p in (near, None))
    assert np.all(with_prior < alone)


def test_invalid_trials_are_left_out_and_counted(rng: np.random.Generator) -> None:
    trials = draw(rng, somebody(rng), asks_of(rng, 6), STEADY)
    spoilt = [*changed(trials[:2], 5.0 + 3.0j), *trials[2:]]
    spoilt = [replace(t, valid=number > 1) for number, t in enumerate(spoilt)]
    found = estimate(spoilt, None)
    assert (found.trials_used, found.trials_left_out) == (4, 2)
    np.testing.assert_allclose(found.parameters, estimate(trials[2:], None).parameters)


def test_what_cannot_be_estimated_is_refused(rng: np.random.Generator) -> None:
    trials = draw(rng, somebody(rng), asks_of(rng, 4), STEADY)
    with pytest.raises(EstimateError, match="none of 4 trials is valid"):
        estimate([replace(trial, valid=False) for trial in trials], None)
    other = replace(trials[0], info=replace(trials[0].info, participant="q"))
    with pytest.raises(EstimateError, match="several people: p, q"):
        estimate([other, *trials], None)
    gap = np.full_like(trials[0].rows.friction_response, np.nan)
    spoilt = [replace(trials[0], rows=replace(trials[0].rows, friction_response=gap))]
    with pytest.raises(EstimateError, match="trial t0: a response is not finite"):
        estimate([spoilt[0], *trials[1:]], None)


def test_the_model_carries_what_the_estimate_knows(rng: np.random.Generator) -> None:
    truth = somebody(rng)
    found = estimate(draw(rng, truth, asks_of(rng, 20), STEADY), Prior.weak())
    model = found.model("p", Validity(), {"seed": 1})
    covariance = model.covariance
    assert isinstance(covariance, Covariance)
    assert covariance.parameters == list(coordinates.MODEL_PARAMETERS)
    matrix = np.array(covariance.matrix)[1:3, 1:3]
    row = np.column_stack([np.ones(SPEEDS.size), SPEEDS])
    error = np.sqrt(np.einsum("vi,ij,vj->v", row, matrix, row))
    half = 1.96 * error / found.cutoff_hz(SPEEDS)
    np.testing.assert_allclose(half, found.relative_width(SPEEDS), rtol=0.25)
    assert model.skew_s == found.parameters[3]
    assert model.provenance["seed"] == 1
    assert model.provenance["trials"] == 20
    assert model.participant == "p"


def test_a_cutoff_that_would_be_negative_at_rest_is_no_model(rng: np.random.Generator) -> None:
    steep = np.array([np.log(200.0), np.log(2500.0), np.log(0.4), 0.0])
    found = estimate(draw(rng, steep, asks_of(rng, 8), STEADY), None)
    with pytest.raises(EstimateError, match="at rest"):
        found.model("p", Validity(), {})


def test_intervals_hold_the_truth(rng: np.random.Generator) -> None:
    asks = asks_of(rng, 12)
    inside = []
    for _ in range(60):
        truth = somebody(rng)
        found = estimate(draw(rng, truth, asks, Variation()), Prior.weak())
        inside.append(np.abs(misses(found, truth)[1]) < found.relative_width(SPEEDS)[1])
    assert np.mean(inside) > 0.8  # 0.95 expected; less than this once in 100 000 runs

"""Gain, cutoff and delay from responses at tones."""

from dataclasses import replace

import numpy as np
import pytest
from tests.service.identification.observed import Bench, Finger, observations

from frictus_service.identification.fit.conditions import ObservationTable, select
from frictus_service.identification.fit.estimates import Measured
from frictus_service.identification.fit.joint_fit import JointFit
from frictus_service.identification.fit.transfer_functions import (
    CUTOFF,
    GAIN,
    first_order,
    fit_friction,
)
from frictus_service.identification.observation.response import TrialObservations

EXACT = Bench(trial_gain=0.0, segment_gain=0.0, speed_wander=0.0, noise=1e-9, seconds=3.0)
SMALL = Bench(speeds=(20.0, 60.0, 100.0), forces=(0.3, 0.5), seconds=4.0)


def fitted(fingers: list[Finger], bench: Bench, rng: np.random.Generator) -> JointFit:
    return fitted_to(observations(fingers, bench, rng))


def fitted_to(observed: list[TrialObservations]) -> JointFit:
    table = ObservationTable.of(observed)
    person = Measured.of(table).person
    chosen = select(table, "friction", table.condition, person, 3)
    return fit_friction(chosen.sample, len(table.participants))


@pytest.mark.parametrize("delay_s", [-50e-6, 0.0, 100e-6, 260e-6])
def test_exact_data_give_the_exact_law(delay_s: float, rng: np.random.Generator) -> None:
    finger = Finger(gain_n=rng.uniform(0.05, 2.0), delay_s=delay_s)
    bench = replace(EXACT, speeds=(20.0, 100.0), forces=(0.4,))
    fit = fitted([finger], bench, rng)
    assert fit.settled.all()
    np.testing.assert_allclose(np.exp(fit.log_parameters[:, GAIN]), finger.gain_n, rtol=1e-6)
    cutoff = finger.cutoff_0_hz + finger.slope * np.array([20.0, 100.0])
    np.testing.assert_allclose(np.exp(fit.log_parameters[:, CUTOFF]), cutoff, rtol=1e-6)
    np.testing.assert_allclose(fit.delay_s, delay_s, atol=1e-10)


def test_derivatives_are_those_of_the_response(rng: np.random.Generator) -> None:
    tone = rng.uniform(30.0, 2000.0, 20)
    at = np.log(np.column_stack([rng.uniform(0.1, 1.0, 20), rng.uniform(200.0, 2000.0, 20)]))
    _, gradient = first_order(at, tone)
    for column in (GAIN, CUTOFF):
        step = np.zeros(2)
        step[column] = 1e-6
        above, below = first_order(at + step, tone)[0], first_order(at - step, tone)[0]
        numeric = np.log(above / below) / 2e-6
        np.testing.assert_allclose(gradient[:, column], numeric, atol=1e-8)


@pytest.mark.long
def test_errors_are_as_large_as_they_say(rng: np.random.Generator) -> None:
    # Gains that scatter from trial to trial are in the data and nowhere in their variances.
    fingers = [Finger(delay_s=100e-6) for _ in range(36)]
    bench = replace(SMALL, noise=0.02, trial_gain=0.15)
    fit = fitted(fingers, bench, rng)
    speeds = np.tile(np.repeat(bench.speeds, 2), 36)
    truth = np.log(np.column_stack([np.full(216, 0.39), 385.68 + 13.811 * speeds]))
    # Those of the covariance are at a known delay, which is not known either.
    by_delay = np.square(fit.delay_gradient) * np.repeat(fit.delay_variance, 6)[:, np.newaxis]
    variance = np.einsum("cii->ci", fit.covariance) + by_delay
    z = (fit.log_parameters - truth) / np.sqrt(variance)
    assert np.all(np.std(z, axis=0) < 1.5)
    assert np.all(np.std(z, axis=0) > 0.65)
    late = (fit.delay_s - 100e-6) / np.sqrt(fit.delay_variance)
    assert np.sqrt(np.mean(late**2)) < 2.0
    assert abs(np.sqrt(fit.spreads.size.outer) - 0.15) < 0.03


def test_scatter_of_gains_beats_constant_variance(rng: np.random.Generator) -> None:
    """The phase does not know the gain: the cutoff is far better than the sizes alone say."""
    fit = fitted([Finger()], replace(SMALL, trial_gain=0.2), rng)
    error = np.sqrt(np.einsum("cii->ci", fit.covariance))
    assert np.all(error[:, CUTOFF] < 0.3 * error[:, GAIN])


def test_tones_played_together_share_their_trial(rng: np.random.Generator) -> None:
    bench = replace(SMALL, together=True)
    fit = fitted([Finger(delay_s=50e-6)], bench, rng)
    cutoff = np.repeat(385.68 + 13.811 * np.array(bench.speeds), 2)
    np.testing.assert_allclose(np.exp(fit.log_parameters[:, CUTOFF]), cutoff, rtol=0.1)


def test_order_of_the_trials_does_not_matter(rng: np.random.Generator) -> None:
    seen = observations([Finger(), Finger(gain_n=0.2)], SMALL, rng)
    fits = []
    for order in (np.arange(len(seen)), rng.permutation(len(seen))):
        table = ObservationTable.of([seen[i] for i in order])
        person = Measured.of(table).person
        chosen = select(table, "friction", table.condition, person, 3)
        fits.append(fit_friction(chosen.sample, 2))
    np.testing.assert_allclose(fits[0].log_parameters, fits[1].log_parameters, rtol=1e-6)


def test_units_of_the_force_scale_the_gain_alone(rng: np.random.Generator) -> None:
    seed = int(rng.integers(2**32))
    small, large = (
        fitted(
            [Finger(gain_n=scale)],
            replace(SMALL, noise=0.01 * scale),
            np.random.default_rng(seed),
        )
        for scale in (0.1, 1.0)
    )
    np.testing.assert_allclose(
        large.log_parameters - small.log_parameters, [[np.log(10.0), 0.0]] * 6, atol=1e-5
    )


def test_one_whose_trials_contradict_each_other_changes_no_one_else(
    rng: np.random.Generator,
) -> None:
    """Every other trial of one was 300 µs late: cutoffs of the others were up to 37 % off."""
    right = observations([Finger(delay_s=50e-6), Finger(gain_n=0.6)], SMALL, rng)
    late, early = (
        observations([Finger(), Finger(), Finger(delay_s=delay_s)], SMALL, rng)
        for delay_s in (400e-6, 100e-6)
    )
    mixed = [pair[n % 2] for n, pair in enumerate(zip(late, early, strict=True))]
    third = [each for each in mixed if each.info.participant == "P03"]
    alone, beside = fitted_to(right), fitted_to([*right, *third])
    np.testing.assert_allclose(beside.log_parameters[:12], alone.log_parameters, rtol=1e-9)
    np.testing.assert_allclose(beside.covariance[:12], alone.covariance, rtol=1e-9)


def test_a_late_channel_is_found(rng: np.random.Generator) -> None:
    """A delay of 1 ms began beyond the grid, and the fit settled nowhere."""
    fit = fitted([Finger(delay_s=1e-3)], replace(SMALL, noise=0.002), rng)
    assert fit.settled.all()
    np.testing.assert_allclose(fit.delay_s, 1e-3, atol=20e-6)

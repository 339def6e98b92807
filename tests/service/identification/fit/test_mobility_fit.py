"""Mass, damping, stiffness and delay from mobilities at tones."""

import numpy as np
import pytest
from tests.service.identification.observed import Bench, Finger, observations

from frictus_service.identification.fit.conditions import ObservationTable, select
from frictus_service.identification.fit.estimates import Measured
from frictus_service.identification.fit.joint_fit import JointFit
from frictus_service.identification.fit.transfer_functions import (
    fit_mobility,
    mass_spring_damper,
)

EXACT = Bench(
    speeds=(40.0,),
    forces=(0.4,),
    trial_gain=0.0,
    segment_gain=0.0,
    noise=1e-9,
    seconds=3.0,
)


def fitted(fingers: list[Finger], bench: Bench, rng: np.random.Generator) -> JointFit:
    table = ObservationTable.of(observations(fingers, bench, rng))
    person = Measured.of(table).person
    chosen = select(table, "mobility", table.condition, person, 3, 750.0)
    return fit_mobility(chosen.sample, len(fingers))


@pytest.mark.parametrize("delay_s", [-60e-6, 0.0, 80e-6])
def test_exact_data_give_the_exact_skin(delay_s: float, rng: np.random.Generator) -> None:
    truth = np.exp(rng.uniform(np.log([0.001, 0.5, 200.0]), np.log([0.01, 3.0, 1500.0])))
    finger = Finger(
        mass_kg=truth[0], damping=truth[1], stiffness=truth[2], skin_delay_s=delay_s
    )
    fit = fitted([finger], EXACT, rng)
    assert fit.settled.all()
    np.testing.assert_allclose(np.exp(fit.log_parameters[0]), truth, rtol=1e-6)
    np.testing.assert_allclose(fit.delay_s, delay_s, atol=1e-10)


def test_derivatives_are_those_of_the_response(rng: np.random.Generator) -> None:
    tone = rng.uniform(30.0, 750.0, 20)
    at = np.log(np.tile([0.004, 1.3, 500.0], (20, 1)) * rng.uniform(0.5, 2.0, (20, 3)))
    _, gradient = mass_spring_damper(at, tone)
    for column in range(3):
        step = np.zeros(3)
        step[column] = 1e-6
        above, below = (mass_spring_damper(at + sign * step, tone)[0] for sign in (1, -1))
        numeric = np.log(above / below) / 2e-6
        np.testing.assert_allclose(gradient[:, column], numeric, atol=1e-8)


def test_errors_are_as_large_as_they_say(rng: np.random.Generator) -> None:
    bench = Bench(speeds=(40.0, 80.0), forces=(0.3, 0.5), seconds=4.0, noise=0.01)
    fit = fitted([Finger() for _ in range(24)], bench, rng)
    z = (fit.log_parameters - np.log([0.004, 1.3, 500.0])) / np.sqrt(
        np.einsum("cii->ci", fit.covariance)
    )
    assert np.all(np.std(z, axis=0) < 1.6)
    assert np.all(np.std(z, axis=0) > 0.6)
    assert np.all(np.abs(np.mean(z, axis=0)) < 0.8)


def test_a_noisy_friction_does_not_bias_the_mass(rng: np.random.Generator) -> None:
    """Where a denominator comes out small the ratio is large and says that it is uncertain."""
    bench = Bench(speeds=(40.0,), forces=(0.4,), seconds=8.0, trial_gain=0.0)
    seen = observations([Finger() for _ in range(20)], bench, rng)
    for item in seen:
        rows = item.rows
        friction = 1.0 + 0.25 * (
            rng.standard_normal(rows.tone_hz.size) + 1j * rng.standard_normal(rows.tone_hz.size)
        )
        rows.mobility[:] = rows.mobility / friction
        share = 0.25**2 / np.abs(friction) ** 2
        rows.mobility_variance[:] += np.abs(rows.mobility) ** 2 * share
    table = ObservationTable.of(seen)
    person = Measured.of(table).person
    chosen = select(table, "mobility", table.condition, person, 3, 750.0)
    fit = fit_mobility(chosen.sample, 20)
    mass = np.exp(fit.log_parameters[:, 0])
    assert abs(np.median(mass) / 0.004 - 1.0) < 0.06

"""What is learned from earlier people, and how sure that is."""

import numpy as np
import pytest

from frictus.model import Covariance, FirstOrderSpeedLaw, MassSpringDamper, Model
from frictus_hardware.arrays import FloatArray
from frictus_service.calibration import coordinates
from frictus_service.calibration.coordinates import FAR, FEWEST, Prior, of_people
from frictus_service.errors import PriorError

MEAN = np.array([6.5, 7.4, -0.9, 30e-6])
BETWEEN = np.diag([0.2, 0.15, 0.3, 5e-6]) ** 2
BETWEEN[0, 1] = BETWEEN[1, 0] = 0.8 * 0.2 * 0.15
OWN = np.diag([0.03, 0.02, 0.05, 2e-6]) ** 2


def model_of(value: FloatArray, own: FloatArray, name: str | None, size: int = 4) -> Model:
    gain, cutoff_0, slope, delay = coordinates.to_law(value)
    jacobian = coordinates.law_jacobian(value)
    matrix = (jacobian @ own @ jacobian.T)[:size, :size]
    return Model(
        base=FirstOrderSpeedLaw(gain_n=gain, cutoff_0_hz=cutoff_0, slope_hz_per_mm_s=slope),
        skew_s=delay,
        covariance=Covariance(
            parameters=list(coordinates.MODEL_PARAMETERS[:size]), matrix=matrix.tolist()
        ),
        participant=name,
    )


def people(rng: np.random.Generator, n: int) -> list[Model]:
    values = rng.multivariate_normal(MEAN, BETWEEN + OWN, n)
    return [model_of(value, OWN, f"P{number}") for number, value in enumerate(values)]


def test_coordinates_go_there_and_back(rng: np.random.Generator) -> None:
    value = rng.multivariate_normal(MEAN, BETWEEN)
    np.testing.assert_allclose(coordinates.from_law(*coordinates.to_law(value)), value)
    jacobian = coordinates.law_jacobian(value)
    for number, step in enumerate(np.diag([1e-5, 1e-5, 1e-5, 1e-9])):
        up = np.array(coordinates.to_law(value + step))
        down = np.array(coordinates.to_law(value - step))
        np.testing.assert_allclose(
            (up - down) / (2.0 * step[number]), jacobian[:, number], rtol=1e-6, atol=1e-6
        )


def test_many_people_tell_how_people_differ(rng: np.random.Generator) -> None:
    prior = Prior.learn(people(rng, 3000))
    sd = np.sqrt(np.diag(BETWEEN))
    np.testing.assert_allclose((prior.mean - MEAN) / sd, 0.0, atol=0.1)
    np.testing.assert_allclose(np.sqrt(np.diag(prior.covariance)), sd, rtol=0.1)
    assert prior.covariance[0, 1] / np.prod(sd[:2]) == pytest.approx(0.8, abs=0.1)
    assert prior.n == 3000


def test_a_new_person_is_where_the_prior_says(rng: np.random.Generator) -> None:
    inside = []
    for _ in range(1600):
        prior = Prior.learn(people(rng, 8))
        new = rng.multivariate_normal(MEAN, BETWEEN)
        inside.append(np.abs(new - prior.mean) < 1.96 * np.sqrt(np.diag(prior.covariance)))
    assert np.mean(inside, axis=0) == pytest.approx(0.96, abs=0.05)


def test_people_who_seem_alike_are_not_taken_for_equal() -> None:
    models = [model_of(MEAN, OWN, f"P{number}") for number in range(6)]
    prior = Prior.learn(models)
    assert np.all(np.diag(prior.covariance) > 0.5 * np.diag(OWN))


def test_the_order_of_models_does_not_matter(rng: np.random.Generator) -> None:
    models = people(rng, 7)
    first, second = Prior.learn(models), Prior.learn(models[::-1])
    np.testing.assert_allclose(first.mean, second.mean)
    np.testing.assert_allclose(first.covariance, second.covariance, atol=1e-18)


def test_few_people_give_the_weak_prior_and_say_so(rng: np.random.Generator) -> None:
    prior = Prior.learn(people(rng, FEWEST - 1))
    assert prior.n == 0
    assert "fewer than" in prior.note
    np.testing.assert_array_equal(prior.covariance, Prior.weak().covariance)


def test_the_weak_prior_is_the_papers_law() -> None:
    gain, cutoff_0, slope, delay = coordinates.to_law(Prior.weak().mean)
    assert (gain, cutoff_0, slope, delay) == pytest.approx((0.39, 385.68, 13.811, 0.0))


def test_without_variance_of_the_delay_it_stays_unknown(rng: np.random.Generator) -> None:
    models = people(rng, 6)
    models[2] = model_of(MEAN, OWN, "short", size=3)
    prior = Prior.learn(models)
    assert prior.covariance[3, 3] == Prior.weak().covariance[3, 3]
    assert "delay" in prior.note


def test_far_away_people_are_two_deviations_off_along_the_main_axis(
    rng: np.random.Generator,
) -> None:
    prior = Prior.learn(people(rng, 10))
    values, vectors = np.linalg.eigh(prior.covariance[:2, :2])
    along, across = vectors[:, 1], vectors[:, 0]
    far = prior.far_away[:2, :2]
    assert along @ far @ along == pytest.approx(FAR**2 * values[1])
    assert across @ far @ across == pytest.approx(values[0])


def test_information_is_the_inverse(rng: np.random.Generator) -> None:
    prior = Prior.learn(people(rng, 12))
    scale = np.sqrt(np.diag(prior.covariance))
    product = prior.information @ prior.covariance * np.outer(scale, 1.0 / scale)
    np.testing.assert_allclose(product, np.eye(4), atol=1e-6)


def test_what_cannot_be_learned_from_is_refused(rng: np.random.Generator) -> None:
    good = people(rng, 6)
    no_covariance = good[0].model_copy(update={"covariance": None, "participant": "A"})
    with pytest.raises(PriorError, match="A: no covariance"):
        Prior.learn([*good, no_covariance])
    guess = good[0].model_copy(update={"placeholder": True, "participant": "B"})
    with pytest.raises(PriorError, match="B: only measured"):
        Prior.learn([*good, guess])
    skin = Model(
        response="mobility",
        base=MassSpringDamper(mass_kg=0.0015, damping_n_s_m=1.3, stiffness_n_m=444.0),
        participant="C",
    )
    with pytest.raises(PriorError, match="C: only measured friction"):
        Prior.learn([*good, skin])
    with pytest.raises(PriorError, match="more than one model of P0"):
        Prior.learn([*good, good[0]])


def test_a_real_rig_learns_from_people_alone(rng: np.random.Generator) -> None:
    models = people(rng, 12)
    for number, simulated in ((2, True), (5, True), (7, False)):
        told = models[number].provenance | {"simulated": simulated}
        models[number] = models[number].model_copy(update={"provenance": told})
    assert of_people(models, simulated_rig=True) == tuple(models)
    kept = of_people(models, simulated_rig=False)
    assert [model.participant for model in kept] == [
        f"P{number}" for number in range(12) if number not in (2, 5)
    ]

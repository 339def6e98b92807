"""What people differ in, and by how much."""

import numpy as np
import pytest

from frictus_hardware.arrays import FloatArray
from frictus_service.discovery.inference.significance import estimate_random_effects

N = 300


def made(
    rng: np.random.Generator, n_units: int, mean: FloatArray, difference: FloatArray
) -> tuple[list[FloatArray], list[FloatArray], FloatArray]:
    """Return readings and signatures of unit noise, and the coefficients behind them."""
    signatures = [rng.standard_normal((N, mean.size)) for _ in range(n_units)]
    coefficients = mean + rng.normal(0.0, difference, (n_units, mean.size))
    readings = [
        columns @ own + rng.standard_normal(N)
        for columns, own in zip(signatures, coefficients, strict=True)
    ]
    return readings, signatures, coefficients


def test_differences_are_found_beside_what_all_share(rng: np.random.Generator) -> None:
    difference = np.array([0.5, 5.0, 0.5])
    readings, signatures, _ = made(rng, 200, np.array([0.0, 20.0, -3.0]), difference)
    found = estimate_random_effects(readings, signatures)
    np.testing.assert_allclose(found.difference, difference, rtol=0.25)
    np.testing.assert_allclose(found.coefficients.mean(axis=0), [0.0, 20.0, -3.0], atol=1.3)


def test_where_there_is_no_difference_all_are_alike(rng: np.random.Generator) -> None:
    readings, signatures, _ = made(rng, 20, np.array([2.0]), np.zeros(1))
    found = estimate_random_effects(readings, signatures)
    assert found.difference[0] < 1.0 / np.sqrt(N)  # less than the noise of one unit
    assert np.ptp(found.coefficients) < 4.0 / np.sqrt(N)


def test_a_unit_is_nearer_to_the_others_than_its_own_readings_say(
    rng: np.random.Generator,
) -> None:
    readings, signatures, truth = made(rng, 50, np.array([1.0]), np.array([0.05]))
    found = estimate_random_effects(readings, signatures).coefficients[:, 0]
    alone = np.array(
        [
            np.linalg.lstsq(s, r, rcond=None)[0][0]
            for r, s in zip(readings, signatures, strict=True)
        ]
    )
    assert np.std(found) < np.std(alone)
    assert np.std(found - truth[:, 0]) < np.std(alone - truth[:, 0])


def test_effects_that_look_alike_share_what_there_is(rng: np.random.Generator) -> None:
    """A design that cannot tell two effects apart must not make both of them huge."""
    readings, signatures, _ = made(rng, 20, np.array([1.0]), np.array([0.2]))
    twice = [
        np.column_stack([each, each + 1e-4 * rng.standard_normal(each.shape)])
        for each in signatures
    ]
    found = estimate_random_effects(readings, twice)
    assert np.all(np.abs(found.coefficients) < 2.0)
    assert found.coefficients.sum(axis=1).mean() == pytest.approx(1.0, abs=0.3)


def test_a_signature_that_no_unit_has(rng: np.random.Generator) -> None:
    readings, signatures, _ = made(rng, 10, np.array([1.0, 0.0]), np.array([0.3, 0.0]))
    for each in signatures:
        each[:, 1] = 0.0
    found = estimate_random_effects(readings, signatures)
    assert found.difference[1] == 0.0
    assert np.all(found.coefficients[:, 1] == 0.0)

"""Projections, and the inverses of inner products."""

import numpy as np
import pytest

from frictus_service.discovery.projection import inverse_of, orthogonal_to, orthonormal


def test_what_a_projection_leaves_is_orthogonal(rng: np.random.Generator) -> None:
    columns, given = rng.normal(size=(40, 5)), rng.normal(size=(40, 2))
    left = orthogonal_to(orthonormal(columns), given)
    np.testing.assert_allclose(columns.T @ left, 0.0, atol=1e-12)
    spanned = orthogonal_to(orthonormal(columns), columns @ rng.normal(size=5))
    np.testing.assert_allclose(spanned, 0.0, atol=1e-12)


def test_a_basis_is_found_where_the_usual_driver_does_not_converge(
    rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    columns = rng.normal(size=(40, 5))
    columns[:, 4] = columns[:, 0] - columns[:, 1]
    usual = orthonormal(columns)
    assert usual.shape == (40, 4)

    def never(*_given: object, **_named: object) -> None:
        raise np.linalg.LinAlgError("SVD did not converge")

    monkeypatch.setattr(np.linalg, "svd", never)
    other = orthonormal(columns)
    np.testing.assert_allclose(other @ other.T, usual @ usual.T, atol=1e-12)


def test_units_of_coefficients_are_those_of_the_inverse(rng: np.random.Generator) -> None:
    columns = np.column_stack([rng.standard_normal((20, 2)), np.zeros(20)])
    one = inverse_of(columns.T @ columns, 1e-9)
    scale = np.array([1e-8, 1e7, 1.0])
    other = inverse_of(scale[:, np.newaxis] * (columns.T @ columns) * scale, 1e-9)
    np.testing.assert_allclose(scale[:, np.newaxis] * other * scale, one)
    told = columns[:, :2]
    np.testing.assert_allclose(one[:2, :2] @ told.T @ told, np.eye(2), atol=1e-9)
    assert not one[2].any()

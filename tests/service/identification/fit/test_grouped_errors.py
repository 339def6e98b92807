"""Sums over rows whose errors hang together, against the covariance written out."""

import numpy as np
import pytest

from frictus_service.identification.fit.grouped_errors import (
    GroupVariances,
    Levels,
    log_determinant,
    moments,
    scatter_of,
)


@pytest.mark.parametrize("alone", [True, False])
def test_moments_are_those_of_the_full_covariance(
    alone: bool, rng: np.random.Generator
) -> None:
    n, n_inner, n_outer = 40, 12, 4
    inner = (
        np.arange(n)
        if alone
        else np.concatenate([np.arange(n_inner), rng.integers(0, n_inner, n - n_inner)])
    )
    count = n if alone else n_inner
    parent = np.concatenate([np.arange(n_outer), rng.integers(0, n_outer, count - n_outer)])
    table, noise = rng.standard_normal((n, 3)), rng.uniform(0.1, 2.0, n)
    scatter = GroupVariances(0.3, 0.7)
    same_inner = inner[:, np.newaxis] == inner
    same_outer = parent[inner][:, np.newaxis] == parent[inner]
    full = np.diag(noise) + scatter.inner * same_inner + scatter.outer * same_outer
    levels = Levels(None if alone else inner, parent, n_outer)
    found = moments(table, 1.0 / noise, levels, scatter)
    np.testing.assert_allclose(found.sum(axis=0), table.T @ np.linalg.inv(full) @ table)
    determinants = log_determinant(1.0 / noise, levels, scatter)
    np.testing.assert_allclose(determinants.sum(), np.linalg.slogdet(full).logabsdet)
    rows = parent[inner] == 1
    own = np.linalg.inv(full[np.ix_(rows, rows)])
    np.testing.assert_allclose(found[1], table[rows].T @ own @ table[rows])


def test_scatter_is_found_again(rng: np.random.Generator) -> None:
    outer, each, rows = 2000, 6, 3
    parent = np.repeat(np.arange(outer), each)
    inner = np.repeat(np.arange(outer * each), rows)
    noise = rng.uniform(0.5, 2.0, inner.size) * 1e-3
    residual = (
        rng.normal(0.0, 0.1, outer)[parent][inner]
        + rng.normal(0.0, 0.05, parent.size)[inner]
        + rng.normal(0.0, np.sqrt(noise))
    )
    found = scatter_of(residual, 1.0 / noise, Levels(inner, parent, outer), 0.0)
    np.testing.assert_allclose(np.sqrt([found.inner, found.outer]), [0.05, 0.1], rtol=0.1)


def test_noise_alone_is_no_scatter(rng: np.random.Generator) -> None:
    parent = np.repeat(np.arange(500), 5)
    residual = rng.normal(0.0, 0.1, parent.size)
    levels = Levels(None, parent, 500)
    found = scatter_of(residual, np.full(parent.size, 100.0), levels, 0.0)
    assert found.inner < 1.6e-3  # five standard deviations of 2000 degrees of freedom
    assert found.outer < 1e-3


def test_rows_that_are_all_noise_do_not_hide_how_the_others_scatter(
    rng: np.random.Generator,
) -> None:
    """Unweighted, three rows of a thousand made the scatter nothing every other time."""
    parent = np.repeat(np.arange(300), 4)
    noise = np.full(parent.size, 1e-8)
    noise[[5, 600, 900]] = 0.01
    residual = rng.normal(0.0, 0.003, parent.size) + rng.normal(0.0, np.sqrt(noise))
    found = scatter_of(residual, 1.0 / noise, Levels(None, parent, 300), 0.0)
    assert abs(np.sqrt(found.inner) - 0.003) < 3e-4

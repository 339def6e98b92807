"""Scatters and deviations of conditions come back, and readings have unit variance after."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from tests.service.discovery.made import (
    MOUNT,
    PAPER,
    Design,
    Scatter,
    found_in,
    made,
    suspected,
)

from frictus_hardware.arrays import FloatArray
from frictus_service.discovery.evidence.evidence_rows import subjects_of
from frictus_service.discovery.evidence.observation_table import rows_of, units_of, used
from frictus_service.discovery.evidence.residuals import Layout
from frictus_service.discovery.inference.covariance import DEVIATIONS, Whitening, whiten
from frictus_service.discovery.inference.linearisation import linearise
from frictus_service.discovery.problem.candidates import candidates_of
from frictus_service.discovery.problem.problem import DiscoveryProblem, UnwhitenedUnit
from frictus_service.discovery.projection import orthonormal

N_UNITS, N_CONDITIONS, N_EACH = 10, 12, 40
N = N_CONDITIONS * N_EACH


@dataclass(frozen=True)
class Study:
    """Units whose readings scatter by known amounts."""

    layouts: list[Layout]
    raws: list[UnwhitenedUnit]
    scatter: FloatArray


def study(rng: np.random.Generator, scatters: FloatArray, deviations: FloatArray) -> Study:
    """Return readings of kinds that scatter, and conditions that deviate in two ways."""
    kind = np.resize(np.arange(scatters.size), N)
    condition = np.repeat(np.arange(N_CONDITIONS), N_EACH)
    none = np.zeros(0, dtype=np.int64)
    layout = Layout(none, none, none, none, np.ones(N, dtype=np.bool_), 1000 * kind, 0)
    raws = []
    for _ in range(N_UNITS):
        own = np.column_stack([np.ones(N), rng.standard_normal(N)])
        deviating = np.column_stack(
            [
                np.where(condition == c, own[:, k], 0.0)
                for c in range(N_CONDITIONS)
                for k in range(2)
            ]
        )
        size = rng.normal(0.0, np.tile(deviations, N_CONDITIONS))
        readings = own @ rng.normal(0.0, 1.0, 2) + deviating @ size
        readings += rng.normal(0.0, scatters[kind])
        blank: FloatArray = np.zeros((N, 0))
        common = np.zeros(0, dtype=np.bool_)
        every = np.arange(N_CONDITIONS)
        raws.append(
            UnwhitenedUnit(
                readings, own, blank, deviating, every, 2, blank, common, np.zeros(N)
            )
        )
    return Study(N_UNITS * [layout], raws, scatters[kind])


def left_of(raw: UnwhitenedUnit, whitening: Whitening) -> FloatArray:
    """Return whitened readings with whitened own signatures taken out."""
    own = orthonormal(whitening(raw.own))
    readings = whitening(raw.readings)
    left: FloatArray = readings - own @ (own.T @ readings)
    return left


def test_what_was_put_in_comes_out(rng: np.random.Generator) -> None:
    scatters = rng.uniform(0.005, 0.05, 4)
    deviations = rng.choice(DEVIATIONS[2:8], 2)
    given = study(rng, scatters, deviations)
    found = whiten(given.layouts, given.raws)
    typical = np.median([one.weight for one in found], axis=0)
    np.testing.assert_allclose(1.0 / typical, given.scatter, rtol=0.15)
    for raw, one in zip(given.raws, found, strict=True):
        # Covariance of noise and deviations, whitened, is the identity.
        cover = np.diag(1.0 / one.weight**2)
        cover += (raw.deviating * np.tile(deviations**2, N_CONDITIONS)) @ raw.deviating.T
        white = one(one(cover).T)
        assert np.median(np.abs(np.diagonal(white) - 1.0)) < 0.05
        assert np.linalg.norm(white - np.eye(N), 2) < 2.5  # deviations lie on a coarse grid


def test_readings_have_unit_variance_after(rng: np.random.Generator) -> None:
    given = study(rng, rng.uniform(0.005, 0.05, 4), np.array([0.1, 0.05]))
    found = whiten(given.layouts, given.raws)
    left = [left_of(raw, one) for raw, one in zip(given.raws, found, strict=True)]
    assert np.std(np.concatenate(left)) == pytest.approx(1.0, abs=0.08)
    # Also summed over a condition, where deviations would add up.
    sums = np.array([each.reshape(N_CONDITIONS, N_EACH).sum(axis=1) for each in left])
    assert np.std(sums) / np.sqrt(N_EACH) < 1.5


def test_no_deviation_is_no_deviation(rng: np.random.Generator) -> None:
    given = study(rng, np.array([0.02]), np.zeros(2))
    for one in whiten(given.layouts, given.raws):
        assert np.all(one.shrink < 2.0)
        np.testing.assert_allclose(one(np.eye(N)), one(np.eye(N)).T, atol=1e-6 * one.weight[0])


def test_what_a_condition_has_in_all_people_is_no_deviation(rng: np.random.Generator) -> None:
    """It is a misfit. Of blocks of one person's trials nobody knows which of both it is."""
    given = study(rng, np.array([0.02]), np.array([0.0, 0.035]))
    step = np.append(np.zeros(2 * N_CONDITIONS - 2), [0.3, 0.0])
    people = [replace(raw, readings=raw.readings + raw.deviating @ step) for raw in given.raws]
    found = whiten(given.layouts, people)[0]
    assert found.deviation[0] == 0.0
    assert 0.02 <= found.deviation[1] <= 0.05
    alone = np.full(N_CONDITIONS, -1)
    blocks = [replace(raw, condition=alone) for raw in people]
    assert whiten(given.layouts, blocks)[0].deviation[0] > 0.05


def test_outliers_change_little(rng: np.random.Generator) -> None:
    given = study(rng, np.array([0.02]), np.zeros(2))
    outlying = rng.random(N) < 0.02
    given.raws[0].readings[outlying] += 3.0
    found = whiten(given.layouts, given.raws)[0]
    assert np.all(found.weight[outlying] < 0.3 / 0.02)
    assert np.median(found.weight[~outlying]) == pytest.approx(1.0 / 0.02, rel=0.15)


def test_no_reading_is_better_than_measuring_is(rng: np.random.Generator) -> None:
    given = study(rng, np.array([1e-5]), np.zeros(2))
    for raw in given.raws:
        raw.accuracy[:] = 0.004
    for one in whiten(given.layouts, given.raws):
        assert np.all(one.weight <= 2.0 / 0.004)


def test_a_whole_study_has_unit_variance(rng: np.random.Generator) -> None:
    trials = used(made(rng, design=Design(repeats=3)))
    units = units_of(trials, "friction")
    subjects = tuple(subjects_of(rows_of(trials, units, "friction"), len(units.names)))
    problem = DiscoveryProblem(
        PAPER, MOUNT, "friction", subjects, tuple(candidates_of("friction")), ()
    )
    readings = []
    for unit in linearise(problem, ()).units:
        own = orthonormal(unit.own)
        readings.append(unit.readings - own @ (own.T @ unit.readings))
    spread = np.median(np.abs(np.concatenate(readings))) / 0.6745
    assert 0.5 < spread < 1.1  # scatters include how accurate the measurement is


@pytest.mark.long
def test_what_measuring_does_not_resolve_is_not_named(rng: np.random.Generator) -> None:
    """However quiet the study: 0.4 % of the size, 0.03 % of a harmonic."""
    quiet = Scatter(0.2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-9, 1e-3)
    for name, size in (
        ("direction_asymmetry", {"share": 0.003}),
        ("residual_quadratic", {"share": 2e-4}),
    ):
        assert name not in suspected(found_in(made(rng, [(name, size)], scatter=quiet)))

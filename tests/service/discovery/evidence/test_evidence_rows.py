"""A finger beyond the range of a law, and a finger that does as it was asked."""

from dataclasses import replace

import numpy as np
import pytest
from tests.service.discovery.made import made

from frictus_hardware.arrays import FloatArray
from frictus_service.discovery.evidence.evidence_rows import (
    WANDER,
    Subject,
    as_asked,
    subjects_of,
    within,
)
from frictus_service.discovery.evidence.observation_table import rows_of, units_of, used


def subject(rng: np.random.Generator) -> Subject:
    trials = used(made(rng))
    units = units_of(trials, "friction")
    return subjects_of(rows_of(trials, units, "friction"), len(units.names))[0]


def speeds(of: Subject) -> FloatArray:
    return of.rows.circumstances.speed_mm_s


def at(of: Subject, speed_mm_s: float) -> Subject:
    everywhere = np.full(speeds(of).size, speed_mm_s)
    circumstances = replace(of.rows.circumstances, speed_mm_s=everywhere)
    return replace(of, rows=replace(of.rows, circumstances=circumstances))


@pytest.mark.parametrize("mean", [15.0, 19.5, 20.0, 60.0, 98.0, 101.0, 150.0])
def test_a_wandering_speed_counts_as_its_clipped_mean(
    mean: float, rng: np.random.Generator
) -> None:
    seen = speeds(within(at(subject(rng), mean), (20.0, 100.0)))
    drawn = np.clip(rng.normal(mean, WANDER * mean, 200_000), 20.0, 100.0).mean()
    np.testing.assert_allclose(seen, drawn, atol=0.05)


def test_in_the_middle_of_the_range_nothing_changes(rng: np.random.Generator) -> None:
    one = at(subject(rng), 60.0)
    np.testing.assert_array_equal(speeds(within(one, (20.0, 100.0))), speeds(one))


def test_as_asked_is_the_target_of_each_trial(rng: np.random.Generator) -> None:
    one = subject(rng)
    asked = as_asked(one)
    np.testing.assert_array_equal(speeds(asked), one.target_mm_s[one.trial])
    forces = asked.trials.circumstances.normal_force_n
    np.testing.assert_array_equal(forces, one.target_n)
    assert asked.measured is one.measured

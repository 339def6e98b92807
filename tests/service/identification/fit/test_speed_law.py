"""Speed laws of participants, and whether their intervals hold the truth."""

from dataclasses import replace

import numpy as np
import pytest
from tests.service.identification.observed import Bench, Finger, observations, trial

from frictus_hardware.arrays import FloatArray
from frictus_service.identification.documents import Settings
from frictus_service.identification.fit.conditions import ObservationTable
from frictus_service.identification.fit.estimates import Measured, friction_of, law_of
from frictus_service.identification.fit.speed_law import ConditionEvidence, SpeedLaw, estimate
from frictus_service.identification.observation.response import TrialObservations

SMALL = Bench(
    tones_hz=(30.0, 90.0, 220.0, 450.0, 750.0, 2000.0),
    speeds=(20.0, 60.0, 100.0),
    forces=(0.3, 0.5),
    seconds=3.0,
    noise=0.004,
)


def laws(seen: list[TrialObservations]) -> list[SpeedLaw | None]:
    table = ObservationTable.of(seen)
    measured = Measured.of(table)
    friction = friction_of(table, measured, Settings())
    assert friction is not None
    return [law_of(friction, measured, person) for person in range(len(table.participants))]


def misses(found: list[SpeedLaw | None], truth: FloatArray) -> FloatArray:
    """Return which intervals do not hold the truth, shape (n, 4)."""
    out = []
    for law, true in zip(found, truth, strict=True):
        assert law is not None
        out.append(np.abs(law.estimates.value - true) > law.estimates.half_width)
    return np.array(out)


@pytest.mark.long
def test_intervals_hold_the_truth(rng: np.random.Generator) -> None:
    finger = Finger(delay_s=100e-6)
    seen = observations([finger] * 100, SMALL, rng)
    truth = np.tile([0.39, 385.68, 13.811, 100e-6], (100, 1))
    missed = misses(laws(seen), truth).mean(axis=0)
    # The gain's own scatter between conditions is drawn from few trials; binomial bound.
    assert np.all(missed < 0.15), missed


@pytest.mark.parametrize(
    "forces", [(0.4,), pytest.param((0.2, 0.4, 0.6), marks=pytest.mark.long)]
)
def test_intervals_of_one_trial_a_condition_hold_the_truth(
    rng: np.random.Generator, forces: tuple[float, ...]
) -> None:
    """The fit goes through such a trial of all tones, whose pulls then say nothing."""
    bench = replace(SMALL, forces=forces, together=True)
    seen = observations([Finger(delay_s=100e-6)] * 100, bench, rng)
    truth = np.tile([0.39, 385.68, 13.811, 100e-6], (100, 1))
    missed = misses(laws(seen), truth).mean(axis=0)
    assert np.all(missed < 0.15), missed


@pytest.mark.long
def test_conditions_that_differ_are_in_the_interval(rng: np.random.Generator) -> None:
    """What makes a condition differ is shared by its trials: they alone would be too sure."""
    seen: list[TrialObservations] = []
    for person in range(80):
        for item in observations([Finger()], SMALL, rng):
            seen.append(replace(item, info=replace(item.info, participant=f"{person:03}")))
    shifted = []
    for _, one in _by_condition(seen):
        scale = np.exp(rng.normal(-0.005, 0.1))
        finger = Finger(cutoff_0_hz=385.68 * scale, slope=13.811 * scale)
        shifted += [trial(finger, item.info, SMALL, rng) for item in one]
    found = laws(shifted)
    missed = misses(found, np.tile([0.39, 385.68, 13.811, 0.0], (80, 1))).mean(axis=0)
    assert np.all(missed[1:3] < 0.16), missed
    excess = [law.excess_hz for law in found if law is not None]
    assert np.median(excess) == pytest.approx(0.1 * 1200.0, rel=0.6)


@pytest.mark.long
def test_a_gain_that_leans_with_speed_is_known_as_well_as_its_trials_say(
    rng: np.random.Generator,
) -> None:
    """As if conditions alone told it, or as if it scattered, it is half as certain."""
    seen = []
    for item in observations([Finger()] * 100, SMALL, rng):
        lean = Finger(gain_n=0.39 * (1.0 + 0.001 * (item.info.speed_mm_s - 60.0)))
        seen.append(trial(lean, item.info, SMALL, rng))
    found = [law.estimates for law in laws(seen) if law is not None]
    error = np.array([estimates.value[0] for estimates in found]) - 0.39
    half = np.median([estimates.half_width[0] for estimates in found])
    assert abs(error.mean()) < 4.0 * error.std() / np.sqrt(error.size)
    assert half / error.std() == pytest.approx(2.3, abs=0.6)


def _by_condition(
    seen: list[TrialObservations],
) -> list[tuple[tuple[str, float, float], list[TrialObservations]]]:
    groups: dict[tuple[str, float, float], list[TrialObservations]] = {}
    for item in seen:
        key = (item.info.participant, item.info.speed_mm_s, item.info.force_n)
        groups.setdefault(key, []).append(item)
    return list(groups.items())


def test_measured_speed_counts_not_the_target(rng: np.random.Generator) -> None:
    seen = observations([Finger()], replace(SMALL, trial_gain=0.0, segment_gain=0.0), rng)
    for item in seen:
        # As it was: 10 % faster than asked in all trials, and the rows say so.
        object.__setattr__(
            item, "info", replace(item.info, speed_mm_s=item.info.speed_mm_s / 1.1)
        )
    (law,) = laws(seen)
    assert law is not None
    assert law.slope_hz_per_mm_s == pytest.approx(13.811, rel=0.05)  # the target's: 10 % off


def test_a_low_estimate_weighs_no_more(rng: np.random.Generator) -> None:
    """Weights that follow each estimate would pull the law down by several per cent."""
    speed = np.tile([20.0, 60.0, 100.0], 40)
    truth = 385.68 + 13.811 * speed
    found = []
    for _ in range(100):
        value = truth * np.exp(rng.normal(-0.02, 0.2, speed.size))
        none = np.zeros((0, 2))
        evidence = ConditionEvidence(
            speed,
            np.column_stack([np.ones(speed.size), value]),
            np.full((speed.size, 2), 0.04),
            none,
            np.zeros(0, dtype=np.int64),
            0.0,
            np.zeros(0),
            np.zeros((speed.size, 2)),
            np.zeros((speed.size, 2)),
            0.0,
        )
        found.append(estimate(evidence).estimates.value[1:3])
    np.testing.assert_allclose(np.mean(found, axis=0), [385.68, 13.811], rtol=0.04)


def test_one_speed_gives_no_law(rng: np.random.Generator) -> None:
    assert laws(observations([Finger()], replace(SMALL, speeds=(60.0,)), rng)) == [None]


def test_two_conditions_are_enough(rng: np.random.Generator) -> None:
    bench = replace(SMALL, speeds=(30.0, 90.0), forces=(0.4,), together=True, seconds=8.0)
    (law,) = laws(observations([Finger(delay_s=50e-6)], bench, rng))
    assert law is not None
    assert law.slope_hz_per_mm_s == pytest.approx(13.811, rel=0.2)
    assert np.all(np.isfinite(law.estimates.half_width))

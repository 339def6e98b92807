"""Drawn observations are what they are said to be, and the protocols what they cost."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from frictus.model import Validity
from frictus_hardware.arrays import FloatArray
from frictus_service.calibration import coordinates, design
from frictus_service.calibration.coordinates import Prior
from frictus_service.calibration.posterior import estimate
from frictus_service.calibration.precision import (
    FORCES_N,
    Variation,
    draw,
    paper_asks,
    quick_asks,
)

TRUTH = Prior.weak().mean
SPEEDS = np.array([20.0, 40.0, 60.0, 80.0, 100.0])
STILL = Variation(trial_gain=0.0, segment_gain=0.0, condition_cutoff=0.0, speed=0.0)


def law(tone_hz: FloatArray, speed_mm_s: FloatArray) -> NDArray[np.complex128]:
    cutoff = 385.68 + 13.811 * speed_mm_s
    return np.asarray(0.39 / (1.0 + 1j * tone_hz / cutoff), dtype=np.complex128)


def test_the_papers_protocol_takes_3750_s() -> None:
    asks = paper_asks()
    assert len(asks) == 375
    assert sum(ask.record_s for ask in asks) == 3750.0
    assert len({(ask.speed_mm_s, ask.force_n, ask.tones_hz) for ask in asks}) == 375


def test_quick_trials_seek_new_conditions_at_both_ends(rng: np.random.Generator) -> None:
    asks = quick_asks(rng, design.multisine(rng, design.lines(8)), 30)
    assert len({(ask.speed_mm_s, ask.force_n) for ask in asks}) == 30
    slow = [ask.speed_mm_s < 60.0 for ask in asks]
    assert slow == [True, False] * 15
    assert {ask.force_n for ask in asks} == set(FORCES_N)


def test_noise_is_as_large_as_its_variance_says(rng: np.random.Generator) -> None:
    asks = quick_asks(rng, design.multisine(rng, design.lines(12)), 30)
    rows = [trial.rows for trial in draw(rng, TRUTH, asks, STILL)]
    scaled = np.concatenate(
        [
            (row.friction_response - law(row.tone_hz, row.speed_mm_s))
            / np.sqrt(row.friction_variance)
            for row in rows
        ]
    )
    assert np.std(scaled.real) == pytest.approx(1.0, abs=0.15)
    assert np.std(scaled.imag) == pytest.approx(1.0, abs=0.15)


def test_noise_falls_with_length_and_drive(rng: np.random.Generator) -> None:
    loud, soft = design.single(210.0), design.single(210.0)
    soft = soft.model_copy(
        update={"tones": [soft.tones[0].model_copy(update={"amplitude": 0.25})]}
    )
    (ask,) = quick_asks(rng, loud, 1)
    base, quieter, longer = (
        draw(rng, TRUTH, [one], STILL)[0].rows.friction_variance[0]
        for one in (ask, replace(ask, excitation=soft), replace(ask, record_s=1.25))
    )
    assert quieter / base == pytest.approx(4.0)
    assert longer / base == pytest.approx(2.0, rel=0.3)


def test_a_condition_is_off_the_law_by_the_same_each_time(rng: np.random.Generator) -> None:
    wave = design.multisine(rng, design.lines(8))
    asks = quick_asks(rng, wave, 1) * 3
    quiet = replace(STILL, condition_cutoff=0.2, sensor_n=1e-9, friction_share=0.0)
    first, *others = (trial.rows.friction_response for trial in draw(rng, TRUTH, asks, quiet))
    for other in others:
        np.testing.assert_allclose(other, first, rtol=1e-4)


def test_tones_together_beat_tones_apart_for_the_time_they_take(
    rng: np.random.Generator,
) -> None:
    """At a fiftieth of the time, where the gain varies and nothing else does."""
    tones = design.lines(12)
    wave = design.multisine(rng, tones, design.powers(tones, Prior.weak(), (20.0, 100.0)))
    variation = replace(Variation(), condition_cutoff=0.0)
    quick = estimate(draw(rng, TRUTH, quick_asks(rng, wave, 30), variation), Prior.weak())
    fiftieth = [ask for ask in paper_asks(record_s=10.0)][:: 375 // 7]
    with_gain = draw(rng, TRUTH, fiftieth, variation)
    alone = estimate(with_gain, Prior.weak())
    assert quick.relative_width(SPEEDS).max() < alone.relative_width(SPEEDS).max()


@pytest.mark.campaign
@pytest.mark.timeout(1800)
@pytest.mark.parametrize("n_trials", [4, 12, 30])
@pytest.mark.parametrize("wandering", [0.02, 0.05])
def test_intervals_hold_two_deviations_off_the_population(
    rng: np.random.Generator, n_trials: int, wandering: float
) -> None:
    tones = design.lines(12)
    variation = replace(Variation(), condition_cutoff=wandering)
    spread = np.diag([0.15, 0.15, 0.35, 2e-6]) ** 2
    spread[0, 1] = spread[1, 0] = 0.9 * 0.15**2
    weak = Prior.weak()
    wave = design.multisine(rng, tones, design.powers(tones, weak, (20.0, 100.0)))
    inside = []
    for number in range(600):
        if number % 20 == 0:
            earlier = [
                estimate(draw(rng, person, quick_asks(rng, wave, 30), variation), weak).model(
                    f"E{at}", Validity(), {}
                )
                for at, person in enumerate(rng.multivariate_normal(TRUTH, spread, 10))
            ]
            prior = Prior.learn(earlier)
        truth = TRUTH + (1 if number % 2 else -1) * np.array([0.3, 0.3, 0.0, 0.0])
        found = estimate(draw(rng, truth, quick_asks(rng, wave, n_trials), variation), prior)
        low, high = found.interval_hz(SPEEDS).T
        cutoff = coordinates.cutoff_hz(truth, SPEEDS)
        inside.append((low <= cutoff) & (cutoff <= high))
    print(f"{n_trials} trials, wandering {wandering}: {np.mean(inside, axis=0)}")  # noqa: T201
    # Four trials do not tell how much a finger wanders: they may be too careful.
    assert 0.92 <= np.mean(inside) <= (0.98 if n_trials > 4 else 1.0)

"""The estimate settles at the law, its intervals hold, and it follows what changes."""

from dataclasses import replace

import numpy as np
import pytest
from tests.service.tracking.scattered import explored
from tests.service.tracking.slides import BANDS, PAPER, Place, slide, speeds

from frictus_service.calibration.coordinates import Prior
from frictus_service.tracking.estimation.batch import Batch
from frictus_service.tracking.estimation.law_estimate import LawEstimate, advanced, updated

PERIOD_MM = 0.5
"""Of a grating."""


def after(
    rng: np.random.Generator, at: np.ndarray, n: int, begin: LawEstimate | None = None
) -> LawEstimate:
    """Return the estimate after so many batches at speeds of 20 to 100 mm/s."""
    estimate = LawEstimate.begin(Prior.weak(), BANDS.centre_hz.size) if begin is None else begin
    for _ in range(n):
        batch = Batch.of(slide(rng, at, speeds(rng)), BANDS)
        estimate, _ = updated(advanced(estimate, 0.5, new_contact=False), batch)
    return estimate


@pytest.mark.parametrize("factor", [0.5, 1.0, 2.0])
def test_it_settles_at_the_law_within_a_second_of_sliding(
    factor: float, rng: np.random.Generator
) -> None:
    at = PAPER + np.array([np.log(factor), np.log(factor), np.log(0.6), 40e-6])
    found = after(rng, at, 2)
    assert np.all(np.abs(found.mean - at)[:3] < [0.1, 0.1, 0.02])
    assert abs(found.mean[3] - at[3]) < 5e-6
    assert found.windows == 20


def test_without_noise_it_is_the_law(rng: np.random.Generator) -> None:
    windows = slide(rng, PAPER, [30.0] * 5 + [80.0] * 5, noise_n=0.0)
    found, _ = updated(
        LawEstimate.begin(Prior.weak(), BANDS.centre_hz.size), Batch.of(windows, BANDS)
    )
    # What is left is that a band is taken at its mean frequency.
    assert np.all(np.abs(found.mean - PAPER)[:3] < 0.01)
    assert abs(found.mean[3]) < 1e-6


@pytest.mark.long
def test_intervals_hold_where_the_cutoff_differs_from_stroke_to_stroke(
    rng: np.random.Generator,
) -> None:
    inside = []
    for _ in range(20):
        estimate = LawEstimate.begin(Prior.weak(), BANDS.centre_hz.size)
        at = Prior.weak().mean + np.array([*rng.normal(0.0, 0.3, 1).repeat(2), 0.2, 20e-6])
        for number in range(6):
            wandered = at + np.array([*rng.normal(0.0, 0.05, 1).repeat(2), 0.0, 0.0])
            stroke = [Place(direction=(-1.0) ** number)] * 10
            batch = Batch.of(slide(rng, wandered, speeds(rng), places=stroke), BANDS)
            estimate, _ = updated(advanced(estimate, 0.5, new_contact=False), batch)
        inside.append(np.abs(estimate.mean - at) < estimate.half_width)
    held = np.mean(inside, axis=0)
    assert np.all(held > 0.75)  # of 20, at 95 %


@pytest.mark.long
def test_a_line_over_strokes_that_differ_leaves_open_what_is_cutoff_and_what_is_delay(
    rng: np.random.Generator,
) -> None:
    """Deviations had a root mean square of 2.5 to 3.7 standard deviations, each update linear
    about its own law."""
    off = np.array([*np.log([2.0, 2.0]), 0.0, 0.0])  # a line far below the cutoff
    deviations = []
    for _ in range(8):
        estimate, last_s = LawEstimate.begin(Prior.weak(), BANDS.centre_hz.size), 0.0
        path = explored(rng, off)
        for _ in range(60):
            felt = next(path)
            speed_mm_s = felt.batch.speed_mm_s
            octaves = np.log2(BANDS.centre_hz / (speed_mm_s[:, np.newaxis] / PERIOD_MM))
            line = np.argmin(np.abs(octaves), axis=1)[:, np.newaxis]
            batch = replace(felt.batch, heard=np.arange(BANDS.centre_hz.size) == line)
            now_s = 60.0 * float(batch.conditions.minutes[-1])
            estimate = advanced(estimate, now_s - last_s, felt.new_contact)
            estimate, _ = updated(estimate.sliding_at(speed_mm_s), batch)
            last_s = now_s
        mean, covariance = estimate.person
        deviations.append((mean - PAPER - off) / np.sqrt(np.diag(covariance)))
    assert np.all(np.sqrt(np.mean(np.square(deviations), axis=0)) < 1.8)


def test_it_follows_a_law_that_drifts(rng: np.random.Generator) -> None:
    at = PAPER.copy()
    estimate = after(rng, at, 10)
    for _ in range(60):  # half a minute, in which gain and cutoff change by 2 %
        at = at + np.array([0.02, 0.02, -0.02, 0.0]) / 60
        estimate = after(rng, at, 1, estimate)
    assert abs(estimate.mean[2] - at[2]) < 0.005
    assert np.all(np.abs(estimate.mean - at)[:2] < 0.04)


def test_a_contact_leaves_the_cutoff_and_opens_the_gain(rng: np.random.Generator) -> None:
    estimate = after(rng, PAPER, 10)
    lifted = advanced(estimate, 1.0, new_contact=True)
    before, later = (np.sqrt(np.diag(each.covariance)) for each in (estimate, lifted))
    assert later[2] > 0.09 > 10 * before[2]
    assert later[0] < 1.1 * before[0]


def test_another_finger_is_strange_and_the_same_is_not(rng: np.random.Generator) -> None:
    estimate = after(rng, PAPER, 10)
    other = PAPER + np.array([0.7, 0.7, 0.3, 0.0])
    batches = [Batch.of(slide(rng, at, speeds(rng)), BANDS) for at in (PAPER, other)]
    same, another = (
        updated(advanced(estimate, 0.5, new_contact=True), batch)[1] for batch in batches
    )
    assert (same, another) == (False, True)


def test_a_change_within_what_people_scatter_by_is_another_finger_of_one_that_was_constant(
    rng: np.random.Generator,
) -> None:
    """It was taken to have begun to scatter, and two fingers were made one of between."""
    other = PAPER + np.array([0.1, 0.1, -0.1, 0.0])
    constant = after(rng, PAPER, 40)
    scattered = LawEstimate.begin(Prior.weak(), BANDS.centre_hz.size)
    for _ in range(40):
        off = np.array([*np.repeat(0.05 * rng.standard_normal(), 2), 0.0, 0.0])
        off[2] = 0.10 * rng.standard_normal()
        batch = Batch.of(slide(rng, PAPER + off, speeds(rng)), BANDS)
        scattered, strange = updated(advanced(scattered, 0.5, new_contact=True), batch)
        assert not strange or scattered.updates == 1
    batch = Batch.of(slide(rng, other, speeds(rng)), BANDS)
    of_constant, of_scattered = (
        updated(advanced(known, 0.5, new_contact=True), batch)[1]
        for known in (constant, scattered)
    )
    assert (of_constant, of_scattered) == (True, False)


def test_what_does_not_follow_the_drive_is_not_coherent(rng: np.random.Generator) -> None:
    deaf = PAPER + np.array([0.0, 0.0, np.log(1e-5), 0.0])
    assert Batch.of(slide(rng, deaf, [50.0] * 10), BANDS).coherence < 0.2
    assert Batch.of(slide(rng, PAPER, [50.0] * 10), BANDS).coherence > 0.95

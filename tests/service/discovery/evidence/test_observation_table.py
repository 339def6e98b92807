"""Trials become rows and units: what is averaged, since when minutes count, who is a unit."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from tests.service.discovery.made import EVERY_MINUTES, Design, Scatter, made

from frictus_service.discovery.evidence.evidence_rows import part_of, subjects_of
from frictus_service.discovery.evidence.observation_table import (
    LEAST_TRIALS,
    blocks_of,
    dealt,
    rows_of,
    units_of,
    used,
)
from frictus_service.discovery.evidence.trial_evidence import TrialEvidence

SMALL = Design(6, repeats=1)
NO_SCATTER = Scatter(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def twice(one: TrialEvidence) -> TrialEvidence:
    """Return a trial with all its sweeps twice, the second time twice as strong."""
    rows = one.observed.rows
    doubled = {
        name: np.concatenate([getattr(rows, name)] * 2) for name in rows.__dataclass_fields__
    }
    response = rows.friction_response
    doubled["friction_response"] = np.concatenate([response, 2.0 * response])
    harmonics = {
        name: np.concatenate([getattr(one.harmonics, name)] * 2)
        for name in one.harmonics.__dataclass_fields__
    }
    observed = replace(one.observed, rows=replace(rows, **doubled))
    return TrialEvidence(observed, replace(one.harmonics, **harmonics), one.stretches)


def test_what_may_be_used(rng: np.random.Generator) -> None:
    evidence = made(rng, design=SMALL)
    evidence[3] = replace(evidence[3], observed=replace(evidence[3].observed, valid=False))
    shuffled = [evidence[k] for k in rng.permutation(len(evidence))]
    kept = used(shuffled)
    assert len(kept) == len(evidence) - 1
    keys = [(one.observed.info.participant, one.observed.info.order) for one in kept]
    assert keys == sorted(keys)


def test_people_are_units(rng: np.random.Generator) -> None:
    units = units_of(used(made(rng, design=SMALL)), "friction")
    assert units.held_out == "participants"
    assert units.names == units.participant
    assert len(units.names) == 6
    assert set(np.bincount(units.of_trial)) == {12}


@pytest.mark.parametrize("people", [1, 2, 3, 4, 5])
def test_blocks_are_dealt_out(people: int, rng: np.random.Generator) -> None:
    trials = used(made(rng, design=Design(people, repeats=6)))
    units = units_of(trials, "friction")
    assert units.held_out == "blocks"
    assert len(units.names) >= 8
    assert min(np.bincount(units.of_trial)) >= LEAST_TRIALS
    for unit, owner in enumerate(units.participant):
        own = [
            one.observed.info
            for one, of in zip(trials, units.of_trial, strict=True)
            if of == unit
        ]
        assert {info.participant for info in own} == {owner}
        orders = [info.order for info in own]
        assert min(orders) < 72 / 2 <= max(orders)  # from the whole of the session
        assert len({info.tones_hz for info in own}) == 2


def test_no_order_of_trials_gives_a_block_one_condition(rng: np.random.Generator) -> None:
    """Dealt by their place alone, blocks of eight would have one tone of eight each."""
    tones, speeds = [(31.0 * 2**k,) for k in range(8)], (20.0, 60.0, 100.0)
    trials = [(tone, speed) for _ in range(4) for speed in speeds for tone in tones]
    block = dealt([tone for tone, _ in trials], 8)
    assert np.ptp(np.bincount(block)) <= 1
    for k in range(8):
        own = [trial for trial, of in zip(trials, block, strict=True) if of == k]
        assert {tone for tone, _ in own} == set(tones)
        assert len({speed for _, speed in own}) > 1


@pytest.mark.parametrize(
    ("trials", "blocks"),
    [
        ([60], [7]),
        ([60, 20], [6, 2]),
        ([16, 16, 16], [2, 2, 2]),
        ([60, 60, 60, 60, 7], [2, 2, 2, 2, 0]),
        ([15] * 5, [1] * 5),
        ([], []),
    ],
)
def test_how_many_blocks(trials: list[int], blocks: list[int]) -> None:
    assert blocks_of(trials) == blocks


def test_no_trials_no_units() -> None:
    assert units_of([], "friction").names == ()


def test_sweeps_of_equal_direction_and_third_are_one_row(rng: np.random.Generator) -> None:
    trials = used(made(rng, design=SMALL))
    doubled = [twice(one) for one in trials]
    units = units_of(trials, "friction")
    one, other = (rows_of(each, units, "friction") for each in (trials, doubled))
    assert one.tone.size == len(trials) * 6 * SMALL.tones_per_trial
    np.testing.assert_array_equal(other.tone, one.tone)
    np.testing.assert_allclose(other.measured.size, one.measured.size + np.log(1.5))
    np.testing.assert_allclose(other.measured.phase, one.measured.phase)
    np.testing.assert_allclose(other.rows.message, one.rows.message)


def test_sweeps_weigh_by_the_power_that_drives(rng: np.random.Generator) -> None:
    """A line of a texture may be in a band in one sweep and not in the next."""
    trials = used(made(rng, design=SMALL))
    doubled = []
    for each in map(twice, trials):
        rows = each.observed.rows
        message = np.where(np.arange(rows.tone_hz.size) < rows.tone_hz.size // 2, 3.0, 1.0)
        rows = replace(rows, message=message * rows.message)
        doubled.append(replace(each, observed=replace(each.observed, rows=rows)))
    units = units_of(trials, "friction")
    one, other = (rows_of(some, units, "friction") for some in (trials, doubled))
    np.testing.assert_allclose(other.measured.size, one.measured.size + np.log(1.1))


def test_what_is_measured_is_what_was_there(rng: np.random.Generator) -> None:
    share = 0.2
    trials = used(made(rng, [("direction_asymmetry", {"share": share})], scatter=NO_SCATTER))
    rows = rows_of(trials, units_of(trials, "friction"), "friction")
    at = rows.rows.circumstances
    cutoff_hz = 385.68 + 13.811 * at.speed_mm_s
    true = (1.0 + share * at.direction) / (1.0 + 1j * rows.rows.tone_hz / cutoff_hz)
    ratio = rows.measured.size - np.log(np.abs(true))
    np.testing.assert_allclose(ratio, ratio[0], atol=2e-4)
    np.testing.assert_allclose(rows.measured.phase, np.angle(true), atol=2e-4)
    assert set(rows.tones_hz[rows.tone]) == set(Design().tones_hz)


def test_minutes_count_from_each_persons_first_trial_of_a_session(
    rng: np.random.Generator,
) -> None:
    trials = made(rng, design=SMALL)
    later = []
    for one in trials:
        info = one.observed.info
        if info.order >= 6:  # the second session is as long after as it likes
            info = replace(info, session=2)
        later.append(replace(one, observed=replace(one.observed, info=info)))
    kept = used(later)
    minutes = rows_of(kept, units_of(kept, "friction"), "friction").trials.circumstances
    counted = Counter(np.round(minutes.minutes / EVERY_MINUTES).astype(int).tolist())
    assert counted == {k: 12 for k in range(6)}


def test_a_row_that_was_not_measured_is_none(rng: np.random.Generator) -> None:
    trials = used(made(rng, design=SMALL))
    rows = trials[0].observed.rows
    response = rows.friction_response.copy()
    response[:2] = np.nan
    observed = replace(trials[0].observed, rows=replace(rows, friction_response=response))
    fewer = [replace(trials[0], observed=observed), *trials[1:]]
    all_rows = rows_of(trials, units_of(trials, "friction"), "friction")
    known = rows_of(fewer, units_of(fewer, "friction"), "friction")
    assert known.tone.size == all_rows.tone.size - 2
    assert np.isfinite(known.measured.size).all()


def test_of_the_skin_only_the_response_counts(rng: np.random.Generator) -> None:
    trials = used(made(rng, design=SMALL))
    rows = rows_of(trials, units_of(trials, "friction"), "mobility").measured
    assert np.isfinite(rows.size).all()
    for unseen in (rows.second, rows.third, rows.line50, rows.line60, rows.low):
        assert np.isnan(unseen).all()


def test_a_part_of_a_subject_is_the_subject_of_these_trials(rng: np.random.Generator) -> None:
    trials = used(made(rng, design=SMALL))
    rows = rows_of(trials, units_of(trials, "friction"), "friction")
    whole = subjects_of(rows, 6)[2]
    kept = rng.random(whole.target_mm_s.size) < 0.5
    part = part_of(whole, kept)
    np.testing.assert_array_equal(part.target_mm_s, whole.target_mm_s[kept])
    np.testing.assert_array_equal(part.measured.low, whole.measured.low[kept])
    np.testing.assert_array_equal(part.measured.size, whole.measured.size[kept[whole.trial]])
    both = part.tone.size + part_of(whole, ~kept).tone.size
    assert both == whole.tone.size

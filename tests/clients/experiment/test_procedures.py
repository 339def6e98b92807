"""Procedures: QUEST+ held against the package `questplus`, staircases, constant stimuli."""

import numpy as np
import pytest
from questplus import QuestPlusWeibull

from frictus import ArgumentError
from frictus.experiment.procedures.next_level import ConstantStimuli, QuestPlus, Staircase
from frictus.experiment.psychometrics.psychometric import (
    LAPSE_FLOOR,
    ParameterGrid,
    probability,
)

LOG_LEVELS = np.linspace(-2.5, -0.5, 41)
SLOPES = np.geomspace(1.0, 8.0, 8)
GUESSES = {"2afc": [0.5], "yes-no": [0.02, 0.1, 0.2]}
LAPSES = [0.01, 0.03, 0.05]


def grid_of_thresholds(guesses: list[float]) -> ParameterGrid:
    """The candidates of `questplus`: evenly spaced thresholds where F is 1 - 1/e."""
    axes = np.meshgrid(LOG_LEVELS, SLOPES, guesses, LAPSES, indexing="ij")
    threshold, slope, guess, lapse = (axis.ravel() for axis in axes)
    prior = np.full(threshold.size, 1.0 / threshold.size)
    return ParameterGrid(10.0**threshold, slope, guess, lapse, prior)


@pytest.mark.parametrize("kind", GUESSES)
def test_quest_plus_chooses_as_questplus_in_every_trial(
    kind: str, rng: np.random.Generator
) -> None:
    theirs = QuestPlusWeibull(
        intensities=LOG_LEVELS,
        thresholds=LOG_LEVELS,
        slopes=SLOPES,
        lower_asymptotes=GUESSES[kind],
        lapse_rates=LAPSES,
        stim_scale="log10",
    )
    ours = QuestPlus(10.0**LOG_LEVELS, grid_of_thresholds(GUESSES[kind]), 60)
    threshold = 10.0 ** rng.uniform(-2.0, -1.0)
    for _ in range(60):
        asked = theirs.next_intensity
        assert np.log10(ours.next_level()) == pytest.approx(asked, abs=1e-9)
        guess = GUESSES[kind][-1]
        right = rng.random() < probability(10.0**asked, threshold, 3.0, guess, 0.02)
        theirs.update(intensity=asked, response="Yes" if right else "No")
        ours.update(10.0**asked, bool(right))
    assert ours.finished


def test_a_slip_does_not_rule_the_threshold_out() -> None:
    levels = 10.0**LOG_LEVELS
    with pytest.raises(ArgumentError, match="lapse"):
        ParameterGrid.of(levels, SLOPES, [0.5], [0.0])
    procedure = QuestPlus(levels, ParameterGrid.of(levels, SLOPES, [0.5], [LAPSE_FLOOR]), 30)
    for _ in range(20):
        procedure.update(0.01, True)
    procedure.update(levels[-1], False)
    below = procedure.grid.thresholds < 0.02
    assert np.sum(procedure.posterior[below]) > 0.5


def test_excluded_levels_are_not_proposed() -> None:
    levels = 10.0**LOG_LEVELS
    procedure = QuestPlus(levels, ParameterGrid.of(levels, SLOPES, [0.5], [0.01]), 30)
    first = procedure.next_level()
    procedure.exclude(first)
    for _ in range(10):
        assert procedure.next_level() < first
        procedure.update(procedure.next_level(), False)
    with pytest.raises(ArgumentError, match="lower them"):
        procedure.exclude(levels[0])


def test_a_staircase_turns_where_it_should() -> None:
    stairs = Staircase(1.0, 0.01, 2.0, 2, 1, [6.0, 2.0], 3, 100)
    seen = []
    for positive in (True, True, True, True, False, True, True):
        seen.append(stairs.level)
        stairs.update(stairs.level, positive)
    down_6, up_2 = 10.0**-0.3, 10.0**0.1
    expected = [1.0, 1.0, down_6, down_6, down_6**2, down_6**2 * up_2, down_6**2 * up_2]
    assert seen == pytest.approx(expected)
    assert stairs.reversals == pytest.approx([down_6**2, down_6**2 * up_2])
    assert not stairs.finished


def test_a_staircase_stays_within_its_levels() -> None:
    stairs = Staircase(1.0, 0.5, 2.0, 1, 1, [6.0], 100, 30)
    for _ in range(10):
        stairs.update(stairs.level, False)
    assert stairs.level == 2.0
    stairs.exclude(1.8)
    assert stairs.level < 1.8
    for _ in range(20):
        stairs.update(stairs.level, True)
    assert stairs.level == 0.5
    assert stairs.finished
    with pytest.raises(ArgumentError, match="lower them"):
        stairs.exclude(0.5)


def test_a_staircase_steps_from_what_was_rendered() -> None:
    stairs, rendered_most = Staircase(1.0, 0.01, 2.0, 1, 1, [6.0, 2.0], 9, 100), 0.3
    stairs.update(rendered_most, True)
    assert stairs.level == pytest.approx(rendered_most * 10.0**-0.3)
    for _ in range(9):
        stairs.update(min(stairs.level, rendered_most), False)
    assert stairs.level == pytest.approx(rendered_most * 10.0**0.1)  # not ever further up
    stairs.update(rendered_most, True)
    assert stairs.level < rendered_most
    assert stairs.reversals == pytest.approx([rendered_most * 10.0**-0.3, rendered_most])


def test_three_down_one_up_settles_near_79_percent(rng: np.random.Generator) -> None:
    stairs = Staircase(0.1, 0.001, 1.0, 3, 1, [2.0], 1_000, 3_000)
    right = []
    while not stairs.finished:
        positive = rng.random() < probability(stairs.level, 0.03, 3.0, 0.5, 0.0)
        right.append(positive)
        stairs.update(stairs.level, bool(positive))
    assert np.mean(right[50:]) == pytest.approx(0.5 ** (1.0 / 3.0), abs=0.03)  # Levitt 1971


def test_constant_stimuli_are_balanced_in_every_block(rng: np.random.Generator) -> None:
    levels = [0.1, 0.2, 0.4]
    constant = ConstantStimuli(levels, 5, rng)
    seen = []
    while not constant.finished:
        seen.append(constant.next_level())
        constant.update(seen[-1], True)
    assert len(seen) == 15
    assert all(sorted(seen[k : k + 3]) == levels for k in range(0, 15, 3))
    again = ConstantStimuli(levels, 5, rng)
    again.exclude(0.4)
    assert again.next_level() < 0.4
    with pytest.raises(ArgumentError, match="lower them"):
        again.exclude(0.1)


def test_a_last_trial_that_is_refused_ends_constant_stimuli(rng: np.random.Generator) -> None:
    constant = ConstantStimuli([0.1, 0.4], 1, rng)
    while constant.next_level() == 0.4:
        constant = ConstantStimuli([0.1, 0.4], 1, rng)
    constant.update(0.1, True)
    constant.exclude(0.4)
    assert constant.finished

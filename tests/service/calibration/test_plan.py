"""Plans: every condition once, in random order, what was rejected again; quick ones stop."""

from collections import Counter

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from frictus_hardware.physics.friction import FrictionLaw
from frictus_service.calibration.coordinates import Prior
from frictus_service.calibration.design import single
from frictus_service.calibration.job import FOR_DISCOVERY, PaperProtocol, QuickProtocol
from frictus_service.calibration.plan import (
    HOPELESS,
    Ask,
    CalibrationProtocol,
    PaperPlan,
    QuickPlan,
    RecordedTrial,
    is_hopeless,
)
from frictus_service.discovery.evidence.observation_table import (
    BLOCKS,
    LEAST_TRIALS,
    LEAST_UNITS,
    blocks_of,
)
from frictus_service.synthesis.scene import compile_excitation

SMALL = PaperProtocol(
    tones_hz=(100.0, 400.0), speeds_mm_s=(40.0, 80.0), forces_n=(0.3, 0.5), max_repeats=2
)


def finished(ask: Ask, number: int, rejected: bool = False) -> RecordedTrial:
    reason = "too slow" if rejected else ""
    return RecordedTrial(
        f"t{number}", ask.speed_mm_s, ask.force_n, ask.tones_hz, ask.record_s, reason
    )


def work_off(
    plan: CalibrationProtocol, verdicts: list[bool], precision: float | None = None
) -> list[RecordedTrial]:
    """Do trials until the plan ends; each verdict says whether one is rejected."""
    done: list[RecordedTrial] = []
    while (ask := plan.ask(done, precision)) is not None:
        rejected = len(done) < len(verdicts) and verdicts[len(done)]
        done.append(finished(ask, len(done), rejected))
        assert len(done) < 1_000
    return done


def test_a_finger_that_fails_every_trial_is_not_asked_for_ever() -> None:
    ask = Ask(60.0, 0.4, single(100.0), 1.0, 1.0)
    failed = [finished(ask, number, rejected=True) for number in range(HOPELESS)]
    assert is_hopeless(failed)
    assert not is_hopeless(failed[1:])
    assert not is_hopeless([finished(ask, HOPELESS), *failed])


def test_the_papers_protocol_has_375_trials_in_random_order(rng: np.random.Generator) -> None:
    plan = PaperPlan(PaperProtocol(), int(rng.integers(2**31)))
    assert len(set(plan.order)) == len(plan.order) == 375
    assert {round(tone) for tone, _, _ in plan.order} >= {30, 2_000}
    assert plan.planned([]) == 375
    speeds = np.array([speed for _, speed, _ in plan.order])
    assert abs(np.corrcoef(speeds, np.arange(375))[0, 1]) < 0.3
    assert plan.order != PaperPlan(PaperProtocol(), plan.seed + 1).order
    assert plan.order == PaperPlan(PaperProtocol(), plan.seed).order


def test_what_is_recorded_for_discovery_makes_enough_blocks_in_five_minutes() -> None:
    plan = PaperPlan(FOR_DISCOVERY, 7)
    done = work_off(plan, [])
    asked = FOR_DISCOVERY.approach_s + FOR_DISCOVERY.record_s
    breaks = sum(plan.break_s(done[:count]) for count in range(len(done)))
    assert len(done) * asked + breaks <= 5 * 60
    assert blocks_of([len(done)]) == [BLOCKS]
    # A third of the trials may fail, and there is a test still.
    assert blocks_of([2 * len(done) // 3])[0] >= LEAST_UNITS
    assert 2 * len(done) // 3 >= LEAST_UNITS * LEAST_TRIALS


def test_a_tone_of_the_paper_uses_all_of_the_drive() -> None:
    ask = PaperPlan(SMALL, 0).ask([], None)
    assert ask is not None
    played = compile_excitation(ask.excitation, FrictionLaw(), 20_000.0)
    assert played.peak == pytest.approx(1.0)
    assert (ask.approach_s, ask.record_s) == (7.0, 10.0)


def test_breaks_follow_each_block() -> None:
    plan = PaperPlan(SMALL.model_copy(update={"trials_per_block": 3, "break_s": 5.0}), 1)
    done = work_off(plan, [])
    assert [plan.break_s(done[:n]) for n in range(8)] == [0, 0, 0, 5, 0, 0, 5, 0]


@settings(max_examples=100, deadline=None)
@given(verdicts=st.lists(st.booleans(), max_size=40), seed=st.integers(0, 2**31))
def test_each_condition_is_measured_or_asked_for_often_enough(
    verdicts: list[bool], seed: int
) -> None:
    plan = PaperPlan(SMALL, seed)
    done = work_off(plan, verdicts)
    times = Counter((t.tones_hz[0], t.speed_mm_s, t.force_n) for t in done)
    good = Counter((t.tones_hz[0], t.speed_mm_s, t.force_n) for t in done if not t.rejected)
    for condition in plan.order:
        assert good[condition] <= 1
        assert good[condition] == 1 or times[condition] == SMALL.max_repeats + 1
    assert len(plan.left_out(done)) == len(plan.order) - len(good)
    firsts = [(t.tones_hz[0], t.speed_mm_s, t.force_n) for t in done[: len(plan.order)]]
    assert firsts == list(plan.order), "repeats come at the end"
    # A plan is a function of what was done: it goes on the same wherever it was left.
    half = done[: len(done) // 2]
    ask = plan.ask(half, None)
    assert ask is not None
    following = done[len(half)]
    assert (ask.tones_hz, ask.speed_mm_s) == (following.tones_hz, following.speed_mm_s)


def quick(**settings: object) -> QuickPlan:
    return QuickPlan(QuickProtocol.model_validate(settings), 3, Prior.weak())


def test_quick_balances_slow_and_fast_and_draws_new_phases() -> None:
    done = work_off(quick(max_recorded_s=75.0), [])
    ahead = np.cumsum([1 if trial.speed_mm_s > 60.0 else -1 for trial in done])
    assert np.abs(ahead).max() <= 1, "neither end is ever more than one trial ahead"
    conditions = Counter((trial.speed_mm_s, trial.force_n) for trial in done)
    assert len(conditions) == 30
    assert set(conditions.values()) == {1}
    plan = quick()
    asks = [plan.ask(done[:n], None) for n in range(4)]
    phases = {ask.excitation.tones[0].phase_rad for ask in asks if ask}
    assert len(phases) == 4
    again = quick().ask(done[:2], None)
    assert again is not None
    assert asks[2] is not None
    assert again.excitation == asks[2].excitation


def test_quick_plays_multisines_that_fit_the_drive() -> None:
    ask = quick().ask([], None)
    assert ask is not None
    played = compile_excitation(ask.excitation, FrictionLaw(), 20_000.0)
    assert 0.95 < played.peak <= 1.0
    assert len(ask.tones_hz) > 5


@pytest.mark.parametrize(("precision", "ends"), [(None, False), (0.06, False), (0.05, True)])
def test_quick_ends_when_it_is_precise(precision: float | None, ends: bool) -> None:
    assert (quick().ask([], precision) is None) == ends


def test_quick_ends_when_its_time_is_over() -> None:
    assert len(work_off(quick(max_recorded_s=9.9), [])) == 3
    assert len(work_off(quick(max_recorded_s=10.0), [])) == 4


def test_quick_asks_again_in_the_condition_that_was_rejected() -> None:
    plan = quick(speeds_mm_s=(30.0, 90.0), forces_n=(0.4,), max_recorded_s=37.5, max_repeats=2)
    first = plan.ask([], None)
    assert first is not None
    done = [finished(first, 0, rejected=True)]
    for number in range(1, 20):
        ask = plan.ask(done, None)
        if ask is None:
            break
        done.append(finished(ask, number, rejected=ask.speed_mm_s == first.speed_mm_s))
    rejected = [trial for trial in done if trial.rejected]
    assert len(rejected) == 3
    assert plan.left_out(done) == (f"more at {first.speed_mm_s:g} mm/s and 0.4 N",)
    assert len(done) == 15, "the other speed goes on"
    assert work_off(plan, [True] * 100) == work_off(plan, [True] * 6)

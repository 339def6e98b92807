"""The order of trials: balanced, bounded, and the same again after an interruption."""

import json
from collections import Counter
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from frictus import ArgumentError, Component, Spectrum
from frictus.experiment import (
    Adjustment,
    Amplitude,
    ConstantPlan,
    Design,
    Difference,
    LevelRange,
    Magnitude,
    NamedTexture,
    Pairs,
    Protocol,
    QuestPlusPlan,
    SameDifferent,
    ScheduledTrial,
    StaircasePlan,
    TwoAlternatives,
    YesNo,
    latin_square,
    load_protocol,
    parse_protocol,
    ready_protocols,
    results,
)
from frictus.experiment.procedures.schedule import Schedule, resumed
from frictus.experiment.tasks import KEYS, checked, is_positive

RIDGES = Spectrum(components=[Component(amplitude_n=1.0, cycles_per_mm=0.5)])
TWO = {"a": Amplitude(texture=RIDGES), "b": Difference(texture=RIDGES)}
QUEST = QuestPlusPlan(
    levels=LevelRange(low=0.01, high=0.2, count=9), slopes=[2.0, 4.0], trials=12
)
STAIRS = StaircasePlan(start=0.1, low=0.01, high=0.2, reversals=4, trials=20)
CONSTANT = ConstantPlan(levels=[0.01, 0.05, 0.2], repeats=4)
AGAINST_ITSELF = Amplitude(texture=RIDGES, standard=RIDGES)
PAIRS = Pairs(textures=[NamedTexture(name=name, texture=RIDGES) for name in "xyz"])


def protocol(**changes: Any) -> Protocol:
    fields: dict[str, Any] = {
        "name": "test",
        "task": TwoAlternatives(),
        "procedure": QUEST,
        "conditions": TWO,
    }
    return Protocol(**(fields | changes))


def answer_of(protocol: Protocol, trial: ScheduledTrial, rng: np.random.Generator) -> str:
    keys = KEYS[protocol.task.kind]
    return str(rng.choice(keys)) if keys else repr(float(rng.uniform(1.0, 9.0)))


def run(protocol: Protocol, seed: int, order_row: int = 0) -> list[dict[str, Any]]:
    """The rows of a whole experiment; every seventh trial is refused."""
    schedule, rng = Schedule(protocol, seed, order_row), np.random.default_rng(seed)
    rows: list[dict[str, Any]] = [
        {
            "format": "frictus-experiment/1",
            "protocol": json.loads(protocol.model_dump_json()),
            "seed": seed,
            "order_row": order_row,
        }
    ]
    pairs = any(isinstance(each, Pairs) for each in protocol.conditions.values())
    while (trial := schedule.next()) is not None:
        row: dict[str, Any] = {
            "trial": trial.number,
            "phase": trial.phase,
            "condition": trial.condition,
            "catch": trial.catch,
            "order": list(trial.order),
            "level": trial.level,
            "level_rendered": trial.level if "test" in trial.order else 0.0,
            "status": "answered",
            "pause": trial.pause,
        }
        easy = trial.level > 0.15 and trial.condition == "a"
        if easy and not pairs and trial.number % 7 == 0:
            rows.append(row | {"status": "refused"})
            schedule.refuse(trial)
            continue
        answer = answer_of(protocol, trial, rng)
        positive = is_positive(protocol.task, trial.order, answer)
        rows.append(row | {"response": answer, "positive": positive})
        schedule.record(trial, row["level_rendered"], positive)
    return rows


CASES = {
    "quest": protocol(design=Design(practice=3, catch_every=5, break_every=6)),
    "stairs": protocol(procedure=STAIRS, task=YesNo(), design=Design(catch_every=4)),
    "constant": protocol(
        procedure=CONSTANT, task=SameDifferent(), design=Design(catch_every=2)
    ),
    "blocked": protocol(procedure=CONSTANT, design=Design(order="blocked")),
    "numbers": protocol(procedure=CONSTANT, task=Magnitude()),
    "set": protocol(procedure=CONSTANT, task=Adjustment()),
    "pairs": protocol(
        procedure=ConstantPlan(repeats=2),
        task=Magnitude(intervals=2),
        conditions={"textures": PAIRS},
        design=Design(practice=2),
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_after_any_trial_the_same_comes_next(name: str, seed: int) -> None:
    rows = run(CASES[name], seed, order_row=1)
    assert len(rows) > 8
    for end in range(1, len(rows)):
        trial = resumed(CASES[name], rows[:end]).next()
        assert trial is not None
        expected = rows[end]
        for field in ("phase", "condition", "catch", "level"):
            assert getattr(trial, field) == expected[field]
        assert list(trial.order) == expected["order"]
        assert trial.pause == expected["pause"]
    assert resumed(CASES[name], rows).next() is None


def test_another_protocol_or_another_trial_is_not_gone_on_with(seed: int) -> None:
    rows = run(CASES["quest"], seed)
    with pytest.raises(ArgumentError, match="task"):
        resumed(protocol(task=YesNo()), rows)
    rows[3]["order"] = rows[3]["order"][::-1]
    with pytest.raises(ArgumentError, match="trial 3"):
        resumed(CASES["quest"], rows)
    del rows[2]["level_rendered"]
    with pytest.raises(ArgumentError, match="level_rendered"):
        resumed(CASES["quest"], rows)
    with pytest.raises(ArgumentError, match="header"):
        resumed(CASES["quest"], [{"protocol": 3}])


def test_orders_and_catch_trials_are_balanced(seed: int) -> None:
    plan = ConstantPlan(levels=[0.01, 0.02], repeats=40)
    rows = run(protocol(procedure=plan, design=Design(catch_every=5)), seed)[1:]
    for name in TWO:
        mine = [row for row in rows if row["condition"] == name]
        whole = mine[: len(mine) // 40 * 40]
        assert sum(row["catch"] for row in whole) == len(whole) // 5
        assert sum(row["order"][0] == "test" for row in whole) == len(whole) // 2
        assert all(row["level"] == 0.02 for row in mine if row["catch"])
        counted = Counter(row["level"] for row in mine if not row["catch"])
        assert set(counted.values()) == {40}
    conditions = [row["condition"] for row in rows]
    assert all(set(conditions[k : k + 2]) == {"a", "b"} for k in range(0, len(rows) - 1, 2))


def test_catch_trials_of_one_interval_present_the_reference(seed: int) -> None:
    for row in run(CASES["stairs"], seed)[1:]:
        assert row["order"] == (["reference"] if row["catch"] else ["test"])


def test_blocks_follow_the_latin_square(seed: int) -> None:
    conditions = {name: Amplitude(texture=RIDGES) for name in "abcd"}
    plan = ConstantPlan(levels=[0.01], repeats=3)
    blocked = protocol(procedure=plan, conditions=conditions, design=Design(order="blocked"))
    for row, order in enumerate(latin_square(4)):
        seen = [each["condition"] for each in run(blocked, seed, row)[1:]]
        assert seen == [name for k in order for name in ["abcd"[k]] * 3]


@pytest.mark.parametrize("size", range(1, 10))
def test_a_latin_square_is_balanced(size: int) -> None:
    rows = latin_square(size)
    times = len(rows) // size
    for position in range(size):
        assert Counter(row[position] for row in rows) == dict.fromkeys(range(size), times)
    follows = Counter(pair for row in rows for pair in pairwise(row))
    assert set(follows.values()) <= {times}
    assert len(follows) == size * (size - 1)


def test_refused_levels_do_not_come_again(seed: int) -> None:
    for procedure in (QUEST, STAIRS, CONSTANT):
        schedule = Schedule(protocol(procedure=procedure, design=Design(catch_every=3)), seed)
        limit = 0.08
        presented = 0
        while (trial := schedule.next()) is not None and presented < 200:
            if trial.condition == "a" and trial.level >= limit:
                schedule.refuse(trial)
                continue
            presented += 1
            schedule.record(trial, trial.level, False)
        assert trial is None
        assert presented > 10


def test_a_refused_start_of_an_adjustment_is_lowered_until_none_is_left(seed: int) -> None:
    task = Adjustment(low=0.01, high=1.0)
    procedure = ConstantPlan(levels=[0.1], repeats=2)
    schedule = Schedule(protocol(task=task, procedure=procedure), seed)
    refused = []
    while (trial := schedule.next()) is not None and 0.8 * trial.level >= task.low:
        refused.append((trial.condition, trial.level))
        schedule.refuse(trial)
        assert len(set(refused)) == len(refused)
    assert trial is not None
    with pytest.raises(ArgumentError, match=r"no level from 0\.01 on"):
        schedule.refuse(trial)


@pytest.mark.parametrize(
    "changes",
    [
        {"level_rendered": 10**400},
        {"level_rendered": float("nan")},
        {"level_rendered": -1.0},
        {"level_rendered": None},
    ],
)
def test_a_hostile_row_is_refused(changes: dict[str, Any], seed: int) -> None:
    rows = run(CASES["constant"], seed)
    with pytest.raises(ArgumentError, match="trial 1: level_rendered"):
        resumed(CASES["constant"], [rows[0], rows[1] | changes])
    with pytest.raises(ArgumentError, match="header"):
        resumed(CASES["constant"], [rows[0] | {"seed": float("inf")}])


@pytest.mark.parametrize("level", [10**400, 99, float("inf"), float("nan"), None])
def test_results_of_a_hostile_row_are_refused(level: Any, seed: int) -> None:
    rows = run(CASES["pairs"], seed)
    row = next(row for row in rows if row.get("phase") == "main")
    with pytest.raises(ArgumentError, match="no trial"):
        results(CASES["pairs"], [row | {"level": level, "flags": [], "correct": None}])


def test_a_pair_that_cannot_be_rendered_ends_it(seed: int) -> None:
    schedule = Schedule(CASES["pairs"], seed)
    trial = schedule.next()
    assert trial is not None
    with pytest.raises(ArgumentError, match="cannot render the pair"):
        schedule.refuse(trial)


def test_pairs_come_in_both_orders_and_all(seed: int) -> None:
    rows = [row for row in run(CASES["pairs"], seed)[1:] if row["phase"] == "main"]
    assert Counter(row["level"] for row in rows) == dict.fromkeys(map(float, range(1, 7)), 2)
    orders = Counter((row["level"], row["order"][0]) for row in rows)
    assert set(orders.values()) == {1}
    assert PAIRS.names(1.0) == ("x", "x")
    assert PAIRS.names(2.0) == ("x", "y")


def test_of_a_texture_paired_with_itself_the_right_answer_is_same(seed: int) -> None:
    compared = protocol(
        procedure=ConstantPlan(repeats=2), task=SameDifferent(), conditions={"t": PAIRS}
    )
    schedule = Schedule(compared, seed)
    while (trial := schedule.next()) is not None:
        first, second = PAIRS.names(trial.level)
        assert trial.correct == ("s" if first == second else "d")
        schedule.record(trial, trial.level, positive=True)


@pytest.mark.parametrize("task", [Magnitude(), Adjustment()])
def test_catch_trials_without_a_right_answer_are_not_counted_as_wrong(
    task: Magnitude | Adjustment, seed: int
) -> None:
    asked = protocol(task=task, procedure=CONSTANT, design=Design(catch_every=3))
    rows = [row | {"flags": [], "correct": None} for row in run(asked, seed)[1:]]
    assert any(row["catch"] for row in rows) == isinstance(task, Magnitude)
    assert all(found.catch_right is None for found in results(asked, rows))


def test_catch_trials_alone_are_no_design() -> None:
    with pytest.raises(ValidationError, match="catch_every"):
        Design(catch_every=1)


@pytest.mark.parametrize("name", ["detection", "amplitude-difference", "similarity"])
def test_ready_protocols_are_whole(name: str, seed: int) -> None:
    ready = load_protocol(name)
    assert ready.name == name
    assert resumed(ready, run(ready, seed)).next() is None


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"task": Magnitude()}, "constant"),
        ({"conditions": {"p": PAIRS}}, "pairs"),
        ({"procedure": ConstantPlan()}, "levels"),
        ({"conditions": {}}, "conditions"),
        ({"procedure": {"kind": "quest+", "levels": {"low": 1.0, "high": 0.5}}}, "low"),
        (
            {"procedure": {"kind": "quest+", "levels": {"low": 0.1, "high": 1}, "lapses": [0]}},
            "lapses",
        ),
        (
            {
                "procedure": {
                    "kind": "quest+",
                    "levels": {"low": 0.1, "high": 1.0, "count": 500},
                    "slopes": [1.0] * 30,
                }
            },
            "coarser",
        ),
        ({"procedure": {"kind": "staircase", "start": 1, "low": 2, "high": 3}}, "start"),
        (
            {"procedure": ConstantPlan(levels=[41.0])},
            "condition 'b': level 41, at most 40 .dB.",
        ),
        (
            {"procedure": {"kind": "staircase", "start": 1, "low": 1, "high": 101}},
            "at most 100",
        ),
        ({"procedure": CONSTANT, "task": Adjustment(high=101.0)}, "at most 100"),
        ({"procedure": ConstantPlan(levels=[1.0] * 11, repeats=1_000)}, "11000 trials"),
        (
            {
                "conditions": {"p": PAIRS},
                "procedure": ConstantPlan(levels=[7.0]),
                "task": SameDifferent(),
            },
            "at most 6",
        ),
        (
            {
                "conditions": {"p": PAIRS},
                "procedure": ConstantPlan(levels=[1.5]),
                "task": SameDifferent(),
            },
            "whole numbers",
        ),
        (
            {
                "procedure": {
                    "kind": "quest+",
                    "levels": {"low": 0.1, "high": 1.0, "count": 200},
                },
                "conditions": {str(k): TWO["a"] for k in range(32)},
            },
            "in 32 conditions",
        ),
        ({"conditions": {"a": AGAINST_ITSELF}}, "level 0.01 of a texture against itself"),
        (
            {
                "conditions": {"a": AGAINST_ITSELF},
                "procedure": ConstantPlan(levels=[0.8, 1.25]),
                "task": SameDifferent(),
            },
            "the stimulus 'difference'",
        ),
        ({"procedure": QUEST.model_dump() | {"guesses": [0.0]}}, "guesses"),
        ({"procedure": QUEST.model_dump() | {"slopes": [1e-9]}}, "slopes"),
        ({"presentation": {"interval_s": 0.2, "fade_s": 0.2}}, "fades"),
        ({"speling": 1}, "speling"),
    ],
)
def test_protocols_that_do_not_fit_together(changes: dict[str, Any], says: str) -> None:
    with pytest.raises(ValueError, match=says):
        protocol(**changes)


def test_a_texture_is_compared_with_itself_from_its_own_level_on() -> None:
    above = ConstantPlan(levels=[1.1, 1.25])
    assert protocol(conditions={"a": AGAINST_ITSELF}, procedure=above)
    assert protocol(conditions={"a": AGAINST_ITSELF}, procedure=CONSTANT, task=Magnitude())


def test_files_that_are_no_protocol(tmp_path: Path) -> None:
    file = tmp_path / "p.toml"
    with pytest.raises(FileNotFoundError, match="amplitude-difference, detection, similarity"):
        load_protocol(file)
    for content in (
        b"\xff\xfe",
        b"a = [",
        b"name = 'x'",
        b"a = " + b"[" * 10_000,
        b"a = " + b"9" * 5_000,
    ):
        file.write_bytes(content)
        with pytest.raises(ArgumentError, match=r"p\.toml"):
            load_protocol(file)


def test_a_stimulus_with_a_word_that_no_texture_has_is_refused(tmp_path: Path) -> None:
    """Passed over, `phase` in place of `phase_rad` would present another stimulus."""
    ready = ready_protocols()["detection"].read_bytes()
    file = tmp_path / "p.toml"
    file.write_bytes(ready.replace(b"cycles_per_mm = 0.5", b"cycles_per_mm = 0.5, phase = 1.0"))
    with pytest.raises(ArgumentError, match=r"texture\.spectrum\.components\.0\.phase: Extra"):
        load_protocol(file)


@pytest.mark.parametrize(
    ("task", "good", "bad"),
    [
        (TwoAlternatives(), " 1 ", "3"),
        (SameDifferent(), "D", ""),
        (YesNo(), "y", "yes please"),
        (Magnitude(), "1e2", "nan"),
        (Magnitude(low=0.0, high=10.0), "0", "11"),
        (Adjustment(), "=", "1"),
    ],
)
def test_answers_are_checked(task: Any, good: str, bad: str) -> None:
    assert checked(task, good)
    with pytest.raises(ArgumentError, match="accepted"):
        checked(task, bad)


@pytest.mark.parametrize("key", ["a." * 90_000 + "a = 1", "[" + "'a' . " * 30 + "a]", "a" * 9])
def test_what_is_no_protocol_is_refused_at_once(key: str) -> None:
    with pytest.raises(ArgumentError, match=r"a key of more than 20 parts|is not TOML"):
        parse_protocol(key.encode(), "it")


def test_ready_protocols_are_read_by_name_and_by_file() -> None:
    for name, path in ready_protocols().items():
        assert (
            load_protocol(name) == load_protocol(path) == parse_protocol(path.read_bytes(), "")
        )


@pytest.mark.parametrize("ended", ["refuse", "repeat"])
def test_a_break_comes_once(ended: str) -> None:
    made = protocol(procedure=STAIRS, design=Design(break_every=3))
    schedule = Schedule(made, 1)
    while (trial := schedule.next()) is not None and not trial.pause:
        schedule.record(trial, trial.level, False)
    assert trial is not None
    getattr(schedule, ended)(trial)
    following = schedule.next()
    assert following is not None
    assert (following.number, following.pause) == (trial.number + 1, False)

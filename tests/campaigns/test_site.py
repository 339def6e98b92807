"""What a site is judged and sized by; the site itself is a command of its own."""

import dataclasses
from pathlib import Path
from typing import Any

import pytest
from tests.campaigns.lines import Line
from tests.campaigns.reliability import site as site_section
from tests.campaigns.site import COUNTERS, LADDERS, WHOLE, climb, gave, names
from tests.campaigns.site_parts import Size
from tests.campaigns.sizing import UNITS, counted, fitted, measured_section, takes_section

GOOD: Line = {
    "name": "rigs/1",
    "size": dataclasses.asdict(Size(2, 2, 10)),
    "cores": dict.fromkeys([*UNITS, "viewers"], 0.1),
    "machine_cores": 1.0,
    "of_cores": 2,
    "frames_hz": 60.0,
    "frame_age_ms": [10.0, 20.0],
    "state_age_ms": [10.0, 20.0],
    "received": 100_000,
    "lost": 0,
    "recorder_lost": 0,
    "lateness_p99_ms": 0.2,
    "counted": dict.fromkeys(COUNTERS, 0),
    "silent": 0,
    "ended": [],
    "seconds": 10.0,
    "load": [1.0, 2.0],
    "machine": "Linux, 2 cores",
    "gave": [],
    "failures": [],
}


def test_a_site_that_holds_gives_nothing() -> None:
    assert gave(GOOD) == []


@pytest.mark.parametrize(
    ("bad", "told"),
    [
        ({"frames_hz": 50.0}, "viewers: 50 of 60 frames/s"),
        ({"frame_age_ms": [10.0, float("inf")]}, "viewers: frames inf ms old"),
        ({"lost": 100}, "subscribers: 100 of 100100 blocks lost"),
        ({"recorder_lost": 3}, "recordings: 3 blocks missing"),
        ({"lateness_p99_ms": 7.0}, "loops: 7.0 ms late"),
        ({"counted": GOOD["counted"] | {"trips": 1}}, "rigs: trips 1"),
        ({"silent": 1}, "rigs: 1 states not answered"),
        ({"ended": ["the rig process ended"]}, "the rig process ended"),
    ],
)
def test_what_gave_is_told(bad: dict[str, Any], told: str) -> None:
    assert gave(GOOD | bad) == [told]


def test_a_ladder_ends_where_something_gave_and_goes_on_there(tmp_path: Path) -> None:
    path, run = tmp_path / "lines.jsonl", list[Size]()

    def make(size: Size) -> Line:
        run.append(size)
        return {
            "size": dataclasses.asdict(size),
            "gave": ["x"] * (size.rigs > 2),
            "failures": [],
        }

    for _ in range(2):
        list(climb(path, "rigs", names(), 1, make))
    assert [size.rigs for size in run] == [1, 2, 4]
    assert LADDERS["whole"] == [WHOLE]


def test_costs_per_unit_come_back_from_what_sites_took() -> None:
    true = {unit: 0.01 * n for n, unit in enumerate(counted(WHOLE), 1)}
    sizes = [Size(1, 1, 2), Size(2, 2, 2), Size(4, 4, 2), Size(2, 8, 2), Size(2, 2, 30)]

    def took(kind: str, size: Size) -> float:
        return sum(true[unit] * counted(size)[unit] for unit in UNITS[kind])

    lines = [
        GOOD
        | {
            "size": dataclasses.asdict(size),
            "cores": {kind: took(kind, size) for kind in UNITS},
        }
        for size in sizes
    ]
    half = dataclasses.replace(sizes[-1], viewers=15)
    slow = GOOD | {
        "size": dataclasses.asdict(sizes[-1]),
        "frames_hz": 30.0,
        "cores": {kind: took(kind, half) for kind in UNITS},
        "gave": ["viewers"],
    }
    ended = GOOD | {"ended": ["the rig process ended"], "cores": dict.fromkeys(UNITS, 9.0)}
    for cost in fitted([*lines, slow, ended]):
        assert cost.cores == pytest.approx({unit: true[unit] for unit in UNITS[cost.kind]})
        assert cost.of(WHOLE) == pytest.approx(took(cost.kind, WHOLE))
        assert cost.largest_error < 1e-9
    assert "extrapolated" in takes_section(lines)


def test_units_that_only_grew_together_are_not_told_apart() -> None:
    sizes = [Size(1, 1, 2), Size(2, 2, 2), Size(4, 4, 9)]
    lines = [GOOD | {"size": dataclasses.asdict(size)} for size in sizes]
    apart = {cost.kind: cost.told_apart for cost in fitted(lines)}
    assert apart["rig"]
    assert not apart["routers"]
    assert "| routers | ? | ? | ? |" in takes_section(lines)


def test_no_cost_is_made_up_where_no_size_ran() -> None:
    with pytest.raises(ValueError, match="no size ran"):
        fitted([GOOD | {"silent": 1}])


def test_a_size_that_did_not_start_is_in_the_table() -> None:
    unstarted = {
        name: GOOD[name] for name in ("name", "size", "load", "machine", "failures")
    } | {"gave": ["StartError: nothing moved"]}
    assert "StartError: nothing moved" in measured_section([GOOD, unstarted])


def test_the_section_tells_of_each_ladder_what_held_and_what_gave() -> None:
    full = GOOD | {"name": "rigs/2", "gave": ["viewers: 50 of 60 frames/s"]}
    row = "| rigs | 1 | 2 | viewers: 50 of 60 frames/s |"
    assert row in site_section([GOOD, full])
    assert "| rigs | 1 | none |  |" in site_section([GOOD])

"""The pure modules of the live model's view, against the twin's own equations."""

import json
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Page
from tests.dashboard.estimates import IN_FORCE, LEARNED, alarmed, felt, law_of, nothing_felt

from frictus.messages import EstimateState
from frictus_hardware.physics.friction import frequency_response
from frictus_service.fidelity.preview import JND_DB

pytestmark = pytest.mark.browser


def run(page: Page, module: str, code: str, *given: Any) -> Any:
    """Return what an expression of a module `m` and of `given` is."""
    script = f'async (given) => {{ const m = await import("/{module}.js"); return {code}; }}'
    return page.evaluate(script, json.loads(json.dumps(given)))


def dumped(state: EstimateState) -> Any:
    return json.loads(state.to_json())


def view_state(page: Page, state: EstimateState, **heard: Any) -> Any:
    known: dict[str, Any] = {"rig": "rig1", "status": None, "ageMs": 0, "entries": []}
    return run(
        page,
        "live_model/view_state",
        "m.viewStateOf(given[0])",
        known | {"estimate": dumped(state)} | heard,
    )


@pytest.mark.parametrize("speed_mm_s", [10.0, 20.0, 47.0, 100.0, 150.0])
def test_the_curve_is_the_twin_s_law(page: Page, speed_mm_s: float) -> None:
    hz, levels = run(
        page,
        "live_model/law",
        "[m.FREQUENCIES_HZ, m.FREQUENCIES_HZ.map((hz) => m.levelDb(given[0], hz, given[1]))]",
        LEARNED.model_dump(),
        speed_mm_s,
    )
    expected = np.abs(frequency_response(law_of(LEARNED), np.array(hz), speed_mm_s))
    np.testing.assert_allclose(levels, 20.0 * np.log10(expected), atol=1e-9)


@pytest.mark.parametrize("speed_mm_s", [20.0, 61.0, 100.0])
def test_the_band_is_what_the_intervals_leave_open(page: Page, speed_mm_s: float) -> None:
    law = felt().law
    assert law is not None
    hz = np.array([60.0, 700.0, 1_900.0])
    got = run(
        page,
        "live_model/law",
        "given[1].map((hz) => m.halfWidthDb(given[0], hz, given[2]))",
        law.model_dump(),
        hz.tolist(),
        speed_mm_s,
    )
    level = 20.0 * np.log10(np.abs(frequency_response(law_of(LEARNED), hz, speed_mm_s)))
    squared = np.zeros(hz.size)
    for name in ("gain_n", "cutoff_20_hz", "cutoff_100_hz"):
        step = 1e-4 * getattr(LEARNED, name)
        moved = LEARNED.model_copy(update={name: getattr(LEARNED, name) + step})
        told = getattr(law, name)
        response = frequency_response(law_of(moved), hz, speed_mm_s)
        slope = (20.0 * np.log10(np.abs(response)) - level) / step
        squared += np.square(slope * (told.high - told.low) / 2.0)
    np.testing.assert_allclose(got, np.sqrt(squared), rtol=1e-3)


def test_points_are_grouped_by_speed_and_have_curves_at_it(page: Page) -> None:
    groups = view_state(page, felt())["groups"]
    assert [round(group["speedMmS"]) for group in groups] == [24, 52, 96]
    assert len({group["shape"] for group in groups}) == 3
    for group in groups:
        assert len(group["points"]) == 16
        point = group["points"][0]
        assert point["high"] - point["db"] == pytest.approx(point["half"])
        at = np.abs(frequency_response(law_of(IN_FORCE), np.array([40.0]), group["speedMmS"]))
        assert group["inForce"][0] == pytest.approx(20.0 * np.log10(at[0]), abs=1e-6)
        assert group["low"][0] < group["estimate"][0] < group["high"][0]
    slow, medium, fast = view_state(page, felt(points=()))["groups"]
    assert (slow["speedMmS"], medium, fast["speedMmS"]) == (20, None, 100)
    assert slow["points"] == []
    unknown = view_state(page, felt(in_force=None))
    assert unknown["groups"][0]["inForce"] is None


@pytest.mark.parametrize(
    ("state", "kind", "verdict"),
    [
        (nothing_felt(), "empty", "Nothing felt yet"),
        (felt(), "off", "off by more than a finger can tell"),
        (felt(error_db={"in_force": 0.4, "newest": 0.1}), "fits", "fits this finger"),
        (felt(error_db={}), "learning", "Learning this finger"),
        (alarmed(), "alarm", "wrong: cutoff, something that no cause explains"),
    ],
)
def test_the_verdict_follows_from_the_estimate(
    page: Page, state: EstimateState, kind: str, verdict: str
) -> None:
    shown = view_state(page, state)
    assert shown["kind"] == kind
    assert verdict in shown["verdict"]


def test_the_sentence_has_the_numbers_of_the_bars(page: Page) -> None:
    shown = view_state(page, felt(new_fingers=1))
    assert shown["jndDb"] == JND_DB
    assert shown["sentence"] == (
        "This finger follows the drive up to 1.40 kHz at 20 and 2.20 kHz at 100 mm/s. "
        "With this texture the model in force is 2.1 dB off, what was learned in 12 s 0.02 dB. "
        "Another finger came once: learned anew since."
    )
    assert [row["db"] for row in shown["errors"]] == [2.14, 2.14, 0.02]
    missing = view_state(page, felt(error_db={}))
    assert "Learned from 12 s of sliding so far." in missing["sentence"]


def test_what_speaks_loudest_comes_first_and_an_alarm_is_never_quiet(page: Page) -> None:
    state = felt(
        evidence={"gain": 0.3, "cutoff": 5.0, "delay": -2.0, "unknown": 80.0},
        alarms=("gain",),
        advice={"unknown": "about 400 Hz"},
    )
    evidence = view_state(page, state)["evidence"]
    shown = [(row["cause"], row["alarmed"], row["beyond"]) for row in evidence["rows"]]
    assert shown == [
        ("unknown", False, True),
        ("cutoff", False, False),
        ("gain", True, False),
    ]
    assert [row["shared"] for row in evidence["rows"]] == [True, False, False]
    assert (evidence["others"], evidence["quiet"]) == (1, True)
    many = view_state(page, felt(evidence={f"cause_{n}": 2.0 + n for n in range(7)}))[
        "evidence"
    ]
    assert (len(many["rows"]), many["others"], many["quiet"]) == (4, 3, False)
    assert evidence["rows"][0]["share"] == 1.0
    assert evidence["rows"][0]["where"] == "about 400 Hz"
    assert evidence["rows"][1]["share"] == pytest.approx(5.0 / 6.4 * evidence["alarmShare"])


def test_what_would_be_put_in_force_is_said_where_nothing_holds_it_back(page: Page) -> None:
    def proposal(policy: str, held_back: str) -> Any:
        state = felt(held_back=held_back)
        return view_state(page, state, status={"adaptation": policy})["proposal"]

    assert proposal("suggest", "") == (
        "Suggested: gain 0.460 N, cutoff 1.40 kHz at 20 and 2.20 kHz at 100 mm/s."
    )
    assert proposal("adapt", "").startswith("Put in force as it is learned")
    assert proposal("observe", "").startswith("Under Adapt this would be put in force")
    assert proposal("suggest", "a participant is in a trial") == ""


def test_everything_has_one_age(page: Page) -> None:
    assert view_state(page, felt(), ageMs=400)["stale"] is False
    old = view_state(page, felt(), ageMs=5_400)
    assert old["stale"] is True
    assert old["age"] == "Last heard 5 s ago: what is shown is from then"


LOG = """(() => {
  const log = new m.EstimateLog();
  const heard = given[0].map(([estimate, nowMs, rigNs]) => {
    log.take(estimate, nowMs, rigNs);
    return log.ageMs(nowMs);
  });
  const seen = log.entries.map(({ s, anew }) => [s - log.newest.utc_ns / 1e9, anew]);
  return { heard, seen, windows: log.newest.windows };
})()"""


def logged(page: Page, *heard: tuple[float, dict[str, Any], float, float | None]) -> Any:
    """Return what a log has of estimates; each at seconds of the tracker, with changes."""
    told = [
        [dumped(felt(**{"utc_ns": int(at_s * 1e9), "points": ()} | changes)), now_ms, rig_ns]
        for at_s, changes, now_ms, rig_ns in heard
    ]
    return run(page, "live/estimate_log", LOG, told)


def test_the_log_is_bounded_and_begins_anew_with_another_finger(page: Page) -> None:
    got = logged(
        page,
        (1_000.0, {}, 0.0, None),
        (1_300.0, {"new_fingers": 1}, 1.0, None),
        (1_650.0, {"new_fingers": 1, "windows": 3}, 2.0, None),
        (1_650.5, {"new_fingers": 1, "windows": 4, "law": None}, 3.0, None),
    )
    # What is older than ten minutes is gone; without a law there is nothing to keep.
    assert got["seen"] == [[-350.5, True], [-0.5, True]]
    assert got["windows"] == 4


def test_what_is_told_again_is_no_younger(page: Page) -> None:
    got = logged(
        page,
        (1_000.0, {}, 0.0, 1_008.0 * 1e9),  # said 8 s before the rig's newest status
        (1_000.0, {}, 500.0, 1_008.5 * 1e9),  # again, after a reconnection
        (1_009.0, {}, 900.0, 1_008.5 * 1e9),
    )
    assert got["heard"] == [8_000.0, 8_500.0, 0.0]


def test_a_history_has_gaps_and_a_range_for_what_is_known_now(page: Page) -> None:
    law = felt().law
    assert law is not None
    values = {"in": IN_FORCE.model_dump(), "law": law.model_dump()}
    wide = json.loads(json.dumps(values["law"]))
    wide["gain_n"] |= {"low": 0.0, "high": 9.0}
    entries = [
        {"s": s, "law": wide if s == 0 else values["law"], "inForce": inside, "anew": anew}
        for s, inside, anew in (
            (0, values["in"], False),
            (1, None, False),
            (61, values["in"], False),
            (62, values["in"], True),
        )
    ]
    columns, span, marks, (low, high) = run(
        page,
        "live_model/history",
        """(() => {
          const columns = m.columnsOf(given[0], "gain_n", 62);
          const told = { changes: [{ utc_ns: 50e9 }, { utc_ns: -900e9 }] };
          const marks = m.marksOf(told, given[0], 62);
          return [columns, m.axisSpanS(given[0], 62), marks, m.rangeOf(columns)];
        })()""",
        entries,
    )
    times, _, _, value, in_force = columns
    assert times == [-62, -61, -31, -1, -0.5, 0]
    assert [each is None for each in value] == [False, False, True, False, True, False]
    assert [each is None for each in in_force] == [False, True, True, False, True, False]
    assert (span, marks) == (120, [-12])
    assert 0.2 < low < IN_FORCE.gain_n
    assert law.gain_n.high < high < 0.7

"""The strip is of one state with one age: nothing on it disagrees."""

import re
from typing import Any

import pytest
from playwright.sync_api import Page

pytestmark = pytest.mark.browser


@pytest.mark.parametrize(("times", "said"), [(0, None), (1, "finger once"), (3, "3 times")])
def test_a_badge_says_that_the_model_was_adapted(
    page: Page, times: int, said: str | None
) -> None:
    shown = page.evaluate(
        """async (adaptations) => {
          const { badgesOf } = await import("/strip/badges.js");
          return badgesOf({ status: { adaptations } }).map(({ why }) => why).join();
        }""",
        times,
    )
    assert (said in shown) if said else shown == ""


@pytest.mark.parametrize(
    ("value", "figure", "verdict"),
    [
        (None, "\u2013", "none"),
        (19.4, "19", "below"),
        (19.6, "20", "inside"),
        (100.4, "100", "inside"),
        (571.0, "571", "above"),
    ],
)
def test_figure_mark_and_verdict_of_a_gauge_are_of_one_value(
    page: Page, value: float | None, figure: str, verdict: str
) -> None:
    got = page.evaluate(
        """async (value) => {
          const { gaugeStateOf } = await import("/strip/gauge_state.js");
          return gaugeStateOf({ unit: "mm/s", digits: 0, least: 120 }, value, [20, 100]);
        }""",
        value,
    )
    assert (got["figure"], got["verdict"]) == (figure, verdict)
    if value is None:
        assert got["mark"] is None
        return
    low, high = got["zone"]
    place = "below" if got["mark"] < low else "above" if got["mark"] > high else "inside"
    assert place == verdict
    assert ("✓" in got["words"]) == (verdict == "inside")


STRIP = """async (changes) => {
  const { stripStateOf } = await import("/strip/strip_state.js");
  const status = {
    state: "armed", owner: "ben.page-0a1b2c", share_with: [], last_end: null, fault: null,
    simulated: false, model_placeholder: false, finger_source: "touch", stream_stale: false,
  };
  const finger = { in_contact: true, vx_mm_s: 30, vy_mm_s: 40, normal_force_n: 0.64 };
  const validity = { speed_mm_s: [20, 100], normal_force_n: [0.2, 0.6] };
  const heard = {
    status, finger, scene: null, model: { model: { validity } }, trusted: true, ageMs: 100,
    flags: [], losses: [], heldNs: null, settling: false, gone: false,
    client: "ann.page-ffffff", scopes: ["render"],
  };
  const fresh = { ...heard, ...changes, status: { ...status, ...changes.status } };
  return stripStateOf(fresh);
}"""


def test_the_strip_is_of_one_state(page: Page) -> None:
    got = page.evaluate(STRIP, {})
    assert (got["title"], got["who"]) == ("ARMED", "Held by ben")
    assert (got["speed"]["figure"], got["speed"]["verdict"]) == ("50", "inside")
    assert (got["force"]["figure"], got["force"]["verdict"]) == ("0.64", "above")
    assert got["arm"] == {"hidden": False, "disabled": True, "label": "Arm"}
    mine = page.evaluate(STRIP, {"status": {"owner": "ann.page-ffffff"}})
    assert (mine["who"], mine["arm"]["label"]) == ("Held by you", "Disarm")
    lossy = page.evaluate(STRIP, {"losses": ["underruns"]})
    assert lossy["loop"] == {"kind": "warn", "text": "underruns"}


def test_a_state_from_before_shows_its_age_and_nothing_as_if_it_were_now(page: Page) -> None:
    got = page.evaluate(STRIP, {"trusted": False, "ageMs": 4_200, "flags": ["clipped"]})
    assert (got["kind"], got["title"], got["stale"]) == ("unknown", "Unknown", True)
    assert got["who"] == "It said last: armed, 4 s ago"
    assert got["speed"]["figure"] == got["force"]["figure"] == "\u2013"
    assert got["badges"] == []
    assert got["arm"]["hidden"]
    assert got["loop"]["kind"] == "unknown"


def test_who_ended_the_lease_is_named_with_when(page: Page) -> None:
    end = {
        "owner": "ann.page-ffffff",
        "by": "ben.page-0a1b2c",
        "reason": "stopped",
        "utc_ns": 1_700_000_000_000_000_000,
    }
    free = {"state": "disarmed", "owner": None, "last_end": end}
    got = page.evaluate(STRIP, {"status": free})
    assert got["who"] == "Nobody"
    assert re.fullmatch(r"stopped by ben at \d\d:\d\d:\d\d, held by you", got["then"])
    late = {**end, "by": None, "reason": "not renewed in time"}
    got = page.evaluate(STRIP, {"status": {**free, "last_end": late}})
    assert re.fullmatch(r"held by you until [\d:]+: not renewed in time", got["then"])


@pytest.mark.parametrize("ended", ["never", "before", "after"])
def test_who_stopped_a_rig_that_nobody_held_is_named(page: Page, ended: str) -> None:
    """A calibration disarms the rig between its trials: a stop is meant there too."""
    stop = {"client": "ann.page-ffffff", "utc_ns": FAULT["utc_ns"]}
    ended_ns = FAULT["utc_ns"] + (10**9 if ended == "after" else -(10**9))
    end = {"owner": "tester", "by": "tester", "reason": "disarmed", "utc_ns": ended_ns}
    free = {"owner": None, "state": "disarmed", "last_end": None if ended == "never" else end}
    got = page.evaluate(STRIP, {"status": {**free, "last_calls": {"stop": stop}}})
    who = "disarmed by tester" if ended == "after" else "stopped by you"
    assert re.fullmatch(rf"{who} at \d\d:\d\d:\d\d", got["then"])
    held = page.evaluate(STRIP, {"status": {"last_calls": {"stop": stop}}, "heldNs": 0})
    assert held["then"].startswith("since")


DAY_NS = 86_400_000_000_000


@pytest.mark.parametrize(("days", "dated"), [(0, False), (3, True)])
def test_what_was_on_another_day_has_its_date(page: Page, days: int, dated: bool) -> None:
    # By the rig's clock: that of the browser may be hours off.
    now_ns = FAULT["utc_ns"] + days * DAY_NS
    end = {"owner": "ben.page-0a1b2c", "by": "ann.page-ffffff", "reason": "stopped"}
    status = {"owner": None, "last_end": {**end, "utc_ns": FAULT["utc_ns"]}, "utc_ns": now_ns}
    tripped = {"state": "tripped", "fault": FAULT}
    told = [
        page.evaluate(STRIP, {"status": {**status, "state": "disarmed"}})["then"],
        page.evaluate(STRIP, {"status": {**status, **tripped}})["fault"],
        page.evaluate(STRIP, {"status": {"utc_ns": now_ns}, "heldNs": FAULT["utc_ns"]})["then"],
    ]
    date = r"Nov 1[45], " if dated else ""
    time = r"\d\d:\d\d:\d\d"
    assert re.fullmatch(rf"stopped by you at {date}{time}, held by ben", told[0])
    assert re.match(rf"{date}{time} device lost fault: ", told[1])
    assert re.fullmatch(rf"since {date}{time}", told[2])


FAULT: dict[str, Any] = {
    "kind": "device_lost",
    "reason": "no answer",
    "utc_ns": 1_700_000_000_000_000_000,
    "action": "Check the cable, then reset the rig and arm again.",
}


@pytest.mark.parametrize("scopes", [["render"], ["render", "admin"]])
def test_a_trip_says_what_to_do_and_who_may(page: Page, scopes: list[str]) -> None:
    status = {"state": "tripped", "owner": None, "fault": FAULT}
    got = page.evaluate(STRIP, {"status": status, "scopes": scopes})
    may = "admin" in scopes
    assert (got["title"], got["reset"]["hidden"]) == ("TRIPPED", not may)
    assert re.fullmatch(
        r"[\d:]+ device lost fault: no answer\. Check the cable, then reset the rig and arm "
        r"again\." + ("" if may else r" A reset needs the scope admin\."),
        got["fault"],
    )


def test_a_rig_whose_process_has_ended_is_told_by_its_supervisor(page: Page) -> None:
    end = {"owner": "ben.page-0a1b2c", "by": None, "reason": "the rig process ended"}
    status = {
        "state": "tripped",
        "owner": None,
        "fault": FAULT,
        "last_end": {**end, "utc_ns": FAULT["utc_ns"]},
    }
    got = page.evaluate(STRIP, {"status": status, "trusted": False, "gone": True})
    assert (got["kind"], got["title"], got["who"]) == ("unknown", "Ended", "Nobody")
    assert re.fullmatch(r"held by ben until [\d:]+", got["then"])  # the fault says why
    assert "no answer" in got["fault"]
    assert got["arm"]["hidden"]
    assert got["reset"]["hidden"]  # there is nothing to reset
    # Where the service is not heard, nothing of it is certain.
    lost = page.evaluate(STRIP, {"status": status, "trusted": False})
    assert (lost["title"], lost["fault"]) == ("Unknown", "")
    assert lost["who"].startswith("It said last: tripped")

"""The page's pure modules, in the browser that runs them, against the service's own figures."""

import re
import struct
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Page, expect
from tests.dashboard.conftest import OpenPage

from frictus_hardware.physics.friction import FrictionLaw
from frictus_service.fidelity.preview import CENTRES_HZ, band_power, error_db

pytestmark = pytest.mark.browser

RATE_HZ = 20_000.0
SEGMENT = 8_192


@pytest.fixture(scope="module")
def page(open_page: OpenPage, folder_url: str) -> Iterator[Page]:
    with open_page() as page:
        page.goto(f"{folder_url}/style.css")
        yield page


def packed(
    data: np.ndarray[Any, Any],
    lost: int = 0,
    per_column: int = 80,
    run: int = 7,
    first_sample: int = 1_000,
) -> Any:
    """Return a min/max frame of `force`; data of shape (channels, 2, columns)."""
    channels, _, columns = data.shape
    header = struct.pack(
        "<HHHHIIQQdII8x",
        *(1, 1, channels, 64, run, columns),
        *(first_sample, lost, RATE_HZ, per_column, 1),
    )
    return list(header + data.astype("<f4").tobytes())


def test_frame_is_decoded(page: Page, rng: np.random.Generator) -> None:
    data = rng.normal(size=(3, 2, 5)).astype(np.float32)
    frame = page.evaluate(
        """async (bytes) => {
          const { decode } = await import("/frames.js");
          const frame = decode(new Uint8Array(bytes).buffer);
          const [low, high] = [frame.low, frame.high].map((rows) => rows.map((r) => [...r]));
          return { ...frame, low, high };
        }""",
        packed(data, lost=160),
    )
    np.testing.assert_array_equal(frame.pop("low"), data[:, 0])
    np.testing.assert_array_equal(frame.pop("high"), data[:, 1])
    assert frame == {
        "stream": "force",
        "channels": 3,
        "columns": 5,
        "flags": 64,
        "run": 7,
        "firstSample": 1_000,
        "lostSamples": 160,
        "sampleRateHz": RATE_HZ,
        "samplesPerColumn": 80,
        "raw": False,
    }


@pytest.mark.parametrize(
    ("place", "value"),
    [(0, 2), (2, 99), (44, 7), (12, 6)],
    ids=["version", "stream", "kind", "size"],
)
def test_what_is_no_frame_is_refused(page: Page, place: int, value: int) -> None:
    frame = packed(np.zeros((3, 2, 5)))
    frame[place] = value
    refused = page.evaluate(
        """async (frames) => {
          const { decode } = await import("/frames.js");
          return frames.map((bytes) => {
            try { decode(new Uint8Array(bytes).buffer); } catch (error) { return error.name; }
          });
        }""",
        [frame, frame[:20]],
    )
    assert refused == ["RangeError", "RangeError"]


@pytest.mark.parametrize(("times", "said"), [(0, None), (1, "finger once"), (3, "3 times")])
def test_a_badge_says_that_the_model_was_adapted(
    page: Page, times: int, said: str | None
) -> None:
    shown = page.evaluate(
        """async (adaptations) => {
          const { badgesOf } = await import("/badges.js");
          return badgesOf({ status: { adaptations } }).map(({ why }) => why).join();
        }""",
        times,
    )
    assert (said in shown) if said else shown == ""


@pytest.mark.parametrize(
    ("owner", "name"),
    [
        (None, "nobody"),
        ("ann.page-0a1b2c", "you"),
        ("ann.page-ffffff", "you, in another page"),
        ("ben.page-0a1b2c", "ben"),
        ("local.page-0a1b2c", "another page"),
        ("local.participant-0a1b2c", "the participant's page"),
        ("tablet.participant-0a1b2c", "the participant's page"),
        ("local.rest", "a REST client"),
        ("ben.rest", "ben's REST client"),
        ("local", "everybody here"),
        ("lab-pc-7-4711-0a1b2c", "a program on lab-pc-7"),
        ("linen-study", "linen-study"),
        ("ben.experiment-0a1b2c3d", "ben's experiment"),
        ("local.experiment-0a1b2c3d", "an experiment"),
        ("local.calibration-0a1b2c3d", "a calibration"),
    ],
)
def test_a_holder_has_a_name_that_people_know(page: Page, owner: str | None, name: str) -> None:
    got = page.evaluate(
        """async (owner) => {
          const { nameOf } = await import("/holder.js");
          return nameOf(owner, "ann.page-0a1b2c");
        }""",
        owner,
    )
    assert got == name


JOB = "ben.experiment-0a1b2c3d"


@pytest.mark.parametrize(
    ("before", "owner", "taken"),
    [
        ({"owner": None, "last_end": None}, JOB, True),
        ({"owner": JOB, "last_end": None}, JOB, False),
        ({"owner": JOB, "last_end": None}, None, False),
        ({"owner": None, "last_end": {"owner": JOB}}, JOB, False),  # its next trial
        ({"owner": None, "last_end": {"owner": "tester"}}, JOB, True),
        ({"owner": None, "last_end": {"owner": "tester"}}, "tester", True),
    ],
)
def test_a_job_holds_a_rig_from_its_first_trial_on(
    page: Page, before: dict[str, object], owner: str | None, taken: bool
) -> None:
    got = page.evaluate(
        """async ([before, owner]) => {
          const { takesRig } = await import("/holder.js");
          return takesRig(before, { owner });
        }""",
        [before, owner],
    )
    assert got == taken


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
          const { gaugeStateOf } = await import("/gauge_state.js");
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
  const { stripStateOf } = await import("/strip_state.js");
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


FAULT = {
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


def _call(utc_ns: int, **clients: str) -> dict[str, Any]:
    made = {name: {"client": client, "utc_ns": utc_ns} for name, client in clients.items()}
    return {"last_calls": made}


LOG = """async (steps) => {
  const { EventLog, MOST } = await import("/event_log.js");
  const log = new EventLog();
  const rest = {
    run: 1, state: "disarmed", owner: null, share_with: [], last_end: null, fault: null,
    compensation: { mode: "model", speed_mm_s: null }, adaptation: "observe", adaptations: 0,
    model_etag: "a", scene_etag: "smooth",
  };
  let before = null;
  for (const { losses = [], scene = null, late = null, ...changes } of steps) {
    const after = { ...rest, ...before, ...changes };
    log.takeStatus(before, after, losses, "ann.page-ffffff", scene);
    if (late !== null) log.takeScene(late);
    before = after;
  }
  const { version } = log;
  log.takeStatus(before, before, [], "ann.page-ffffff", null);
  if (log.version !== version) throw new Error("drawn anew for nothing");
  return [log.entries.map(({ what, who, more }) => `${what}|${who}|${more}`), MOST];
}"""


def test_a_calibration_fills_no_log_with_its_trials_and_hides_no_stop(page: Page) -> None:
    """It arms, plays and disarms for each trial; who stops it, and what trips, stays apart."""
    job = "local.calibration-0a1b2c3d"
    steps: list[dict[str, Any]] = [{"utc_ns": 1}]
    for trial in range(1, 41):
        ns = 10 * trial
        end = {"owner": job, "by": job, "reason": "disarmed", "utc_ns": ns + 5}
        etag = f"e{trial}"
        excited = {"etag": etag, "source": "excitation", "scene": {"name": ""}}
        if trial == 21:
            stop = {**end, "by": "ann.page-ffffff", "reason": "stopped"}
            steps.append({"utc_ns": ns, "state": "armed", "owner": job})
            steps.append(
                {"utc_ns": ns + 5, "state": "disarmed", "owner": None, "last_end": stop}
            )
            continue
        steps += [
            {"utc_ns": ns, "state": "armed", "owner": job},
            {"utc_ns": ns + 1, "scene_etag": etag, "late": excited},
            {"utc_ns": ns + 5, "state": "disarmed", "owner": None, "last_end": end},
            {"utc_ns": ns + 6, "scene_etag": "smooth"},
        ]
    got, _ = page.evaluate(LOG, steps)
    assert len(got) < 16
    (stopped,) = [n for n, told in enumerate(got) if told.startswith("Stopped|you|")]
    armed = [told for told in got if told.startswith("Armed|a calibration|")]
    assert [told.split("|")[2][:10] for told in armed] == [", 19 times", ", 21 times"]
    assert stopped > 0


def test_events_name_what_and_who_the_newest_first(page: Page) -> None:
    end = {"owner": "tester", "by": "ann.page-ffffff", "reason": "stopped", "utc_ns": 9}
    fault = {"kind": "sensor", "reason": "no force", "utc_ns": 12}
    got, _ = page.evaluate(
        LOG,
        [
            {"utc_ns": 1, "state": "tripped"},  # what was before is no event
            {"utc_ns": 2, "state": "armed", "owner": "tester"},
            {"utc_ns": 3, "compensation": {"mode": "none"}} | _call(3, compensation="tester"),
            {"utc_ns": 4, "adaptation": "adapt"} | _call(4, adaptation="ben.page-123456"),
            {"utc_ns": 5, "adaptations": 1, "model_etag": "b"},
            {"utc_ns": 6, "adaptations": 0, "model_etag": "a"},
            {"utc_ns": 7, "losses": [{"name": "underruns", "grown": 2}]},
            {"utc_ns": 9, "state": "disarmed", "owner": None, "last_end": end},
            {"utc_ns": 12, "state": "tripped", "fault": fault},
        ],
    )
    assert got == [
        "Tripped: sensor fault, no force||",
        "Stopped|you|, held by tester",
        "Losses, underruns: 2||",
        "Model put back, or set anew||",
        "Model adapted to the finger|the tracker|",
        "Policy: Adapt|ben|",
        "Not compensated: nothing makes up for finger and screen|tester|",
        "Armed|tester|",
    ]


def test_a_rig_that_was_started_again_is_told_in_order(page: Page) -> None:
    fault = {"kind": "internal", "reason": "the rig process ended: killed", "utc_ns": 7}
    end = {"owner": "ben", "by": None, "reason": "the rig process ended", "utc_ns": 7}
    told = {"state": "tripped", "owner": None, "fault": fault, "last_end": end}
    again = {"state": "disarmed", "run": 2}
    before = [{"utc_ns": 1}, {"utc_ns": 2, "state": "armed", "owner": "ben"}]
    expected = [
        "The rig was started again, disarmed; it needs no reset||",
        "Tripped: internal fault, the rig process ended: killed||",
        "Disarmed: the rig process ended||, held by ben",
        "Armed|ben|",
    ]
    seen, _ = page.evaluate(LOG, [*before, {"utc_ns": 7, **told}, {"utc_ns": 9, **again}])
    missed, _ = page.evaluate(LOG, [*before, {"utc_ns": 9, **told, **again}])
    assert seen == missed == expected


def test_a_reset_is_an_event(page: Page) -> None:
    fault = {"kind": "safety", "reason": "too much force", "utc_ns": 2}
    steps = [{"utc_ns": 1}, {"utc_ns": 2, "state": "tripped", "fault": fault}]
    reset = {"state": "disarmed", "fault": None} | _call(3, reset="ben.page-123456")
    got, _ = page.evaluate(LOG, [*steps, {"utc_ns": 3, **reset}])
    assert got == ["Reset|ben|", "Tripped: safety fault, too much force||"]


def test_a_scene_is_told_by_its_name_with_who_set_it_and_nobody_by_an_older_call(
    page: Page,
) -> None:
    def scene(name: str, source: str = "scene") -> dict[str, Any]:
        state = {"etag": name, "source": source, "scene": {"name": name}}
        return {"scene_etag": name, "scene": state}

    steps = [
        {"utc_ns": 1},
        {"utc_ns": 4, **scene("silk")} | _call(3, scene="ben.page-123456"),
        {"utc_ns": 9, **scene("waves", "stream")} | _call(6, open_stream="tester"),
        {"utc_ns": 12, **scene("silk")},
        {"utc_ns": 14, "scene_etag": "felt"},
        {"utc_ns": 15, "scene_etag": "vinyl", "late": scene("vinyl")["scene"]},
    ]
    got, _ = page.evaluate(LOG, steps)
    assert got == [
        "Scene vinyl||",
        "Another scene||",
        "Scene silk||",
        "Texture streamed by a client|tester|",
        "Scene silk|ben|",
    ]


def test_a_run_of_losses_is_one_entry_a_minute(page: Page) -> None:
    steps = [
        {"utc_ns": int(1e9 * s), "losses": [{"name": "underruns", "grown": 2}]}
        for s in (0, 1, 30, 62, 70)
    ]
    got, _ = page.evaluate(LOG, steps)
    assert got == ["Losses, underruns: 4|| within 8 s", "Losses, underruns: 4|| within 29 s"]


def test_counters_are_told_as_rates_of_the_last_minute_of_one_run(page: Page) -> None:
    got = page.evaluate(
        """async () => {
          const { CounterRates } = await import("/counter_rates.js");
          const rates = new CounterRates();
          const told = [];
          const tell = (run, s, underruns) => {
            rates.take({ run, utc_ns: s * 1e9, counters: { underruns } });
            told.push(rates.perMinute("underruns"));
          };
          const first = [[0, 4], [4, 5], [10, 5], [30, 6], [90, 6], [95, 9]];
          for (const [s, n] of first) tell(1, s, n);
          for (const [s, n] of [[96, 0], [96, 0], [106, 2], [20, 2]]) tell(2, s, n);
          return told;
        }"""
    )
    of_a_run = [None, None, 6.0, 4.0, 0.0, 36.0]  # from 30 s on, then from 90 s on
    assert got == [*of_a_run, None, None, 12.0, None]


def test_the_log_of_events_is_bounded(page: Page) -> None:
    steps = [{"utc_ns": i, "model_etag": str(i)} for i in range(400)]
    got, most = page.evaluate(LOG, steps)
    assert len(got) == most < 400


@pytest.mark.parametrize(
    ("changes", "age_ms", "kind", "text"),
    [
        ({}, 0, "runs", "Recording pilot: 1 min 05 s, 3.40 MB, nothing lost"),
        ({"lost_blocks": 1}, 0, "lossy", "Recording pilot: 1 min 05 s, 3.40 MB, 1 block lost"),
        (
            {},
            7_200,
            "unknown",
            "pilot: 1 min 05 s, 3.40 MB, nothing lost; no word from the recorder for 7 s",
        ),
        (
            {"recording": False},
            0,
            "idle",
            "The last one, pilot: 1 min 05 s, 3.40 MB, nothing lost.",
        ),
        (
            {"recording": False, "bytes_written": 0, "problem": "the disk is full"},
            0,
            "bad",
            "The last one: pilot. the disk is full",
        ),
    ],
)
def test_what_the_recorder_does_is_told_with_length_and_losses(
    page: Page, changes: dict[str, Any], age_ms: int, kind: str, text: str
) -> None:
    got = page.evaluate(
        """async ([changes, ageMs]) => {
          const { recordStateOf } = await import("/recordings/record_state.js");
          const recording = {
            recording: true, name: "pilot", seconds: 65.4, bytes_written: 3400000,
            lost_blocks: 0, problem: null, ...changes,
          };
          return recordStateOf({ rig: "rig1", recording, ageMs, trusted: true, may: true });
        }""",
        [changes, age_ms],
    )
    running = changes.get("recording", True)
    assert got == {"kind": kind, "text": text, "start": not running, "end": running}


def test_losses_are_news_only_where_a_counter_grew(page: Page) -> None:
    got = page.evaluate(
        """async () => {
          const { LOSSES, LoopLosses } = await import("/loop_losses.js");
          const log = new LoopLosses();
          const of = (run, underruns) => {
            const none = Object.fromEntries(Object.keys(LOSSES).map((name) => [name, 0]));
            return { run, counters: { ...none, underruns } };
          };
          return [
            log.take(of(1, 5), 0), log.take(of(1, 7), 1), log.recent(2), log.recent(40000),
            log.take(of(2, 9), 3), log.recent(4),
          ];
        }"""
    )
    assert got == [[], [{"name": "underruns", "grown": 2}], ["underruns"], [], [], []]


HISTORY = """async ([frames, capacity, from, merged, pairs]) => {
  const { decode } = await import("/frames.js");
  const { History } = await import("/history.js");
  const kept = new History(capacity);
  for (const bytes of frames) kept.push(decode(new Uint8Array(bytes).buffer));
  const line = new Array(2 * pairs).fill(0);
  kept.fill(line, 0, from, merged);
  const { samples, lost, end, endS } = kept;
  return { line, samples, lost, end, endS };
}"""


def columns(rng: np.random.Generator, count: int) -> np.ndarray[Any, Any]:
    """Return least and greatest values of one channel, shape (1, 2, count)."""
    return np.sort(rng.normal(size=(1, 2, count)).astype(np.float32), axis=1)


def test_history_keeps_each_column_at_its_own_time(
    page: Page, rng: np.random.Generator
) -> None:
    first, second = columns(rng, 3), columns(rng, 3)
    later = packed(second, lost=160, first_sample=1_000 + (3 + 2) * 80)  # two columns are lost
    got = page.evaluate(HISTORY, [[packed(first), later], 6, 12, 1, 8])
    # Column 12 begins before sample 1000; six columns are kept, of them one of the first frame.
    expected = [None] * 4 + [*first[0, :, 2]] + [None] * 4 + [*second[0].T.ravel()]
    assert got["line"] == [None if v is None else float(v) for v in expected]
    assert (got["samples"], got["lost"], got["end"]) == (480, 160, 20)
    assert got["endS"] == pytest.approx(20 * 80 / RATE_HZ)


def test_history_merges_columns_without_losing_an_extreme(
    page: Page, rng: np.random.Generator
) -> None:
    long = columns(rng, 40)
    got = page.evaluate(HISTORY, [[packed(long)], 100, 12, 8, 6])
    low, high = (row.reshape(5, 8) for row in long[0])
    expected = np.ravel((low.min(axis=1), high.max(axis=1)), "F")
    assert got["line"] == [*(float(v) for v in expected), None, None]


def test_history_takes_frames_longer_than_itself_and_forgets_a_former_run(
    page: Page, rng: np.random.Generator
) -> None:
    former, long = columns(rng, 3), columns(rng, 10)
    got = page.evaluate(HISTORY, [[packed(former, run=1), packed(long, run=2)], 6, 16, 1, 6])
    assert got["line"] == [float(v) for v in long[0, :, 4:].T.ravel()]
    got = page.evaluate(HISTORY, [[packed(long, run=1), packed(former, run=2)], 6, 12, 1, 6])
    assert got["line"][6:] == [None] * 6


def test_history_is_not_spoilt_by_what_is_too_late_for_it(
    page: Page, rng: np.random.Generator
) -> None:
    late, long = columns(rng, 3), columns(rng, 6)
    newest = packed(long, first_sample=80_000)
    got = page.evaluate(HISTORY, [[newest, packed(late)], 6, 1_000, 1, 6])
    assert got["line"] == [float(v) for v in long[0].T.ravel()]


def test_the_axis_of_time_moves_stands_and_stays_within_what_is_kept(page: Page) -> None:
    got = page.evaluate(
        """async () => {
          const { TimeAxis } = await import("/time_axis.js");
          const axis = new TimeAxis();
          const seen = [];
          const note = () => seen.push([axis.live, ...axis.range.map((s) => +s.toFixed(6))]);
          axis.advance(1000); note();
          axis.show(10); note();
          axis.look([-4, -3.5]); note();
          axis.advance(1003); note();        // time goes on, what is shown stands
          axis.show(1); note();              // around the same middle
          axis.look([5, 900]); note();       // no more than there is
          axis.look([-900, -899]); note();
          axis.look([-7, -7]); note();       // never nothing
          axis.resume(); note();
          axis.pause(); note();
          axis.advance(5); note();           // another run of the rig
          return seen;
        }"""
    )
    assert got == [
        [True, -2, 0],
        [True, -10, 0],
        [False, -4, -3.5],
        [False, -4, -3.5],
        [False, -4.25, -3.25],
        [False, -600, 0],
        [False, -600, -599],
        [False, -7.02, -7],
        [True, -2, 0],
        [False, -2, 0],
        [True, -2, 0],
    ]


@pytest.mark.parametrize(
    ("protocol", "precision", "reached", "held_out_db", "forces_n", "good_for", "narrower"),
    [
        (
            "quick",
            0.04,
            True,
            0.34,
            [0.2, 0.6],
            "within 0.34 dB (rms) of what a texture asks for at 20 to 100 mm/s "
            "and 0.2 to 0.6 N, which people do not feel (from 1.21 dB on).",
            "About 80 s recorded in place of 20 s narrow it to 2 %",
        ),
        (
            "quick",
            0.1,
            False,
            1.5,
            [0.2, 0.6],
            "which people can feel (from 1.21 dB on).",
            "About 80 s recorded in place of 20 s narrow it to 5 %",
        ),
        (
            "paper",
            0.04,
            True,
            None,
            [0.4, 0.4],
            "20 to 100 mm/s and 0.4 N; how close they come to what is asked for is not known",
            "About four times as many trials halve the interval",
        ),
    ],
)
def test_what_a_calibration_is_good_for_and_what_would_narrow_it(
    page: Page,
    protocol: str,
    precision: float,
    reached: bool,
    held_out_db: float | None,
    forces_n: list[float],
    good_for: str,
    narrower: str,
) -> None:
    known, good, more = page.evaluate(
        """async (calibration) => {
          const { adviceOf } = await import("/calibrate/advice.js");
          return adviceOf(calibration);
        }""",
        {
            "participant": "P01",
            "spec": {"protocol": {"kind": protocol, "precision": 0.05}},
            "result": {
                "precision": precision,
                "reached": reached,
                "recorded_s": 20.0,
                "model": {"validity": {"speed_mm_s": [20, 100], "normal_force_n": forces_n}},
                "details": {
                    "diagnostics": {"held_out": held_out_db and {"held_out_db": held_out_db}}
                },
            },
        },
    )
    assert known.startswith(
        f"The cutoff is known within {100 * precision:.1f} % at every speed; what was asked"
    )
    assert ("not reached" in known) != reached
    assert good_for in good
    assert more.startswith(narrower)


@pytest.mark.parametrize(
    ("owner", "told"),
    [
        (None, ""),
        ("ann.page-0a1b2c", "You hold rig1 yourself: press Disarm, then begin."),
        ("ben.page-0a1b2c", "ben holds rig1: wait until it is disarmed, or press STOP."),
        (
            "ben.calibration-0a1b2c3d",
            "ben's calibration holds rig1: wait until it is disarmed, or press STOP.",
        ),
    ],
)
def test_who_would_begin_is_told_what_to_do_about_the_holder(
    page: Page, owner: str | None, told: str
) -> None:
    got = page.evaluate(
        """async (owner) => {
          const { heldAlready } = await import("/holder.js");
          return heldAlready("rig1", owner, "ann.page-0a1b2c");
        }""",
        owner,
    )
    assert got == told


def test_a_spectrogram_of_nothing_is_empty(page: Page) -> None:
    said, painted = page.evaluate(
        """async () => {
          const { Spectrogram } = await import("/spectrogram.js");
          const shown = new Spectrogram(document.createElement("figure"));
          const low = Array(5).fill(new Float32Array(1024).fill(0.2));
          const frame = { raw: true, run: 1, lostSamples: 0, sampleRateHz: 2e4, columns: 1024 };
          shown.push({ ...frame, low });
          shown.draw();
          shown.tell();
          const { width, height } = shown.canvas;
          const { data } = shown.canvas.getContext("2d").getImageData(0, 0, width, height);
          const painted = data.some((value, i) => i % 4 === 3 && value > 0);
          return [shown.strongest.textContent, painted];
        }"""
    )
    assert said == "Nothing is felt now"
    assert not painted


def test_spectrogram_has_a_tone_where_and_as_strong_as_it_is(page: Page) -> None:
    time_s = np.arange(1_024) / RATE_HZ
    bin_hz = RATE_HZ / 1_024
    tone = 0.4 + 0.03 * np.sqrt(2.0) * np.sin(2.0 * np.pi * 12.0 * bin_hz * time_s)
    got = page.evaluate(
        """async (samples) => {
          const { levels } = await import("/spectrogram.js");
          return [...levels(Float64Array.from(samples))];
        }""",
        tone.tolist(),
    )
    assert int(np.argmax(got)) == 12
    assert got[12] == pytest.approx(20.0 * np.log10(0.03), abs=0.01)
    assert max(got[:10] + got[15:]) < -100.0  # neither its mean nor its ends are there


def test_envelope_paints_from_the_least_to_the_greatest_value_and_leaves_gaps(
    page: Page, rng: np.random.Generator
) -> None:
    least = rng.uniform(-3.0, 0.0, 9)
    greatest = least + rng.uniform(0.0, 4.0, 9)
    least[4] = greatest[4] = np.nan
    values = [None if np.isnan(each) else each for each in np.ravel((least, greatest), "F")]
    ratio, painted = page.evaluate(
        """async (values) => {
          const { envelope } = await import("/envelope.js");
          const pen = new OffscreenCanvas(1, 1).getContext("2d");
          const times = values.map((_, i) => i);
          const valToPos = (value, axis) => (axis === "x" ? 10 : -20) * value;
          const { fill } = envelope({ data: [times, values], valToPos }, 1);
          const heights = Array.from({ length: 1200 }, (_, i) => (i - 600) / 5);
          const painted = times.filter((i) => i % 2 === 0).map((i) =>
            heights.filter((y) => pen.isPointInPath(fill, 10 * i + 0.01, y)));
          return [devicePixelRatio, painted.map((ys) => ys.length ? [ys[0], ys.at(-1)] : null)];
        }""",
        values,
    )
    assert painted[4] is None
    # Past the last column before a gap, and past the very last one, nothing is painted.
    for column in (0, 1, 2, 5, 6, 7):
        top, bottom = painted[column]
        assert top == pytest.approx(-20 * greatest[column] - 0.75 * ratio, abs=0.5)
        assert bottom == pytest.approx(-20 * least[column] + 0.75 * ratio, abs=0.5)


def test_third_octaves_are_those_of_the_service(page: Page, rng: np.random.Generator) -> None:
    felt = np.cumsum(rng.normal(size=SEGMENT)) * 1e-3 + rng.normal(size=SEGMENT)
    target = rng.normal(size=SEGMENT)
    got = page.evaluate(
        """async ([felt, target, rate]) => {
          const { bandPower, errorsDb } = await import("/spectrum.js");
          const [a, b] = [felt, target].map((x) => bandPower(Float64Array.from(x), rate));
          return { felt: [...a], target: [...b], errors: errorsDb(a, b) };
        }""",
        [felt.tolist(), target.tolist(), RATE_HZ],
    )
    powers = [band_power(x, RATE_HZ, [slice(0, SEGMENT)]) for x in (felt, target)]
    np.testing.assert_allclose(got["felt"], powers[0], rtol=1e-9)
    np.testing.assert_allclose(got["target"], powers[1], rtol=1e-9)
    errors = [np.nan if error is None else error for error in got["errors"]]
    np.testing.assert_allclose(errors, error_db(*powers), atol=1e-8)


def test_uncompensated_is_what_the_model_lets_through(
    page: Page, rng: np.random.Generator
) -> None:
    law = FrictionLaw(
        gain_n=1.0, cutoff_0_hz=rng.uniform(50, 500), slope_hz_per_mm_s=rng.uniform(0, 20)
    )
    speed = rng.uniform(20.0, 100.0)
    got = page.evaluate(
        """async ([law, speed]) => {
          const { uncompensated } = await import("/spectrum.js");
          return [...uncompensated(new Float64Array(16).fill(1), law, -speed)];
        }""",
        [{"cutoff_0_hz": law.cutoff_0_hz, "slope_hz_per_mm_s": law.slope_hz_per_mm_s}, speed],
    )
    cutoff_hz = law.cutoff_0_hz + law.slope_hz_per_mm_s * speed
    np.testing.assert_allclose(got, np.abs(1.0 / (1.0 + 1j * CENTRES_HZ / cutoff_hz)) ** 2)


def test_target_follows_the_path(page: Page, rng: np.random.Generator) -> None:
    angle_deg, turns, hz = rng.uniform(-180, 180), rng.uniform(0.2, 5.0), rng.uniform(20, 500)
    phase = rng.uniform(0, 6, size=2)
    amplitude = rng.uniform(0.01, 0.1, size=2)
    x, y = rng.uniform(10, 20, size=(2, 64))
    region = {
        "x_mm": [-1000, 1000],
        "y_mm": [5, 25],
        "gain": 0.7,
        "edge_fade_mm": 1.0,
        "texture": {
            "kind": "spectrum",
            "angle_deg": angle_deg,
            "components": [
                {"amplitude_n": amplitude[0], "cycles_per_mm": turns, "phase_rad": phase[0]},
                {"amplitude_n": amplitude[1], "hz": hz, "phase_rad": phase[1]},
            ],
        },
    }
    aside = {**region, "y_mm": [26, 30]}
    across = {**region, "y_mm": [float(y.mean()), 30]}
    friction, crossing = page.evaluate(
        """async ([regions, across, x, y]) => {
          const { friction, under } = await import("/target.js");
          const path = { x: Float64Array.from(x), y: Float64Array.from(y) };
          const over = under(regions, path);
          return [[...friction(over, path, 40, 2e-4, 20000, 0.5)], under([across], path)];
        }""",
        [[region, aside], across, x.tolist(), y.tolist()],
    )
    along = np.cos(np.deg2rad(angle_deg)) * x + np.sin(np.deg2rad(angle_deg)) * y
    time_s = 40 / 20_000 + 2e-4 * np.arange(64)
    expected = amplitude[0] * np.cos(2 * np.pi * turns * along + phase[0])
    expected += amplitude[1] * np.cos(2 * np.pi * hz * time_s + phase[1])
    np.testing.assert_allclose(friction, 0.35 * expected, atol=1e-12)
    assert crossing is None


def test_page_without_a_service_says_so(open_page: OpenPage, folder_url: str) -> None:
    with open_page(expected="WebSocket") as page:
        page.goto(f"{folder_url}/index.html")
        expect(page.locator("#connection")).to_contain_text("No connection to the service")
        expect(page.locator("#rig")).to_be_hidden()
        expect(page.locator("#stop")).to_be_visible()

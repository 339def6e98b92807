"""What has happened at a rig, and how fast its counters grow."""

from typing import Any

import pytest
from playwright.sync_api import Page

pytestmark = pytest.mark.browser


def _call(utc_ns: int, **clients: str) -> dict[str, Any]:
    made = {name: {"client": client, "utc_ns": utc_ns} for name, client in clients.items()}
    return {"last_calls": made}


LOG = """async (steps) => {
  const { EventLog, MOST } = await import("/live/event_log.js");
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
            {"utc_ns": 11} | _call(11, stop="ben.page-123456"),
            {"utc_ns": 11},
            {"utc_ns": 12, "state": "tripped", "fault": fault},
        ],
    )
    assert got == [
        "Tripped: sensor fault, no force||",
        "Stopped|ben|, nobody held it",
        "Stopped|you|, held by tester",
        "Losses, underruns: 2||",
        "Model put back, or set anew||",
        "Model adapted to the finger|the tracker|",
        "Policy: Adapt|ben|",
        "Compensation set to Off|tester|",
        "Armed|tester|",
    ]


def test_an_end_is_told_once_though_its_ramp_is_seen(page: Page) -> None:
    end = {"owner": "ben", "by": None, "reason": "the lease was not renewed", "utc_ns": 3}
    steps: list[dict[str, Any]] = [
        {"utc_ns": 1},
        {"utc_ns": 2, "state": "armed", "owner": "ben"},
        {"utc_ns": 3, "state": "stopping", "owner": None, "last_end": end},
        {"utc_ns": 4, "state": "disarmed"},
    ]
    got, _ = page.evaluate(LOG, steps)
    assert got == ["Disarmed: the lease was not renewed||, held by ben", "Armed|ben|"]


def test_a_mode_is_told_as_the_switch_calls_it(page: Page) -> None:
    fixed = {"mode": "fixed", "speed_mm_s": 60}
    steps = [
        {"utc_ns": 1},
        {"utc_ns": 2, "compensation": fixed} | _call(2, compensation="ann.page-ffffff"),
        {"utc_ns": 3, "compensation": {"mode": "model", "speed_mm_s": None}},
    ]
    got, _ = page.evaluate(LOG, steps)
    assert got == ["Compensation set to Model||", "Compensation set to Fixed 60 mm/s|you|"]


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
    def scene(name: str, source: str = "scene", regions: int = 1) -> dict[str, Any]:
        told = {"name": name, "regions": [{}] * regions}
        return {"scene_etag": name, "scene": {"etag": name, "source": source, "scene": told}}

    steps = [
        {"utc_ns": 1},
        {"utc_ns": 4, **scene("silk")} | _call(3, scene="ben.page-123456"),
        {"utc_ns": 9, **scene("waves", "stream")} | _call(6, open_stream="tester"),
        {"utc_ns": 12, **scene("silk")},
        {"utc_ns": 14, "scene_etag": "felt"},
        {"utc_ns": 15, "scene_etag": "vinyl", "late": scene("vinyl")["scene"]},
        {"utc_ns": 16, **scene("", regions=0)},
    ]
    got, _ = page.evaluate(LOG, steps)
    assert got == [
        "A smooth screen||",
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


def test_the_log_of_events_is_bounded(page: Page) -> None:
    steps = [{"utc_ns": i, "model_etag": str(i)} for i in range(400)]
    got, most = page.evaluate(LOG, steps)
    assert len(got) == most < 400


def test_counters_are_told_as_rates_of_the_last_minute_of_one_run(page: Page) -> None:
    got = page.evaluate(
        """async () => {
          const { CounterRates } = await import("/live/counter_rates.js");
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

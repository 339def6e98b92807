"""Who holds a rig, whom that keeps from what, and what its loop has lost."""

import pytest
from playwright.sync_api import Page

pytestmark = pytest.mark.browser


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
          const { nameOf } = await import("/rig/holder.js");
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
          const { takesRig } = await import("/rig/holder.js");
          return takesRig(before, { owner });
        }""",
        [before, owner],
    )
    assert got == taken


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
        (
            "local.experiment-0a1b2c3d",
            "An experiment holds rig1: wait until it is disarmed, or press STOP.",
        ),
    ],
)
def test_who_would_begin_is_told_what_to_do_about_the_holder(
    page: Page, owner: str | None, told: str
) -> None:
    got = page.evaluate(
        """async (owner) => {
          const { heldAlready } = await import("/rig/holder.js");
          return heldAlready("rig1", owner, "ann.page-0a1b2c");
        }""",
        owner,
    )
    assert got == told


def test_losses_are_news_only_where_a_counter_grew(page: Page) -> None:
    got = page.evaluate(
        """async () => {
          const { LOSSES, LoopLosses } = await import("/rig/loop_losses.js");
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


def test_a_choice_of_compensation_is_of_the_rig_that_was_shown(page: Page) -> None:
    asked = page.evaluate(
        """async () => {
          const { Compensation } = await import("/rig/compensation.js");
          document.body.insertAdjacentHTML("beforeend", `<div id="compensation">
            <p id="compensation-modes"><button value="none"></button>
              <button value="fixed"></button></p>
            <p id="compensation-outcome"></p></div>`);
          const { fetch } = window;
          const asked = [];
          const both = new Promise((resolve) => {
            window.fetch = (url, { body }) => {
              asked.push([url, JSON.parse(body)]);
              if (asked.length === 2) resolve();
              return new Promise((answer) => (window.answer = answer));
            };
          });
          const model = { validity: { speed_mm_s: [20, 100] } };
          const compensation = { mode: "model", speed_mm_s: null };
          const status = { state: "armed", owner: null, share_with: [], compensation };
          const shown = new Compensation();
          shown.show("rig1", status, true, "ann", model);
          for (const each of document.querySelectorAll("#compensation button")) each.click();
          shown.show("rig2", status, true, "ann", model);
          window.answer(new Response("{}"));
          await both;
          window.fetch = fetch;
          document.getElementById("compensation").remove();
          return asked;
        }"""
    )
    path = "/v1/rigs/rig1/compensation"
    assert asked == [[path, {"mode": "none"}], [path, {"mode": "fixed", "speed_mm_s": 60}]]

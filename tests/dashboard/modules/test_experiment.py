"""The pure modules of an experiment's pages: every screen, key and offer of one state."""

import re
from typing import Any, get_args

import pytest
from playwright.sync_api import Page, Route

from frictus.experiment.tasks import KEYS, Adjustment, Magnitude, SameDifferent, TwoAlternatives
from frictus.experiment.tasks import YesNo as YesNoTask
from frictus_service.experiments.job import GO_ON, ExperimentJob, ParticipantScreen, Phase
from frictus_service.job_folder import State

pytestmark = pytest.mark.browser

TASKS = (TwoAlternatives(), SameDifferent(), YesNoTask(), Magnitude(), Adjustment())
SHOWN = """async ([job, page]) => {
  const { screenOf } = await import("/participant/screen.js");
  return screenOf(job, page);
}"""
HERE = {"connected": True, "may": True}


def job(state: str = "running", task: Any = TASKS[0], **screen: Any) -> Any:
    """An experiment as the service sends it."""
    shown = ParticipantScreen(
        **{"phase": "question", "trial": 3, "step": 1, "intervals": 2} | screen
    )
    made = ExperimentJob(
        id="1-2",
        state=state,
        created_utc_ns=1,
        created_by="local",
        updated_utc_ns=1,
        rig="rig1",
        participant="P01",
        order_row=0,
        seed=1,
        protocol="detection",
        description="",
        task=task,
        planned=60,
        screen=shown if state == "running" else None,
    )
    return made.model_dump(mode="json")


@pytest.mark.parametrize("task", TASKS, ids=lambda task: task.kind)
def test_a_question_has_all_answers_of_its_task(page: Page, task: Any) -> None:
    shown = page.evaluate(SHOWN, [job(task=task), HERE])
    # Numbers are those of a keyboard; the page has buttons.
    assert shown["title"] == re.sub(r" \(\d\)", "", task.question)
    assert sorted(each["answer"] for each in shown["buttons"]) == sorted(KEYS[task.kind])
    assert (shown["number"] is not None) == (task.kind == "magnitude")
    keys = [key for each in shown["buttons"] for key in each["keys"]]
    assert len(set(keys)) == len(keys)
    assert "Escape" not in keys  # it stops
    assert " " not in keys
    for each in shown["buttons"]:
        for key in each["keys"]:
            given = page.evaluate(
                """async ([buttons, key]) =>
                  (await import("/participant/screen.js")).answerOf(buttons, key)""",
                [shown["buttons"], key],
            )
            assert given == each["answer"]


@pytest.mark.parametrize("phase", get_args(Phase))
def test_every_phase_has_words_and_shows_no_level(page: Page, phase: str) -> None:
    state = job(phase=phase, level=0.0123, unit="N", interval=2 * (phase == "interval"))
    shown = page.evaluate(SHOWN, [state, HERE])
    words = f"{shown['title']} {shown['text']}"
    assert shown["title"] != ""
    assert "0.01" not in words
    assert "undefined" not in words
    answers = [each["answer"] for each in shown["buttons"]]
    assert (answers == [GO_ON]) == (phase in ("ready", "break"))
    assert (answers != []) == (phase in ("ready", "break", "question"))
    looked = page.evaluate(SHOWN, [state, {"connected": True, "may": False}])
    assert looked["buttons"] == []
    assert looked["title"] == shown["title"]
    assert ("lacks the scope render" in looked["text"]) == (answers != [])
    lost = page.evaluate(SHOWN, [state, {"connected": False, "may": True}])
    assert lost["buttons"] == []
    assert "no connection" in lost["text"]


def test_where_no_rig_is_nothing_is_said_to_begin(page: Page) -> None:
    shown = [page.evaluate(SHOWN, [None, HERE | {"here": here}]) for here in (True, False)]
    assert "will begin here by itself" in shown[0]["text"]
    assert "is not there" in shown[1]["text"]


@pytest.mark.parametrize("state", get_args(State))
def test_every_state_has_words_and_what_may_be_done(page: Page, state: str) -> None:
    told = page.evaluate(
        """async ([job]) => {
          const { stateOf, offersOf } = await import("/experiment/words.js");
          return [stateOf(job), offersOf(job, true), Object.values(offersOf(job, false))];
        }""",
        [job(state)],
    )
    words, may, may_not = told
    assert words
    assert may["stop"] == (state in ("queued", "running"))
    assert may["resume"] == (state in ("interrupted", "failed", "cancelled"))
    assert may["pause"] == (state == "running")
    assert not any(may_not)
    shown = page.evaluate(SHOWN, [job(state), HERE])
    assert shown["title"]
    assert (shown["buttons"] != []) == (state == "running")


def test_a_pause_can_be_ended_before_it_begins(page: Page) -> None:
    told = page.evaluate(
        """async (jobs) => {
          const { offersOf } = await import("/experiment/words.js");
          return jobs.map((job) => [offersOf(job, true).pause, offersOf(job, true).goOn]);
        }""",
        [job(), job(pausing=True), job(phase="pause", pausing=True)],
    )
    assert told == [[True, False], [False, True], [False, True]]


def test_trials_that_the_rig_could_not_render_are_counted_while_it_runs(page: Page) -> None:
    told = page.evaluate(
        """async (jobs) => {
          const { progressOf } = await import("/experiment/words.js");
          return jobs.map(progressOf);
        }""",
        [job(answered=4), job(answered=4, refused=2)],
    )
    lost = "; 2 not presented: the rig cannot render them whole"
    assert told == ["4 of 60 trials answered", f"4 of 60 trials answered{lost}"]


def test_after_a_reconnection_an_experiment_is_followed_anew(page: Page) -> None:
    listed = {"experiments": [job()], "ready": []}
    page.route("**/v1/experiments?*", lambda route: route.fulfill(json=listed))
    page.route("**/events", lambda _route: None)  # a connection that hangs
    with page.expect_request("**/events"):
        page.evaluate(
            """async () => {
              const { View } = await import("/participant/view.js");
              const link = Object.assign(new EventTarget(), { state: "open", quiet: false });
              const seen = { link, state: { status: null }, can: () => true };
              window.view = new View(document.createElement("section"), seen);
              window.view.open("rig1");
            }"""
        )
    with page.expect_request("**/events", timeout=5_000):
        page.evaluate("window.view.open('rig1')")  # as the page does when it is let in again
    page.evaluate("window.view.close()")
    page.unroute_all()


def test_what_is_not_listed_is_told(page: Page) -> None:
    trials = {"trials": [], "left_out": 37, "conditions": []}
    listed = {"experiments": [job("done")] * 2, "more": True, "ready": []}
    page.route("**/report", lambda route: route.fulfill(json=trials))
    page.route("**/v1/experiments?*", lambda route: route.fulfill(json=listed))
    told = page.evaluate(
        """async () => {
          const { Results } = await import("/experiment/results.js");
          const { View } = await import("/experiment/view.js");
          const results = new Results();
          await results.read("1-2");
          const link = Object.assign(new EventTarget(), { state: "open", welcome: null });
          const place = document.createElement("section");
          const view = new View(place, { link, state: { status: null }, can: () => false });
          view.open("rig1", []);
          const listed = () => place.textContent.includes("P01");
          while (!listed()) await new Promise((go) => setTimeout(go, 10));
          return [results.root.textContent, place.textContent];
        }"""
    )
    assert "; 37 older ones stand in the table of events" in told[0]
    assert "The newest 2 are listed; there are older ones." in told[1]
    page.unroute_all()


def test_an_experiment_is_started_once(page: Page) -> None:
    asked: list[Route] = []
    page.route("**/v1/experiments", lambda route: asked.append(route))  # no answer yet
    with page.expect_request("**/v1/experiments"):
        states = page.evaluate(
            """async () => {
              const { Setup } = await import("/experiment/setup.js");
              const setup = new Setup(({ id }) => (window.begun = id));
              const task = { question: "?" };
              setup.offer([{ name: "detection", description: "", planned: 1, task }]);
              setup.order.value = "0";
              const states = [];
              const look = () => states.push([setup.begin.disabled, setup.holder.textContent]);
              setup.show("rig1", "ben.page-0a1b2c", "ann.page-ffffff");
              look();
              setup.show("rig2", null, "ann.page-ffffff");
              look();
              setup.root.dispatchEvent(new Event("submit", { cancelable: true }));
              setup.show("rig2", null, "ann.page-ffffff"); // a status, each second
              look();
              return states;
            }"""
        )
    while not asked:  # its route is told after the request, and only while the page is asked
        page.evaluate("0")
    asked[0].fulfill(status=201, json=job("queued"))
    page.wait_for_function("window.begun === '1-2'")
    page.unroute_all()
    held = "ben holds rig1: wait until it is disarmed, or press STOP."
    assert states == [[True, held], [False, ""], [True, ""]]

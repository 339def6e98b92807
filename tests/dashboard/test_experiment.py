"""The experimenter's and the participant's page: experiments by clicks and keys alone."""

import json
import os
import re
import signal
import sys
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Locator, Page, expect
from tests.dashboard.conftest import OpenPage
from tests.dashboard.lab import WIDTHS, Lab, enter, expect_no_violations, read_only, running
from tests.dashboard.participants import (
    TRIAL_MS,
    answering,
    asked,
    expect_kind,
    expect_waiting,
    participant,
)
from tests.dashboard.short_protocols import DETECTION, TRIALS, brief

from frictus.experiment import SimulatedObserver, fit, read_log
from frictus_hardware import SimulatedConfig
from frictus_hardware.simulated.strokes import SteadyStrokes

pytestmark = [pytest.mark.browser, pytest.mark.timeout(600)]

BEGUN_MS = 60_000
OBSERVER = SimulatedObserver(jnd_db=1.21, floor_n=0.005, lapse=0.0)


@pytest.fixture(scope="module")
def lab(browser: object, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Lab]:
    """A daemon whose finger slides without end."""
    backend = SimulatedConfig(finger=SteadyStrokes(speed_mm_s=60.0), lead_ms=60.0)
    with running(tmp_path_factory.mktemp("lab"), backend=backend) as lab:
        yield lab


@pytest.fixture(autouse=True)
def nothing_is_left(lab: Lab) -> Iterator[None]:
    """The next test finds the rig free, whatever became of this one."""
    yield
    for each in lab.ask("GET", "/experiments")["experiments"]:
        if each["state"] in ("queued", "running"):
            with suppress(urllib.error.HTTPError):  # 409: it has just ended
                lab.ask("DELETE", f"/experiments/{each['id']}")
            with urllib.request.urlopen(
                f"{lab.url}/v1/experiments/{each['id']}/events", timeout=30.0
            ) as events:
                events.read()


@pytest.fixture
def experimenter(lab: Lab, open_page: OpenPage) -> Iterator[Page]:
    with open_page() as page:
        page.goto(lab.url)
        expect(page.locator("#connection")).to_have_text("Live")
        page.get_by_role("link", name="Experiment", exact=True).click()
        expect(page.get_by_role("heading", name="A new experiment")).to_be_visible()
        yield page


def test_of_an_experiment_that_is_none_nothing_is_offered(
    lab: Lab, open_page: OpenPage
) -> None:
    with open_page(expected="404") as page:
        page.goto(f"{lab.url}/dashboard/#/experiment/rig1/20991231-000000-deadbeef")
        view = page.locator("#view-experiment")
        expect(view).to_contain_text("no experiment '20991231-000000-deadbeef'")
        for name in ("Pause", "Stop the experiment", "Arm the rig and go on"):
            expect(view.get_by_role("button", name=name, exact=True)).to_be_hidden()


@pytest.fixture
def tablet(lab: Lab, open_page: OpenPage) -> Iterator[Page]:
    with open_page() as page:
        page.goto(f"{lab.url}/dashboard/#/participant/rig1")
        expect_waiting(page)
        yield page


def start(page: Page, toml: str, who: str, folder: Path) -> None:
    path = folder / f"{who}.toml"
    path.write_text(toml, encoding="utf-8")
    page.get_by_label("Protocol").select_option(label="A TOML file of yours")
    page.get_by_label("TOML file", exact=True).set_input_files(path)
    page.get_by_label("Participant").fill(who)
    page.get_by_role("button", name="Arm the rig and start").click()
    expect(page.get_by_role("heading", name=re.compile(f"^brief, {who}, "))).to_be_visible()


def state(page: Page) -> Locator:
    return page.locator("#view-experiment [role=status].summary")


def press(page: Page, name: str) -> None:
    asked(page).get_by_role("button", name=name).click()


def log_of(lab: Lab, who: str) -> list[dict[str, Any]]:
    """The rows of the log of a participant's experiment."""
    jobs = lab.ask("GET", "/experiments")["experiments"]
    (job,) = [each["id"] for each in jobs if each["participant"] == who]
    rows, _ = read_log(lab.config.studies / "experiments" / job / "trials.jsonl")
    return rows


def answered(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    return [row for row in rows if row.get("status") == "answered"]


@pytest.mark.long
def test_a_threshold_by_clicks_of_who_feels_the_friction(
    experimenter: Page, tablet: Page, lab: Lab, rng: np.random.Generator, tmp_path: Path
) -> None:
    start(experimenter, DETECTION, "P01", tmp_path)
    expect(asked(tablet).get_by_role("heading")).to_have_text(
        "Are you ready?", timeout=BEGUN_MS
    )
    lab.status(lambda status: status.state == "armed")
    expect(state(experimenter)).to_have_text("Running")
    expect(experimenter.locator("#owner")).to_have_text("Held by an experiment")
    with participant(tablet, lab.rig, OBSERVER, rng) as person:
        press(tablet, "Begin")
        person.answer()  # of practice
        for number in range(1, TRIALS + 1):
            person.answer()
            if number < TRIALS:
                count = experimenter.get_by_text(f"{number} of {TRIALS} trials")
                expect(count).to_be_visible(timeout=TRIAL_MS)
    expect(asked(tablet).get_by_role("heading")).to_have_text("Thank you", timeout=TRIAL_MS)
    expect(state(experimenter)).to_have_text("Done", timeout=TRIAL_MS)
    lab.status(lambda status: status.state == "disarmed")

    rows = answered(log_of(lab, "P01"))
    assert [row["response"] for row in rows] == person.answers
    assert sum(row["phase"] == "main" for row in rows) == TRIALS
    assert len(person.missed) <= TRIALS // 2
    main = [row for k, row in enumerate(rows) if k not in person.missed and k > 0]
    # Friction was felt, not guessed: what is far above the threshold is told rightly.
    clear = [row for row in main if row["level_rendered"] > 8.0 * OBSERVER.detection_n]
    assert all(row["correct"] for row in clear)
    found = fit(
        [row["level_rendered"] for row in main],
        [row["positive"] for row in main],
        0.5,
        confidence=0.999,
    )
    assert found.threshold.holds(OBSERVER.detection_n * np.sqrt(2.0))  # amplitude of a sine

    said = re.compile(r"^Threshold 0\.0\d+ N .*\(95 %: 0\.\d+ to 0\.\d+\)$")
    expect(experimenter.locator("#view-experiment figure .summary")).to_have_text(said)
    trials = experimenter.get_by_role("table", name="The newest trials first")
    expect(trials.locator("tbody tr")).to_have_count(TRIALS + 1)
    with experimenter.expect_download() as saved:
        experimenter.get_by_role("button", name="Save the table of events").click()
    table = Path(saved.value.path()).read_text("utf-8").splitlines()
    assert table[0].startswith("onset\tduration")
    assert len(table) == TRIALS + 2
    expect_no_violations(experimenter, WIDTHS)
    experimenter.reload()
    expect(experimenter.locator("#view-experiment figure .summary")).to_have_text(said)


def worker_of(lab: Lab) -> int:
    """The process of the experiment that runs."""
    threads = Path(f"/proc/{lab.supervisor.pid_of('api')}/task")
    children = [pid for each in threads.glob("*/children") for pid in each.read_text().split()]
    (found,) = [
        int(pid)
        for pid in children
        if b"jobs.worker" in Path(f"/proc/{pid}/cmdline").read_bytes()
    ]
    return found


def trial_shown(page: Page) -> str:
    """What the experimenter reads of the trial under way, but for its phase."""
    told = page.get_by_text(re.compile(r"^Trial \d+, ")).inner_text()
    return told.partition(":")[0]


def heading(page: Page) -> Any:
    return asked(page).get_by_role("heading")


def answer_by_key(page: Page, key: str) -> None:
    with answering(page):
        page.keyboard.press(key)


@pytest.mark.skipif(sys.platform != "linux", reason="looks the process up in /proc")
def test_a_kill_and_a_reload_lose_nothing(
    experimenter: Page, tablet: Page, lab: Lab, tmp_path: Path
) -> None:
    start(experimenter, brief("2afc"), "P02", tmp_path)
    expect_kind(tablet, "ready")
    tablet.keyboard.press("Enter")
    answer_by_key(tablet, "ArrowRight")
    expect_kind(tablet, "question")
    tablet.reload()
    expect_kind(tablet, "question")
    experimenter.reload()
    expect(state(experimenter)).to_have_text("Running")
    expect(experimenter.get_by_text("1 of 3 trials answered")).to_be_visible()
    before = trial_shown(experimenter)
    assert before.startswith("Trial 2, ridges, ")

    os.kill(worker_of(lab), signal.SIGKILL)
    expect(state(experimenter)).to_have_text("Interrupted: it can go on", timeout=BEGUN_MS)
    expect(asked(tablet)).to_contain_text("nothing is lost", timeout=BEGUN_MS)
    lab.status(lambda status: status.state == "disarmed")  # its lease ran out
    experimenter.get_by_role("button", name="Arm the rig and go on").click()
    expect_kind(tablet, "ready")
    tablet.keyboard.press("Enter")
    expect_kind(tablet, "question")
    assert trial_shown(experimenter) == before
    answer_by_key(tablet, "1")

    # A pause comes before the next trial, and is the experimenter's to end.
    expect_kind(tablet, "question")
    experimenter.get_by_role("button", name="Pause").click()
    expect(experimenter.get_by_role("button", name="Go on", exact=True)).to_be_visible()
    answer_by_key(tablet, "2")
    expect(heading(tablet)).to_have_text("Thank you", timeout=TRIAL_MS)
    expect(state(experimenter)).to_have_text("Done")
    rows = answered(log_of(lab, "P02"))
    assert [row["response"] for row in rows] == ["2", "1", "2"]


def test_a_pause_and_a_stop(experimenter: Page, tablet: Page, lab: Lab, tmp_path: Path) -> None:
    start(experimenter, brief("yes-no", "Did you feel it?"), "P03", tmp_path)
    expect_kind(tablet, "ready")
    experimenter.get_by_role("button", name="Pause").click()
    press(tablet, "Begin")
    expect(heading(tablet)).to_have_text("A short pause", timeout=TRIAL_MS)
    expect(asked(tablet).get_by_role("button")).to_have_count(0)
    expect(state(experimenter)).to_have_text("Paused")
    experimenter.get_by_role("button", name="Go on", exact=True).click()
    expect_kind(tablet, "question")
    expect(heading(tablet)).to_have_text("Did you feel it?")
    # The participant may stop at any time, and the experimenter reads who did.
    tablet.get_by_role("button", name="STOP").click()
    lab.status(lambda status: status.state == "disarmed")
    expect(state(experimenter)).to_have_text("Ended early: it can go on", timeout=BEGUN_MS)
    expect(experimenter.locator("#view-experiment [role=alert]")).to_contain_text("stopped")
    expect(heading(tablet)).to_have_text("Please wait")

    experimenter.set_viewport_size({"width": 1440, "height": 900})
    whole = "() => { const { scrollWidth, clientWidth } = document.querySelector('.holder');"
    experimenter.wait_for_function(f"{whole} return scrollWidth <= clientWidth; }}")

    experimenter.get_by_role("button", name="Arm the rig and go on").click()
    expect_kind(tablet, "ready")
    tablet.keyboard.press("Enter")  # the button that stopped it has not kept the keys
    answer_by_key(tablet, "y")
    expect_kind(tablet, "question")
    experimenter.get_by_role("button", name="Stop the experiment").click()
    expect(state(experimenter)).to_have_text("Stopped: it can go on", timeout=BEGUN_MS)
    expect(heading(tablet)).to_have_text("Thank you")
    assert [row["response"] for row in answered(log_of(lab, "P03"))] == ["y"]


def test_practice_is_seen_as_it_is_answered(
    experimenter: Page, tablet: Page, tmp_path: Path
) -> None:
    there = experimenter.get_by_role("link", name="a page of their own")
    expect(there).to_have_attribute("href", "#/participant/rig1")
    start(experimenter, brief("yes-no", practice=1), "P08", tmp_path)
    expect_kind(tablet, "ready")
    listed = experimenter.get_by_role("table", name="The newest first").locator("tbody tr")
    expect(listed.first).to_contain_text("Running")
    press(tablet, "Begin")
    answer_by_key(tablet, "y")
    expect_kind(tablet, "question")
    expect(experimenter.get_by_text("0 of 3 trials answered")).to_be_visible()
    trials = experimenter.get_by_role("table", name="The newest trials first")
    expect(trials.locator("tbody tr")).to_have_count(1)


def test_the_page_of_no_rig_says_so(lab: Lab, open_page: OpenPage) -> None:
    with open_page() as page:
        page.add_init_script(
            "Object.defineProperty(Document.prototype, 'fullscreenEnabled', { value: false })"
        )
        page.goto(f"{lab.url}/dashboard/#/participant/rig9")
        expect(asked(page)).to_contain_text("The device is not there")
        # A phone may have no full screen to offer.
        expect(page.get_by_role("button", name="Full screen")).to_be_hidden()


def test_numbers_and_settings(
    experimenter: Page, tablet: Page, lab: Lab, tmp_path: Path
) -> None:
    start(experimenter, brief("magnitude", "How strong?"), "P04", tmp_path)
    expect_kind(tablet, "ready")
    press(tablet, "Begin")
    for number in ("3", "12.5", "40"):
        with answering(tablet):
            expect(asked(tablet).get_by_label("Your number")).to_be_focused()
            tablet.keyboard.type(number)
            tablet.keyboard.press("Enter")
    expect(heading(tablet)).to_have_text("Thank you", timeout=TRIAL_MS)
    rows = answered(log_of(lab, "P04"))
    assert [float(row["response"]) for row in rows] == [3.0, 12.5, 40.0]

    experimenter.get_by_role("link", name="Experiment", exact=True).click()
    start(experimenter, brief("adjustment", "Alike?"), "P05", tmp_path)
    expect_kind(tablet, "ready")
    press(tablet, "Begin")
    for key in ("ArrowUp", "ArrowUp", "ArrowDown", "Enter"):
        answer_by_key(tablet, key)
    press_when_asked(tablet, "Weaker")
    press_when_asked(tablet, "Done")
    press_when_asked(tablet, "Done")
    expect(heading(tablet)).to_have_text("Thank you", timeout=TRIAL_MS)
    rows = answered(log_of(lab, "P05"))
    assert [len(row["settings"]) for row in rows] == [4, 2, 1]
    expect(experimenter.locator("#view-experiment figure .summary")).to_contain_text("N (95 %")


def press_when_asked(page: Page, name: str) -> None:
    with answering(page):
        press(page, name)


def test_who_may_only_look_sees_no_buttons(
    experimenter: Page, lab: Lab, open_page: OpenPage, tmp_path: Path
) -> None:
    start(experimenter, brief("2afc"), "P06", tmp_path)
    expect(experimenter.get_by_text(re.compile("asked to begin"))).to_be_visible(
        timeout=BEGUN_MS
    )
    job = lab.ask("GET", "/experiments?limit=1")["experiments"][0]["id"]
    # Another server knows of no experiment that runs here; what it has in its folder it shows.
    with read_only(lab, studies=tmp_path / "studies") as url, open_page() as reader:
        enter(reader, f"{url}#/experiment/rig1")
        expect(reader.get_by_text("takes a token with the scope calibrate")).to_be_visible()
        for name in ("Start", "Stop the", "Pause", "Go on", "Arm the rig"):
            expect(reader.get_by_role("button", name=name)).to_have_count(0)
        shown = lab.ask("GET", f"/experiments/{job}")
        reader.route(
            "**/v1/experiments?*",
            lambda route: route.fulfill(
                json={
                    "experiments": [shown],
                    "ready": [],
                }
            ),
        )
        reader.route(
            "**/v1/experiments/*/events",
            lambda route: route.fulfill(
                body=f"event: state\nid: 1\ndata: {json.dumps(shown)}\n\n",
                headers={"Content-Type": "text/event-stream"},
            ),
        )
        reader.goto(f"{url}#/participant/rig1")
        expect(heading(reader)).to_have_text("Are you ready?")
        expect(asked(reader).get_by_role("button")).to_have_count(0)
        expect(reader.get_by_role("button", name="STOP")).to_be_visible()


@pytest.mark.parametrize("width", WIDTHS)
def test_both_pages_keep_nobody_out(
    width: int, experimenter: Page, lab: Lab, open_page: OpenPage, tmp_path: Path
) -> None:
    who = f"W{width}"
    with open_page(viewport={"width": width, "height": 900}) as tablet:
        tablet.goto(f"{lab.url}/dashboard/#/participant/rig1")
        expect(heading(tablet)).to_be_visible()
        expect_no_violations(tablet)
        experimenter.set_viewport_size({"width": width, "height": 900})
        start(experimenter, brief("2afc", practice=1), who, tmp_path)
        expect_kind(tablet, "ready")
        expect_no_violations(tablet)
        press(tablet, "Begin")
        expect_kind(tablet, "question")
        for page in (tablet, experimenter):
            expect_no_violations(page)
            assert page.evaluate("document.documentElement.scrollWidth") <= width
        # Nothing but the question, two buttons, the stop and a way to the full screen.
        names = tablet.get_by_role("button").all_inner_texts()
        assert [name.split("\n")[0] for name in names] == [
            "STOP",
            "First",
            "Second",
            "Full screen",
        ]
        for button in asked(tablet).get_by_role("button").all():
            box = button.bounding_box()
            assert box is not None
            assert box["height"] >= 100
            assert box["width"] >= 150
        tablet.get_by_role("button", name="Full screen").click()
        expect(tablet.get_by_role("button", name="Full screen")).to_be_hidden()
        press(tablet, "First")
        expect(heading(tablet)).to_have_text(re.compile("^(Not r|R)ight$"))
        expect_kind(tablet, "question")
        answer_by_key(tablet, "1")
        expect(experimenter.locator("#view-experiment figure")).to_be_visible()
        expect_no_violations(experimenter)
        assert experimenter.evaluate("document.documentElement.scrollWidth") <= width


def test_a_tablet_without_a_connection_says_so(lab: Lab, open_page: OpenPage) -> None:
    with open_page(expected="ERR_") as tablet:
        tablet.route_web_socket("**/v1/live", lambda socket: socket.close())
        tablet.goto(f"{lab.url}/dashboard/#/participant/rig1")
        expect(asked(tablet)).to_contain_text("There is no connection at the moment")
        expect(tablet.get_by_role("button", name="STOP")).to_be_visible()

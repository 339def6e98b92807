"""The experimenter's and the participant's page: experiments by clicks and keys alone."""

import re
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
from tests.dashboard.lab import Lab, expect_no_violations, running
from tests.dashboard.participants import (
    TRIAL_MS,
    asked,
    expect_kind,
    expect_waiting,
    participant,
)

from frictus.experiment import SimulatedObserver, fit, read_log
from frictus_hardware import SimulatedConfig
from frictus_hardware.simulated.strokes import SteadyStrokes

pytestmark = [pytest.mark.browser, pytest.mark.timeout(600)]

BEGUN_MS = 60_000
TRIALS = 12
OBSERVER = SimulatedObserver(jnd_db=1.21, floor_n=0.005, lapse=0.0)
TOML = """
name = "brief"
description = "A few trials."
[task]
kind = "{task}"
question = "{question}"
[procedure]
{procedure}
[conditions.ridges]
kind = "amplitude"
texture = {{ kind = "spectrum", components = [{{ amplitude_n = 1.0, cycles_per_mm = 1.0 }}] }}
[presentation]
interval_s = {interval_s}
gap_s = {gap_s}
fade_s = 0.05
[design]
practice = {practice}
"""
DETECTION = TOML.format(
    task="2afc",
    question="Which had a texture?",
    procedure=f'kind = "quest+"\nlevels = {{ low = 0.0005, high = 0.08, count = 31 }}\n'
    f"trials = {TRIALS}",
    interval_s=1.0,
    gap_s=0.5,
    practice=1,
)


def brief(task: str, question: str = "Well?", practice: int = 0) -> str:
    """The TOML of three short trials."""
    return TOML.format(
        task=task,
        question=question,
        procedure='kind = "constant"\nlevels = [0.01, 0.02, 0.04]\nrepeats = 1',
        interval_s=0.2,
        gap_s=0.05,
        practice=practice,
    )


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


def test_a_threshold_by_clicks_of_who_feels_the_friction(
    experimenter: Page, tablet: Page, lab: Lab, rng: np.random.Generator, tmp_path: Path
) -> None:
    start(experimenter, DETECTION, "P01", tmp_path)
    expect(asked(tablet).get_by_role("heading")).to_have_text(
        "Are you ready?", timeout=BEGUN_MS
    )
    lab.status(lambda status: status.state == "armed")
    expect(state(experimenter)).to_have_text("Running")
    expect(experimenter.locator("#owner")).to_contain_text("experiment-")
    with participant(tablet, lab, OBSERVER, rng) as person:
        press(tablet, "Begin")
        given = [person.answer()]
        expect_kind(tablet, "feedback", "interval", "wait", "question")  # of practice
        for number in range(1, TRIALS + 1):
            given.append(person.answer())
            expect(experimenter.get_by_text(f"{number} of {TRIALS} trials")).to_be_visible(
                timeout=TRIAL_MS
            ) if number < TRIALS else None
    expect(asked(tablet).get_by_role("heading")).to_have_text("Thank you", timeout=TRIAL_MS)
    expect(state(experimenter)).to_have_text("Done", timeout=TRIAL_MS)
    lab.status(lambda status: status.state == "disarmed")

    rows = answered(log_of(lab, "P01"))
    assert [row["response"] for row in rows] == given
    main = [row for row in rows if row["phase"] == "main"]
    assert len(main) == TRIALS
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
    expect_no_violations(experimenter)
    experimenter.reload()
    expect(experimenter.locator("#view-experiment figure .summary")).to_have_text(said)

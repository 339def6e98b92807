"""The view of calibrations in a browser: a participant is calibrated by clicks alone."""

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

import pytest
from playwright.sync_api import Locator, Page, expect
from tests.dashboard.conftest import OpenPage
from tests.dashboard.lab import WIDTHS, Lab, enter, expect_no_violations, read_only, running

from frictus_hardware import SimulatedConfig
from frictus_hardware.simulated.config import SimulatedParticipant
from frictus_hardware.simulated.guided import GuidedStrokes
from frictus_service.calibration.job import FOR_DISCOVERY, PaperProtocol, QuickProtocol
from frictus_service.config import (
    RegistryConfig,
)

pytestmark = [pytest.mark.browser, pytest.mark.timeout(300)]

FASTER = 4.0
STRANGER = SimulatedParticipant(cutoff_0_hz=0.6 * 385.68, slope_hz_per_mm_s=0.6 * 13.811)
"""40 % off the population."""
BRIEF = {
    "Speeds, mm/s": "30, 90",
    "Forces, N": "0.4",
    "Precision, %": "10",
    "Longest recording, s": "30",
    "Approach, s": "1.4",
    "Recorded, s": "2",
}
ENDLESS = {**BRIEF, "Precision, %": "0.01", "Longest recording, s": "7000"}
BEGUN_MS = 30_000
"""Each calibration is a process of its own, which imports numpy and scipy first."""
GUIDED_MS = 120_000
"""What judges trials is compiled before the first, where it never was."""
DONE_MS = 90_000


def end(lab: Lab, calibration: str) -> None:
    """Cancel a calibration that a failed test has left, and wait for its end."""
    path = f"{lab.url}/v1/calibrations/{calibration}"
    with suppress(urllib.error.HTTPError):  # 409: it has just ended
        urllib.request.urlopen(urllib.request.Request(path, method="DELETE"), timeout=20.0)
    with urllib.request.urlopen(f"{path}/events", timeout=20.0) as events:
        events.read()


@pytest.fixture(scope="module")
def lab(browser: object, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Lab]:
    """A daemon whose finger follows guidance, faster than time.

    It acts on it only after the shortest approach (the lead and 0.25 s), so that a trial with
    no longer one is rejected on however quick a machine.
    """
    folder = tmp_path_factory.mktemp("lab")
    backend = SimulatedConfig(
        finger=GuidedStrokes(reaction_s=0.6), participant=STRANGER, clock=FASTER, lead_ms=240.0
    )
    with running(folder, backend=backend, block_ms=40.0) as lab:
        yield lab


@pytest.fixture(autouse=True)
def nothing_is_left(lab: Lab) -> Iterator[None]:
    """The next test finds the rig free, whatever became of this one."""
    yield
    for each in lab.ask("GET", "/calibrations?limit=10")["calibrations"]:
        if each["state"] in ("queued", "running"):
            end(lab, each["id"])


@pytest.fixture
def page(lab: Lab, open_page: OpenPage) -> Iterator[Page]:
    with open_page() as page:
        arrive(page, lab)
        yield page


def arrive(page: Page, lab: Lab) -> None:
    page.goto(lab.url)
    expect(page.locator("#connection")).to_have_text("Live")
    page.evaluate("window.loadedOnce = true")
    page.get_by_role("link", name="Calibrate").click()
    expect(page.get_by_role("heading", name="A new calibration")).to_be_visible()


def fill_in(page: Page, participant: str, settings: dict[str, str]) -> None:
    page.get_by_label("Participant").fill(participant)
    if settings and not page.locator("details[open] fieldset").count():
        page.get_by_text("Settings", exact=True).click()
    for label, value in settings.items():
        page.get_by_label(label).locator("visible=true").fill(value)


def start(page: Page, participant: str, settings: dict[str, str]) -> None:
    fill_in(page, participant, settings)
    page.get_by_role("button", name="Start").click()
    expect_shown(page, participant)


def expect_shown(page: Page, participant: str) -> None:
    expect(page.get_by_role("heading", name=re.compile(f"^{participant}, "))).to_be_visible()


def state(page: Page) -> Locator:
    return page.locator("#view-calibrate [role=status].summary")


def expect_running(page: Page) -> None:
    # "Getting ready" before, while what judges trials is compiled where it never was.
    expect(state(page)).to_have_text("Running", timeout=GUIDED_MS)


def cancel(page: Page) -> None:
    page.get_by_role("button", name="Cancel").click()
    expect_cancelled(page)


def expect_cancelled(page: Page) -> None:
    expect(state(page)).to_contain_text("Cancelled", timeout=BEGUN_MS)
    expect(page.locator(".guidance")).to_be_hidden()


def let_pass(page: Page, seconds: float) -> None:
    """Put a page's clock forward."""
    page.evaluate(
        """(ms) => {
          const now = performance.now.bind(performance);
          performance.now = () => now() + ms;
        }""",
        1e3 * seconds,
    )


def painted(page: Page) -> bool:
    drawn: bool = page.evaluate(
        """() => {
          const canvas = document.querySelector(".guidance canvas");
          const { data } = canvas.getContext("2d").getImageData(
            0, 0, canvas.width, canvas.height);
          return data.some((value) => value > 0);
        }"""
    )
    return drawn


def note_all_words(page: Page) -> None:
    """Keep whatever the state and the guidance say, however short, in `window.said`."""
    page.evaluate(
        """() => {
          window.said = [];
          const note = () => {
            for (const each of [".summary[role=status]", ".guidance"]) {
              window.said.push(document.querySelector(`#view-calibrate ${each}`).textContent);
            }
          };
          const all = { subtree: true, childList: true, characterData: true };
          new MutationObserver(note).observe(document.querySelector("#view-calibrate"), all);
        }"""
    )


@pytest.mark.long
def test_from_the_first_click_to_the_active_model(page: Page, lab: Lab) -> None:
    note_all_words(page)
    start(page, "P01", BRIEF)
    expect(page.get_by_role("heading", name="P01, quick protocol")).to_be_visible()
    expect_running(page)
    guidance = page.locator(".guidance")
    expect(guidance.get_by_text(re.compile("^Slide at (30|90) mm/s$"))).to_be_visible(
        timeout=GUIDED_MS
    )
    expect(guidance.get_by_text(re.compile(r"^You: \d+ mm/s$"))).to_be_visible()
    expect(guidance.get_by_text("Press with 0.40 N", exact=True)).to_be_visible()
    yours = re.compile(r"^You: 0\.\d\d N, (good|press harder|press more lightly)$")
    expect(guidance.get_by_text(yours)).to_be_visible()
    assert painted(page)
    expect_no_violations(page)
    expect(page.locator(".readings")).to_contain_text("s of 30 s at most")

    expect(state(page)).to_have_text("Done", timeout=DONE_MS)
    expect(guidance).to_be_hidden()
    said = " ".join(page.evaluate("window.said"))
    assert "All trials are done, the finger may go; the model is being estimated" in said
    assert "Thank you, P01: you may take your finger away" in said
    next_step = page.locator("#view-calibrate .next")
    expect(next_step).to_contain_text("Next: Publish, then Activate here")
    expect(page.locator("#view-calibrate .advice p")).to_have_count(3)
    (calibration,) = lab.ask("GET", "/calibrations?participant=P01")["calibrations"]
    expect(page).to_have_url(re.compile(f"#/calibrate/rig1/{calibration['id']}$"))
    protocol = calibration["spec"]["protocol"]
    assert (protocol["speeds_mm_s"], protocol["precision"]) == ([30.0, 90.0], 0.1)
    expect_result(page, calibration["result"])
    expect_no_violations(page, WIDTHS)

    page.get_by_label("Comment").fill("by clicks alone")
    page.get_by_role("button", name="Publish").click()
    told = page.locator("#view-calibrate")
    expect(told).to_contain_text("Published as rig1/P01@1")
    expect(told).to_contain_text("rig1 applies a placeholder.")
    expect(next_step).to_have_text("Next: Activate on rig1, here.")
    expect(page.get_by_role("table", name="The newest first")).to_contain_text("rig1/P01@1")
    page.get_by_role("button", name="Activate on rig1").click()
    expect(told).to_contain_text("rig1 confirmed rig1/P01@1 as published.")
    expect(told).to_contain_text("rig1 applies this version.")
    expect(next_step).to_contain_text("rig1 renders for this finger now")
    version = lab.ask("GET", "/models/rig1/P01@1")
    assert (version["comment"], version["calibration"]) == (
        "by clicks alone",
        calibration["id"],
    )
    assert lab.rig.model().etag == version["etag"]
    expect(page.locator("#force .words")).to_have_text("Measured at 0.4 N only")
    # Everything is there again for who comes later.
    page.reload()
    expect(told).to_contain_text("rig1 applies this version.")
    expect_result(page, calibration["result"])


def expect_result(page: Page, result: Any) -> None:
    rows = page.get_by_role("table", name="Cutoff at the speeds").locator("tbody tr")
    expect(rows).to_have_count(len(result["details"]["cutoff_hz"]))
    for index, found in enumerate(result["details"]["cutoff_hz"]):
        row, half = rows.nth(index), found["half_width"] * found["value"]
        expect(row.locator("th")).to_have_text(f"{found['speed_mm_s']:g}")
        told = [float(text) for text in re.findall(r"[\d.]+", row.inner_text())]
        expected = [
            found["value"],
            found["value"] - half,
            found["value"] + half,
            100.0 * found["half_width"],
        ]
        assert told[1:] == pytest.approx(expected, abs=0.51)
    gain = result["model"]["base"]["gain_n"]
    half = 1.959964 * result["model"]["covariance"]["matrix"][0][0] ** 0.5
    text = page.get_by_role("row", name="Gain, N").inner_text()
    told = [float(number) for number in re.findall(r"[\d.]+", text)]
    assert told == pytest.approx([gain, gain - half, gain + half], abs=6e-4)
    for note in result["notes"]:
        expect(page.locator("#view-calibrate")).to_contain_text(note)
    expect_diagnostics(page, result["details"]["diagnostics"])


def expect_diagnostics(page: Page, found: Any) -> None:
    told = page.locator("#view-calibrate .diagnostics")
    expect(told).to_contain_text(f"The fit leaves {found['residual_db']:.2f} dB (rms)")
    expect(told).to_contain_text("held out" if found["held_out"] is None else "has not seen")
    drawn = told.get_by_role("img")
    expect(drawn).to_have_attribute("data-points", str(len(found["points"])))  # two speeds
    told.get_by_text("As a table", exact=True).click()
    rows = told.get_by_role("table").locator("tbody tr")
    expect(rows).to_have_count(len(found["points"]))
    for row, point in zip(rows.all(), found["points"], strict=True):
        expect(row).to_contain_text(f"{point['magnitude_n']:.4f}")
    told.get_by_text("As a table", exact=True).click()


def test_one_at_a_time_and_cancelled(lab: Lab, open_page: OpenPage) -> None:
    with open_page(expected="409") as page:
        arrive(page, lab)
        fill_in(page, "P02", {})
        page.get_by_label("Participant").press("Enter")
        expect_shown(page, "P02")
        # Fields that nobody touched ask for what the service does by itself.
        (calibration,) = lab.ask("GET", "/calibrations?participant=P02")["calibrations"]
        asked = QuickProtocol.model_validate(calibration["spec"]["protocol"])
        assert asked == QuickProtocol()
        fill_in(page, "P03", {})
        page.get_by_role("button", name="Start").press("Space")
        expect(page.get_by_text("Not started: ")).to_contain_text("is under way on rig 'rig1'")
        assert lab.ask("GET", "/calibrations?participant=P03")["calibrations"] == []
        page.get_by_role("button", name="Cancel").press("Enter")
        expect_cancelled(page)
        page.get_by_role("link", name="Live", exact=True).click()
        expect(page.locator("#surface")).to_be_visible()


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGKILL for others")
def test_rejections_are_told_over_a_death_of_the_service(lab: Lab, open_page: OpenPage) -> None:
    # Without an approach the finger still presses as it did for the trial before.
    hasty = {
        "Forces, N": "0.2, 1.0",
        "Approach, s": "0",
        "Recorded, s": "0.5",
        "Most repeats of a rejected trial": "100",
    }
    with open_page(expected="ERR_") as page:
        arrive(page, lab)
        start(page, "P04", {**ENDLESS, **hasty})
        rejected = page.get_by_text(re.compile(r"^trial \S+ rejected: .+; accepted: "))
        expect(rejected.first).to_be_visible(timeout=GUIDED_MS)
        expect(page.locator(".readings")).to_contain_text(re.compile("Rejected [1-9]"))

        os.kill(lab.supervisor.pid_of("api"), signal.SIGKILL)
        expect(state(page)).to_contain_text("It was last heard of as: Running")
        expect(page.get_by_role("button", name="Cancel")).to_be_hidden()
        expect(state(page)).to_contain_text("Interrupted", timeout=BEGUN_MS)
        before = rejected.count()
        page.get_by_role("button", name="Resume").click()
        expect(page.locator(".guidance")).to_contain_text("Slide at", timeout=GUIDED_MS)
        expect_running(page)
        expect(rejected.nth(before)).to_be_attached(timeout=BEGUN_MS)
        cancel(page)
        told = rejected.all_inner_texts()
        assert len(set(told)) == len(told)
        assert page.evaluate("window.loadedOnce")


def test_one_person_is_recorded_for_discovery(page: Page, lab: Lab) -> None:
    page.get_by_role("combobox", name="Protocol").select_option("discovery")
    start(page, "P06", {})
    expect(page.locator(".readings")).to_contain_text("of 72 planned", timeout=BEGUN_MS)
    (calibration,) = lab.ask("GET", "/calibrations?participant=P06")["calibrations"]
    assert PaperProtocol.model_validate(calibration["spec"]["protocol"]) == FOR_DISCOVERY
    cancel(page)


def test_what_is_under_way_is_found_and_seen_by_who_may_not_calibrate(
    page: Page, lab: Lab, open_page: OpenPage, tmp_path: Path
) -> None:
    page.get_by_role("combobox", name="Protocol").select_option("paper")
    start(page, "P05", {})
    expect(page.locator(".readings")).to_contain_text("of 375 planned", timeout=BEGUN_MS)
    (calibration,) = lab.ask("GET", "/calibrations?participant=P05")["calibrations"]
    asked = PaperProtocol.model_validate(calibration["spec"]["protocol"])
    assert asked == PaperProtocol()
    # By its own address, and by that of the view.
    page.reload()
    expect_shown(page, "P05")
    page.goto(f"{lab.url}/dashboard/#/live/rig1")
    page.get_by_role("link", name="Calibrate").click()
    expect_shown(page, "P05")
    # It knows of no calibration.
    registry = RegistryConfig(url=f"sqlite:///{tmp_path / 'registry.db'}")
    with read_only(lab, registry=registry) as url, open_page() as reader:
        enter(reader, f"{url}#/calibrate/rig1")
        expect(reader.locator(".guidance")).to_contain_text("Slide at", timeout=GUIDED_MS)
        expect(reader.get_by_text("None was started yet.")).to_be_visible()
        expect(reader.get_by_text("A calibration needs the scope calibrate.")).to_be_visible()
        for name in ("Start", "Cancel", "Publish", "Activate"):
            expect(reader.get_by_role("button", name=name)).to_be_hidden()
    cancel(page)


def test_the_participants_page_has_the_guidance_alone(
    page: Page, lab: Lab, open_page: OpenPage
) -> None:
    start(page, "P06", ENDLESS)
    with open_page() as tablet:
        tablet.goto(f"{lab.url}/dashboard/#/participant/rig1")
        guidance = tablet.locator("#view-participant .guidance")
        expect(guidance).to_contain_text("Slide at", timeout=GUIDED_MS)
        expect(tablet.locator("#view-participant .asked")).to_be_hidden()
        expect(tablet.get_by_role("button", name="STOP")).to_be_visible()
        expect(tablet.get_by_role("link")).to_have_count(0)
        expect_no_violations(tablet)
        # It is held since its first trial, not since the one that is under way.
        since = page.locator("#since")
        first = page.wait_for_function(  # between two trials the rig is disarmed
            "() => [document.getElementById('since').innerText].find(it => /^since /.test(it))"
        ).json_value()
        trial = page.locator(".readings").get_by_text(re.compile(r"^Trials [4-9]"))
        expect(trial).to_be_visible(timeout=60_000)
        expect(since).to_have_text(first)
        # Whoever looks elsewhere reads where it was stopped.
        expect(guidance).to_contain_text("Get going")
        tablet.get_by_role("button", name="STOP").click()
        expect(since).to_contain_text("by the participant's page at")
        expect(state(page)).to_contain_text("Failed", timeout=BEGUN_MS)
        failure = page.locator("#view-calibrate [role=alert]")
        expect(failure).to_contain_text("stopped by the participant's page")
        let_pass(tablet, 31.0)  # it is gone half a minute after its last word
        expect(guidance).to_be_hidden(timeout=60_000)
        expect(tablet.locator("#view-participant .asked")).to_contain_text("Please wait")

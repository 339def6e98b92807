"""Recording by clicks, before a real daemon with its recorder; and the log of what happened."""

import re
from collections.abc import Iterator

import numpy as np
import pytest
from playwright.sync_api import Page, expect
from tests.dashboard.conftest import OpenPage
from tests.dashboard.lab import WIDTHS, Lab, enter, expect_no_violations, read_only, running

import frictus
from frictus_hardware import SimulatedConfig
from frictus_hardware.replay.tape import read_tape
from frictus_hardware.simulated.strokes import SteadyStrokes
from frictus_service.recording.reader import RecordingReader
from frictus_service.recording.summary import summarise

pytestmark = pytest.mark.browser

LINES = frictus.Scene(
    name="lines",
    regions=[
        frictus.Region(
            texture=frictus.Spectrum(
                components=[frictus.Component(amplitude_n=0.02, cycles_per_mm=2.0)]
            )
        )
    ],
)


@pytest.fixture(scope="module")
def lab(browser: object, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Lab]:
    finger = SimulatedConfig(finger=SteadyStrokes(speed_mm_s=25.0))
    with running(tmp_path_factory.mktemp("lab"), recorder=True, backend=finger) as lab:
        yield lab


def test_records_by_clicks_lists_and_saves_it(page: Page, lab: Lab) -> None:
    name = page.get_by_label("Name of the recording")
    expect(name).to_have_value(re.compile(r"^rig1-\d{8}-\d{6}$"))
    name.fill("by-clicks")
    page.get_by_role("button", name="Record", exact=True).click()
    state = page.locator(".recording-state")
    expect(state).to_have_text(
        re.compile(r"^Recording by-clicks: [\d.]+ s, [\d.]+ [kM]?B, nothing lost$")
    )
    # By the keyboard: what is told of the recording moves what a pointer would hit.
    page.get_by_text("Recordings", exact=True).press("Enter")
    table = page.get_by_role("table", name="Recordings, the newest first")
    expect(table).to_contain_text("not finished")
    page.get_by_role("button", name="End the recording").click()
    expect(state).to_have_text(
        re.compile(r"^The last one, by-clicks: [\d.]+ s, [\d.]+ [kM]B, nothing lost\.$")
    )
    expect(table.get_by_role("row", name="by-clicks")).to_contain_text(" s")
    page.get_by_role("button", name="Open by-clicks").click()
    opened = page.get_by_role("region", name="One recording")
    expect(opened.get_by_role("heading")).to_have_text("by-clicks")
    expect(opened).to_contain_text("Complete: ")
    expect(opened.get_by_role("button", name="As a study")).to_be_disabled()
    expect(opened).to_contain_text("Nobody was guided in it")
    expect(opened.locator("code").first).to_have_text("frictus export --help")
    force = opened.get_by_role("img", name="Normal force over time")
    expect(force).to_have_attribute("aria-label", re.compile(r"[\d.]+ to [\d.]+ N$"))
    speed = opened.get_by_role("img", name="Speed of the finger")
    expect(speed).to_have_attribute("aria-label", re.compile(r"[\d.]+ to [\d.]+ mm/s$"))
    file = lab.config.recordings.resolve() / "by-clicks.mcap"
    asked = f"--router {lab.config.router.endpoint} --site {lab.config.site}"
    expect(opened.locator("code").last).to_have_text(f"frictus replay {file} {asked}")
    spaced = page.evaluate(
        """async (found) => (await import(new URL("recordings/opened.js", document.baseURI)))
          .replaying("pilot", found)""",
        {"folder": r"C:\A lab\rec", "site": "lab", "router": "tcp/h:1"},
    )
    assert spaced == r'frictus replay "C:\A lab\rec/pilot.mcap" --router tcp/h:1 --site lab'
    expect_no_violations(page, WIDTHS)
    with page.expect_download() as saved:
        opened.get_by_role("button", name="As a rig to replay (NPZ)").click()
    assert saved.value.suggested_filename == "by-clicks.npz"
    tape = read_tape(saved.value.path())
    assert np.nanmean(np.abs(tape.force)) > 0.0
    expect(opened).to_contain_text("by-clicks.npz is saved. complete: ")
    with page.expect_download() as saved:
        opened.get_by_role("button", name="Download (MCAP)").click()
    assert saved.value.suggested_filename == "by-clicks.mcap"
    kept = saved.value.path()
    assert kept.read_bytes() == (lab.config.recordings / "by-clicks.mcap").read_bytes()
    with RecordingReader(lab.config.recordings / "by-clicks.mcap") as reader:
        assert summarise(reader).sound
    page.locator("#events summary").click()
    expect(page.locator("#events-list")).to_contain_text("Recording by-clicks begins")
    expect(page.locator("#events-list")).to_contain_text("by-clicks ends, nothing lost")


def test_a_name_that_is_taken_is_refused_in_words(lab: Lab, open_page: OpenPage) -> None:
    lab.ask("POST", "/rigs/rig1/recordings", {"name": "taken"})
    lab.ask("POST", "/rigs/rig1/recording/stop")
    with open_page("Failed to load resource") as page:
        page.goto(lab.url)
        page.get_by_label("Name of the recording").fill("taken")
        page.get_by_role("button", name="Record", exact=True).click()
        expect(page.locator("#record > .outcome")).to_contain_text("Not started: ")
        expect(page.locator("#record > .outcome")).to_contain_text("take another name")


def test_who_only_reads_sees_what_runs_and_may_not_end_it(
    lab: Lab, open_page: OpenPage
) -> None:
    with read_only(lab) as url, open_page() as page:
        enter(page, url)
        expect(page.locator("#connection")).to_have_text("Live")
        lab.ask("POST", "/rigs/rig1/recordings", {"name": "watched"})
        expect(page.locator(".recording-state")).to_contain_text("Recording watched")
        expect(page.get_by_role("button", name="End the recording")).to_be_hidden()
        lab.ask("POST", "/rigs/rig1/recording/stop")
        expect(page.locator(".recording-state")).to_contain_text("The last one, watched")
        expect(page.get_by_role("button", name="Record", exact=True)).to_be_hidden()


def test_the_log_is_found_from_any_view_and_names_who_did_what(page: Page, lab: Lab) -> None:
    page.get_by_role("link", name="Models", exact=True).click()
    page.locator("#events summary").click()
    log = page.locator("#events-list")
    with lab.rig.arm(lease_ms=10_000):
        expect(log).to_contain_text("Armed by tester")
        lab.rig.set_scene(LINES)
        expect(log).to_contain_text("Scene lines by tester")
        lab.rig.compensate("none")
        expect(log).to_contain_text("Compensation set to Off by tester")
        expect_no_violations(page)
        page.keyboard.press("Escape")
        lab.status(lambda status: status.state == "disarmed")
    expect(log).to_contain_text("Stopped by you, held by tester")
    first = log.locator("li").first
    expect(first.locator("time")).to_have_text(re.compile(r"^\d\d:\d\d:\d\d$"))
    lab.rig.set_adaptation("suggest")
    expect(log).to_contain_text("Policy: Suggest by tester")
    lab.rig.set_adaptation("observe")
    expect(log).to_contain_text("Policy: Observe by tester")

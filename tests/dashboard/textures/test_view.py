"""The whole view: for everybody, for who may only look, and while the service is gone."""

import os
import signal
import sys

import pytest
from playwright.sync_api import Page, expect
from tests.dashboard.conftest import OpenPage
from tests.dashboard.lab import WIDTHS, Lab, enter, expect_no_violations, read_only
from tests.dashboard.textures.view import LINES, arrive, choose, drop, links, part, wav

pytestmark = pytest.mark.browser

RETURN_MS = 60_000


def test_anybody_can_use_it(page: Page) -> None:
    choose(page, "paper")
    page.get_by_role("button", name="Edit a copy").click()
    drop(page, "tone.wav", wav({100.0: 0.5}))
    expect(part(page, "A recording becomes a texture").locator("canvas")).to_be_visible()
    expect(part(page, "A against B")).to_be_visible()
    expect(part(page, "Editor")).to_contain_text("Not saved yet.")
    part(page, "Scene: which texture is felt where").get_by_role(
        "button", name="Add a region"
    ).click()
    for summary in page.locator("#view-textures summary:visible").all():
        summary.click()
    expect_no_violations(page, WIDTHS)


def test_reader_looks_and_sees_no_button_that_would_fail(lab: Lab, open_page: OpenPage) -> None:
    lab.rig.set_scene(LINES)
    with read_only(lab) as url, open_page() as page:
        enter(page, f"{url}#/textures/rig1/paper")
        expect(page.locator("#connection")).to_have_text("Live")
        expect(part(page, "Preview").get_by_text("On rig1: feasible gain ")).to_be_visible()
        scene = part(page, "Scene: which texture is felt where")
        expect(scene).to_contain_text("rig1 renders the scene lines (Lines): ")
        expect(scene.locator("canvas")).to_be_visible()
        expect(page.locator("#view-textures").get_by_role("button")).to_have_text(["Listen"])
        expect(part(page, "A recording becomes a texture")).to_be_hidden()


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGKILL for others")
def test_loss_and_return_are_shown_without_a_reload(lab: Lab, open_page: OpenPage) -> None:
    with open_page(expected="ERR_") as page:
        arrive(page, lab, "paper")
        expect(part(page, "Preview").get_by_text("On rig1: ")).to_be_visible()
        scene = part(page, "Scene: which texture is felt where")
        expect(scene).to_contain_text("rig1 renders the scene")
        os.kill(lab.supervisor.pid_of("api"), signal.SIGKILL)
        expect(scene).to_contain_text("What rig1 renders is not known.")
        expect(page.locator("#connection")).to_contain_text("No connection")
        links(page).get_by_text("vinyl", exact=True).click()
        expect(part(page, "Preview").get_by_role("heading", name="vinyl")).to_be_visible()
        expect(page.locator("#connection")).to_contain_text("Live again", timeout=RETURN_MS)
        expect(part(page, "Preview")).to_contain_text("A spectrum of ")
        expect(part(page, "Preview").get_by_text("On rig1: ")).to_be_visible()
        expect(scene).to_contain_text("rig1 renders the scene")
        assert page.evaluate("window.loadedOnce")

"""The switch of the compensation mode before a real daemon: who has it, what it changes."""

import re
from collections.abc import Iterator

import pytest
from playwright.sync_api import Locator, Page, expect
from tests.dashboard.conftest import OpenPage
from tests.dashboard.lab import Lab, enter, expect_no_violations, read_only, running

import frictus
from frictus_hardware import SimulatedConfig
from frictus_hardware.simulated.strokes import SteadyStrokes
from frictus_service.fidelity.preview import JND_DB

pytestmark = pytest.mark.browser

TEXTURE = frictus.Spectrum(
    components=[
        frictus.Component(amplitude_n=0.02, hz=hz) for hz in (160.0, 315.0, 500.0, 800.0, 1e3)
    ]
)


@pytest.fixture(scope="module")
def lab(browser: object, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Lab]:
    """A daemon under whose slow finger compensation matters."""
    finger = SimulatedConfig(finger=SteadyStrokes(speed_mm_s=25.0))
    with running(tmp_path_factory.mktemp("lab"), backend=finger) as lab:
        lab.rig.set_scene(TEXTURE)
        yield lab


def switch(page: Page) -> Locator:
    return page.get_by_role("group", name="Compensation")


def badge(page: Page) -> Locator:
    return page.locator("[data-badge=compensation]")


def press(page: Page, name: str) -> None:
    button = switch(page).get_by_role("button", name=name)
    button.click()
    expect(button).to_have_attribute("aria-pressed", "true")
    expect(switch(page).locator("[aria-pressed=true]")).to_have_count(1)


def arm(page: Page, lab: Lab) -> None:
    page.get_by_role("button", name="Arm", exact=True).click()
    lab.status(lambda status: status.state == "armed")
    expect(switch(page)).to_be_visible()


def disarm(page: Page, lab: Lab) -> None:
    page.get_by_role("button", name="Disarm").click()
    lab.status(lambda status: status.state == "disarmed")


def test_the_holder_switches_and_everybody_sees_it(
    page: Page, lab: Lab, open_page: OpenPage
) -> None:
    # The other page is there first: to load one takes the cores that renew a lease.
    with open_page() as other:
        other.goto(lab.url)
        expect(other.locator("#connection")).to_have_text("Live")
        expect(switch(page)).to_be_hidden()
        arm(page, lab)
        expect(switch(page).get_by_role("button", name="Model")).to_have_attribute(
            "aria-pressed", "true"
        )
        expect(badge(page)).to_have_count(0)
        press(page, "Off")
        assert lab.status(lambda status: status.compensation.mode == "none")
        for each in (page, other):
            expect(badge(each)).to_contain_text("Not compensated")
        expect(switch(other)).to_be_hidden()
        press(page, "Fixed 60 mm/s")
        found = lab.status(lambda status: status.compensation.mode == "fixed")
        assert found.compensation.speed_mm_s == 60.0
        for each in (page, other):
            expect(badge(each)).to_contain_text("as for 60 mm/s")
        press(page, "Model")
        for each in (page, other):
            expect(badge(each)).to_have_count(0)
        press(page, "Off")
        disarm(page, lab)
        for each in (page, other):
            expect(badge(each)).to_have_count(0)
    expect(switch(page)).to_be_hidden()
    arm(page, lab)
    assert lab.rig.status().compensation.mode == "model"
    disarm(page, lab)


def expect_error(page: Page, above: bool) -> None:
    """Wait until the spectrum says how far the bands are off, above or below the threshold."""
    page.wait_for_function(
        """([above, jnd]) => {
          const told = document.querySelector("#spectrum .summary").textContent;
          const rms = parseFloat((told.match(/([0-9.]+) dB rms/) ?? [])[1]);
          return above ? rms > jnd : rms < jnd;
        }""",
        arg=[above, JND_DB],
        timeout=30_000,
    )


def test_the_felt_spectrum_leaves_the_band_and_comes_back(
    lab: Lab, open_page: OpenPage
) -> None:
    # It is measured while it is seen: beside the switch on a screen that is high enough.
    with open_page(viewport={"width": 1280, "height": 1_800}) as page:
        page.goto(lab.url)
        arm(page, lab)
        expect_error(page, above=False)
        press(page, "Off")
        expect_error(page, above=True)
        press(page, "Model")
        expect_error(page, above=False)
        disarm(page, lab)


def test_a_choice_of_another_client_is_shown_as_it_is(page: Page, lab: Lab) -> None:
    with lab.rig.arm(lease_ms=10_000, share_with=["local"]):
        lab.rig.compensate("fixed", speed_mm_s=45.0)
        pressed = switch(page).locator("[aria-pressed=true]")
        expect(pressed).to_have_text("Fixed 45 mm/s")
        expect(badge(page)).to_contain_text("as for 45 mm/s")
        press(page, "Off")  # shared with it
        assert lab.status(lambda status: status.compensation.mode == "none")
        expect_no_violations(page)


def test_of_quick_choices_the_last_one_holds(page: Page, lab: Lab) -> None:
    arm(page, lab)
    buttons = switch(page).get_by_role("button")
    buttons.evaluate_all("all => [2, 1, 0, 2, 1].forEach((i) => all[i].click())")
    lab.status(lambda status: status.compensation.mode == "fixed")
    expect(buttons.nth(1)).to_have_attribute("aria-pressed", "true")
    disarm(page, lab)


def test_what_is_not_answered_or_refused_is_told(lab: Lab, open_page: OpenPage) -> None:
    with open_page("Failed to load resource") as page:
        page.goto(lab.url)
        arm(page, lab)
        outcome, off = page.locator("#compensation-outcome"), switch(page).get_by_text("Off")
        path = re.compile("/compensation$")
        page.route(path, lambda route: route.abort())
        off.click()
        expect(outcome).to_contain_text("Unknown whether it is switched")
        page.unroute(path)
        refusal = {"code": "not_feasible", "detail": "no such speed"}
        page.route(path, lambda route: route.fulfill(status=422, json=refusal))
        off.click()
        expect(outcome).to_have_text("Not switched: no such speed")
        expect(switch(page).locator("[aria-pressed=true]")).to_have_text("Model")
        page.unroute(path)
        press(page, "Off")
        expect(outcome).to_have_text("")
        disarm(page, lab)


def test_who_only_reads_has_no_switch(lab: Lab, open_page: OpenPage) -> None:
    with read_only(lab) as url, open_page() as page:
        enter(page, url)
        expect(page.locator("#connection")).to_have_text("Live")
        with lab.rig.arm(lease_ms=10_000, share_with=["reader"]):
            lab.rig.compensate("none")
            expect(badge(page)).to_contain_text("Not compensated")
            expect(switch(page)).to_be_hidden()

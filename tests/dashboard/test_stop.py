"""A stop that stops nothing says so."""

import pytest
from playwright.sync_api import expect
from tests.dashboard.conftest import OpenPage
from tests.dashboard.lab import Lab, arrive, read_only

pytestmark = pytest.mark.browser


@pytest.mark.parametrize(
    ("status", "told"),
    [
        (401, "rig1 was not stopped: not known here. Switch the amplifier off."),
        (429, "rig1 answered the stop"),  # asked again
    ],
)
def test_a_stop_that_is_refused_says_that_it_stopped_nothing(
    status: int, told: str, lab: Lab, open_page: OpenPage
) -> None:
    problem = {"code": "refused", "detail": "not known here"}
    with open_page(expected=f"status of {status}") as page:
        arrive(page, lab.url)
        page.route(
            "**/v1/rigs/rig1/stop",
            lambda route: route.fulfill(status=status, json=problem),
            times=1,
        )
        page.keyboard.press("Escape")
        expect(page.locator("#stop-outcome")).to_contain_text(told)


def test_a_stop_of_no_rig_claims_nothing_of_screens(lab: Lab, open_page: OpenPage) -> None:
    with read_only(lab) as url, open_page() as page:
        page.goto(url)
        expect(page.locator("#connection")).to_contain_text("Not let in")
        page.keyboard.press("Escape")
        expect(page.locator("#stop-outcome")).to_contain_text("Nothing was stopped")
        expect(page.locator("#stop-outcome")).to_contain_text("Switch its amplifier off")

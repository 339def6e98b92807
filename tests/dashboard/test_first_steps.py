"""What the page says first: where there is no rig, and what its help explains."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import expect
from tests.dashboard.conftest import OpenPage
from tests.dashboard.lab import Lab, expect_no_violations, running

pytestmark = pytest.mark.browser


@pytest.fixture(scope="module")
def lab(browser: object, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Lab]:
    with running(tmp_path_factory.mktemp("lab"), rig=False) as lab:
        yield lab


@pytest.mark.parametrize("width", [390, 1440])
def test_without_a_rig_the_page_says_how_to_start_one(
    width: int, lab: Lab, open_page: OpenPage
) -> None:
    with open_page(viewport={"width": width, "height": 900}) as page:
        page.goto(lab.url)
        first = page.locator("#first")
        expect(first.get_by_role("heading")).to_have_text("No rig is present")
        expect(first).to_contain_text("frictus rig")
        expect(page.locator("#strip")).to_be_hidden()
        expect(page.locator("#first-cards")).to_be_hidden()
        expect_no_violations(page)
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        page.get_by_role("link", name="Models", exact=True).click()
        expect(first).to_be_hidden()
        page.get_by_role("link", name="Live", exact=True).click()
        first.get_by_role("link", name="First steps").click()
        expect(page.get_by_role("heading", name="Start a rig")).to_be_visible()
        expect_no_violations(page)
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        page.get_by_role("link", name="Back to the dashboard").click()
        expect(first.get_by_role("heading")).to_have_text("No rig is present")


def test_page_without_a_service_says_so(open_page: OpenPage, folder_url: str) -> None:
    with open_page(expected="WebSocket") as page:
        page.goto(f"{folder_url}/index.html")
        expect(page.locator("#connection")).to_contain_text("No connection to the service")
        expect(page.locator("#rig")).to_be_hidden()
        expect(page.locator("#stop")).to_be_visible()

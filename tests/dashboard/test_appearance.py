"""Theme and density, chosen at the foot of the page, before a real daemon."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Page, expect
from tests.dashboard.conftest import OpenPage
from tests.dashboard.lab import WIDTHS, Lab, expect_no_violations, running

pytestmark = pytest.mark.browser

GROUND = "() => getComputedStyle(document.body).backgroundColor"
LIGHT, DARK = "rgb(243, 245, 247)", "rgb(16, 20, 24)"
INK_DRAWN = """async () => {
  // That the system's scheme changed is told to the page with its next frame.
  await new Promise((next) => requestAnimationFrame(() => requestAnimationFrame(next)));
  return (await import(new URL("canvas/colours.js", document.baseURI))).colour("--ink");
}"""


@pytest.fixture(scope="module")
def lab(browser: object, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Lab]:
    with running(tmp_path_factory.mktemp("lab")) as lab:
        yield lab


@pytest.fixture
def page(lab: Lab, open_page: OpenPage) -> Iterator[Page]:
    with open_page(color_scheme="light") as page:
        page.goto(lab.url)
        expect(page.locator("#connection")).to_have_text("Live")
        yield page


def test_a_theme_holds_for_what_is_written_and_drawn_and_after_a_reload(page: Page) -> None:
    theme = page.get_by_role("group", name="Theme")
    expect(theme.get_by_role("button", pressed=True)).to_have_text("System")
    assert page.evaluate(GROUND) == LIGHT
    page.emulate_media(color_scheme="dark")
    assert page.evaluate(GROUND) == DARK
    assert page.evaluate(INK_DRAWN) == "#eef2f5"
    theme.get_by_role("button", name="Light").click()
    assert page.evaluate(GROUND) == LIGHT
    assert page.evaluate(INK_DRAWN) == "#14181d"
    theme.get_by_role("button", name="Dark").click()
    page.emulate_media(color_scheme="light")
    page.reload()
    expect(theme.get_by_role("button", pressed=True)).to_have_text("Dark")
    assert page.evaluate(GROUND) == DARK
    assert page.evaluate(INK_DRAWN) == "#eef2f5"
    theme.get_by_role("button", name="System").click()
    assert page.evaluate(GROUND) == LIGHT


def test_a_dense_page_shows_more_and_stays_usable_at_every_width(page: Page) -> None:
    height = "() => document.getElementById('strip').offsetHeight"
    roomy_px = page.evaluate(height)
    page.get_by_role("group", name="Density").get_by_role("button", name="Dense").click()
    assert page.evaluate(height) == pytest.approx(0.875 * roomy_px, abs=1)
    expect_no_violations(page, WIDTHS)
    page.reload()
    dense = page.get_by_role("group", name="Density").get_by_role("button", pressed=True)
    expect(dense).to_have_text("Dense")


def test_what_was_kept_and_is_no_choice_of_today_is_passed_over(page: Page) -> None:
    page.evaluate("() => localStorage.setItem('frictus-theme', 'url(evil)')")
    page.reload()
    pressed = page.get_by_role("group", name="Theme").get_by_role("button", pressed=True)
    expect(pressed).to_have_text("System")
    assert page.evaluate(GROUND) == LIGHT

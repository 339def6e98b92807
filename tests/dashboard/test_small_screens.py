"""Phones, low windows and pages enlarged twice: all of the page can be reached."""

import pytest
from playwright.sync_api import expect
from tests.dashboard.conftest import OpenPage
from tests.dashboard.lab import SCENE, Lab, arrive, enter, read_only

pytestmark = pytest.mark.browser


@pytest.mark.parametrize(
    ("view", "wide"), [("live", "10\u00a0min"), ("experiment", "The newest first")]
)
def test_nothing_overflows_on_the_narrowest_screen(
    view: str, wide: str, lab: Lab, open_page: OpenPage
) -> None:
    with open_page(viewport={"width": 320, "height": 640}) as page:
        arrive(page, f"{lab.url}/dashboard/#/{view}/rig1")
        expect(page.locator("main").get_by_text(wide, exact=True).first).to_be_visible()
        assert page.evaluate("document.documentElement.scrollWidth") <= 320


def test_a_token_can_be_given_on_a_low_screen(lab: Lab, open_page: OpenPage) -> None:
    low = {"width": 640, "height": 400}  # of 1280 px and 800 px, twice as large
    with read_only(lab) as url, open_page(viewport=low) as page:
        enter(page, url)
        expect(page.locator("#connection")).to_have_text("Live")


def test_a_name_of_one_long_word_is_broken(lab: Lab, open_page: OpenPage) -> None:
    lab.rig.set_scene(SCENE.model_copy(update={"name": "w" * 64}))
    try:
        with open_page(viewport={"width": 360, "height": 740}) as page:
            arrive(page, lab.url)
            expect(page.locator("#scene-text")).to_contain_text("wwww")
            assert page.evaluate("document.documentElement.scrollWidth") <= 360
    finally:
        lab.rig.set_scene(SCENE)
